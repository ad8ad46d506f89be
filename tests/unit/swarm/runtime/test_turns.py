"""How shells of one process let each other act, and what does not wait for that."""

from __future__ import annotations

import asyncio
from functools import partial

import pytest

from swarm.model.ids import COORDINATOR
from swarm.protocol.encoding import encode
from swarm.protocol.events import (
    CommonEvent,
    LinkChanged,
    MessageReceived,
    MessagesReceived,
    Tick,
)
from swarm.protocol.timing import UNSTRETCHED_UAVS
from swarm.runtime.turns import SharedProcess, Turns
from tests.support.builders import epoch, message
from tests.support.scripted_shell import CLAIM, Action, ScriptedCore, at_work
from tests.support.shell_play import LIMIT_S, play, until

PLACE, LATER_PLACE, NEWS = LinkChanged(True), LinkChanged(False), Tick()
"""Events of a scripted core in the place of what a vehicle tells."""
EPOCH = message(COORDINATOR, epoch("u0"))


def test_what_is_put_off_happens_one_by_one_with_all_else_in_between() -> None:
    async def scenario() -> None:
        turns, loop, done = Turns(), asyncio.get_running_loop(), list[str]()

        def note(text: str) -> None:
            done.append(text)
            if text == "first":  # as if it had just come
                loop.call_soon(done.append, "read")
                turns.put_off(lambda: note("last"))

        turns.put_off(lambda: note("first"))
        turns.put_off(lambda: note("second"))
        assert done == []
        await turns.mine()
        await until(lambda: len(done) == 4, "the last")
        assert done == ["first", "read", "second", "last"]

    play(scenario)


def test_a_fault_in_one_turn_takes_no_other_turn() -> None:
    async def scenario() -> None:
        turns, done, told = Turns(), list[str](), list[str]()
        loop = asyncio.get_running_loop()
        loop.set_exception_handler(lambda _, what: told.append(repr(what["exception"])))

        def fail() -> None:
            raise RuntimeError("a fault")

        turns.put_off(fail)
        turns.put_off(lambda: done.append("after it"))
        await until(lambda: bool(done), "the turn after a fault")
        assert told == ["RuntimeError('a fault')"]

    play(scenario)


def test_what_is_due_waits_for_others_but_not_what_presses() -> None:
    async def scenario(presses: bool) -> None:
        shared, core = SharedProcess(), ScriptedCore()
        pressing_s = core.next_deadline_s if presses else lambda: None
        async with at_work(core, shared=shared, pressing_s=pressing_s) as played:
            await asyncio.sleep(0)
            shared.turns.put_off(lambda: core.heard.append(NEWS))  # another one's turn
            core.deadline_s = played.clock.now_s()
            core.heard.clear()
            played.shell.step_in_turn(PLACE)
            assert core.heard == ([PLACE] if presses else [])
            await until(lambda: len(core.heard) == 2, "both")
            assert core.heard == ([PLACE, NEWS] if presses else [NEWS, PLACE])

    for presses in (False, True):
        play(partial(scenario, presses))


def test_what_comes_to_press_while_it_waits_for_its_turn_is_done_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def scenario() -> None:
        shared, turns_left = SharedProcess(), 1000

        def react(_: CommonEvent) -> list[Action]:
            core.deadline_s = None
            return []

        core = ScriptedCore(react)

        def others() -> None:
            nonlocal turns_left
            turns_left -= 1

        async with at_work(core, shared=shared, pressing_s=lambda: 1.0) as played:
            monkeypatch.setattr(played.clock, "wall_delay_s", lambda _: 0.0)
            await asyncio.sleep(0)
            for _ in range(turns_left):
                shared.turns.put_off(others)
            core.heard.clear()
            core.deadline_s = played.clock.now_s()
            played.shell.step_in_turn(PLACE)
            played.shell.step_in_turn(LATER_PLACE)
            await until(lambda: turns_left < 990, "some turns of others")
            assert core.heard == []
            played.clock.time_s = 1.0
            await until(lambda: bool(core.heard), "what presses")
            assert core.heard == [LATER_PLACE]
            assert turns_left > 900
            await until(lambda: not turns_left, "the turns of others")
            assert core.heard == [LATER_PLACE]

    play(scenario)


