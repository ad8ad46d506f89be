"""An agent's seat on the bus: tried for until there is one, or until nobody wants it any more."""

from __future__ import annotations

import asyncio

import pytest

from agent import runner
from agent.runner import seat_or_stop
from swarm.bus.port import Bus
from swarm.runtime.errors import BusError
from swarm.runtime.process import StopRequest
from tests.support.memory_bus import MemoryNetwork
from tests.support.shell_play import play, until


class OwnError(Exception):
    """Stands for a bug."""


class Opener:
    """Fails as often as told, then opens a seat."""

    def __init__(self, failures: int, fault: Exception | None = None) -> None:
        self.tries = 0
        self.reasons: list[str] = []
        self._failures = failures
        self._fault = fault or BusError("nobody there")

    async def __call__(self) -> Bus:
        self.tries += 1
        if self.tries <= self._failures:
            raise self._fault
        return MemoryNetwork().join("u0")

    async def seat(self, stop: StopRequest) -> Bus | None:
        return await seat_or_stop(self, stop, self.reasons.append)


def test_a_seat_is_tried_for_until_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "RETRY_S", 0.0)

    async def scenario() -> None:
        opener = Opener(failures=3)

        assert await opener.seat(StopRequest()) is not None
        assert opener.reasons == ["nobody there"] * 3

    play(scenario)


def test_tries_that_fail_at_once_are_not_repeated_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "RETRY_S", 100.0)

    async def scenario() -> None:
        opener, stop = Opener(failures=100), StopRequest()
        seating = asyncio.create_task(opener.seat(stop))
        await until(lambda: bool(opener.reasons), "the first failure")
        for _ in range(100):
            await asyncio.sleep(0)
        assert opener.tries == 1

        stop.request(0)
        assert await seating is None

    play(scenario)


def test_a_stop_is_heard_between_tries_that_fail_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "RETRY_S", 0.0)

    async def scenario() -> None:
        opener, stop = Opener(failures=1000), StopRequest()
        stop.request(0)

        assert await opener.seat(stop) is None
        assert opener.tries < 1000

    play(scenario)


class Hanging:
    """Never opens; remembers that it was given up."""

    def __init__(self) -> None:
        self.trying = asyncio.Event()
        self.given_up = False

    async def __call__(self) -> Bus:
        self.trying.set()
        try:
            await asyncio.Event().wait()
        finally:
            self.given_up = True
        raise AssertionError


def test_a_try_under_way_is_given_up_when_told_to_stop() -> None:
    async def scenario() -> None:
        opening, stop = Hanging(), StopRequest()
        seating = asyncio.create_task(seat_or_stop(opening, stop, pytest.fail))
        await opening.trying.wait()
        stop.request(0)

        assert await seating is None
        assert opening.given_up

    play(scenario)


def test_a_try_under_way_does_not_outlive_who_wanted_it() -> None:
    async def scenario() -> None:
        opening = Hanging()
        seating = asyncio.create_task(seat_or_stop(opening, StopRequest(), pytest.fail))
        await opening.trying.wait()
        seating.cancel()
        with pytest.raises(asyncio.CancelledError):
            await seating

        assert opening.given_up

    play(scenario)


def test_what_is_no_trouble_of_the_bus_is_raised() -> None:
    async def scenario() -> None:
        with pytest.raises(OwnError):
            await Opener(1, OwnError()).seat(StopRequest())

    play(scenario)