def test_words_wait_for_their_turn() -> None:
    async def scenario() -> None:
        shared, core, turns_left = SharedProcess(), ScriptedCore(), 1000

        def others() -> None:
            nonlocal turns_left
            turns_left -= 1

        async with at_work(core, shared=shared) as played:
            await asyncio.sleep(0)
            for _ in range(turns_left):
                shared.turns.put_off(others)
            core.heard.clear()
            played.other.publish(CLAIM.key, encode(CLAIM))
            await until(lambda: bool(core.heard), "hearing it")

            assert turns_left == 0

    play(scenario)


@pytest.mark.parametrize("crowd", [False, True])
def test_when_what_is_said_of_the_time_came_is_told(
    crowd: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def scenario() -> None:
        words = list[MessageReceived | MessagesReceived]()

        def alone(heard: CommonEvent) -> tuple[()]:
            if isinstance(heard, MessageReceived):
                words.append(heard)
            return ()

        def together(heard: MessagesReceived) -> CommonEvent:
            words.append(heard)
            return Tick()

        loop, behind_s = asyncio.get_running_loop(), 0.0
        shared, core, now_s = SharedProcess(), ScriptedCore(alone), loop.time
        monkeypatch.setattr(loop, "time", lambda: now_s() + behind_s)

        def others() -> None:
            nonlocal behind_s
            behind_s += 0.01

        async with at_work(core, shared=shared, together=together) as played:
            await asyncio.sleep(0)
            if crowd:
                played.shell.suit_fleet(UNSTRETCHED_UAVS + 1)
            for _ in range(100):
                shared.turns.put_off(others)
            played.other.publish(EPOCH.key, encode(EPOCH))
            await until(lambda: bool(words), "hearing it")

            (heard,) = words
            assert isinstance(heard, MessagesReceived) is crowd
            assert heard.messages == (EPOCH,)
            assert heard.arrived_s is not None
            ago_s = played.clock.now_s() - heard.arrived_s
            assert 1.0 - 1e-9 <= played.clock.wall_delay_s(1.0) * ago_s < 1.0 + LIMIT_S

    play(scenario)


def test_what_waits_for_its_turn_comes_before_what_its_vehicle_tells_then() -> None:
    async def scenario() -> None:
        shared, core = SharedProcess(), ScriptedCore()
        async with at_work(core, shared=shared) as played:
            await asyncio.sleep(0)
            core.heard.clear()
            core.deadline_s = played.clock.now_s()
            played.shell.step_in_turn(PLACE)
            played.shell.step(NEWS)
            assert core.heard == [PLACE, NEWS]

    play(scenario)


def test_words_of_the_bus_wait_for_their_turn_and_are_all_heard() -> None:
    async def scenario() -> None:
        shared, core = SharedProcess(), ScriptedCore()
        async with at_work(core, shared=shared) as played:
            await asyncio.sleep(0)
            played.other.publish(EPOCH.key, encode(EPOCH))
            await until(lambda: MessageReceived(EPOCH) in core.heard, "hearing it")

    play(scenario)


def test_a_process_runs_since_it_stood_still_for_long() -> None:
    turns, clock = Turns(), ScaledClockByHand(4.0)
    assert turns.runs_since_s(clock) == 0.0
    for _ in range(20):  # dozens of shells step all along
        clock.wall_s += 0.25
        assert turns.runs_since_s(clock) == 0.0

    clock.wall_s += 3.0
    assert turns.runs_since_s(clock) == clock.now_s() == 32.0
    clock.wall_s += 0.25
    assert turns.runs_since_s(clock) == 32.0


class ScaledClockByHand:
    """So many times as fast as wall time, which is set by hand."""

    def __init__(self, speedup: float) -> None:
        self.wall_s, self._speedup = 0.0, speedup

    def now_s(self) -> float:
        return self.wall_s * self._speedup

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s / self._speedup


def test_a_core_of_a_large_fleet_is_told_before_each_step_since_when_its_process_runs() -> None:
    async def scenario(n_uav: int) -> list[float]:
        core, told = ScriptedCore(), list[float]()
        shell = partial(at_work, core, shared=SharedProcess(), runs_since=told.append)
        async with shell(together=lambda heard: MessageReceived(heard.messages[0])) as played:
            await asyncio.sleep(0)
            played.shell.suit_fleet(n_uav)
            played.clock.time_s = 7.0
            played.shell.step(PLACE)
        return told

    assert play(partial(scenario, 200)) == [7.0]
    assert play(partial(scenario, 3)) == []  # there what has come may still be unread
