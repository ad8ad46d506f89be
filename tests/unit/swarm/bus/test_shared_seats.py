"""Seats of one process that share a session: what the bus is asked for, and what a fault does.

What every seat does like any other is in tests/contract/test_bus.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from swarm.bus.port import BusEvent, LinkDown, LinkUp, Sample, TokenGone, TokenSeen
from swarm.bus.shared_seats import SharedSeat, SharedSeats
from swarm.runtime.errors import BusError
from tests.support.memory_bus import MemoryBus, MemoryNetwork


class RecordedBus(MemoryBus):
    """Remembers what it was asked for."""

    def __init__(self, bus: MemoryBus, network: MemoryNetwork) -> None:
        self.__dict__.update(bus.__dict__)
        self.network = network
        self.asked: list[tuple[str, str]] = []
        self.ways: dict[str, tuple[bool, bool]] = {}
        self.closed = 0

    def subscribe(self, key_expr: str, *, latest: bool = False, gathered: bool = False) -> None:
        asked = [*self.asked, ("subscribe", key_expr)]
        self.ways[key_expr] = latest, gathered
        super().subscribe(key_expr, latest=latest, gathered=gathered)
        self.asked = asked  # on the way there it unsubscribes

    def unsubscribe(self, key_expr: str) -> None:
        self.asked.append(("unsubscribe", key_expr))
        super().unsubscribe(key_expr)

    def watch_tokens(self, key_expr: str) -> None:
        self.asked.append(("watch", key_expr))
        super().watch_tokens(key_expr)

    def release_token(self, key: str) -> None:
        self.asked.append(("release", key))
        self.inbox.offer(TokenGone(key))

    def stop_serving(self, key: str) -> None:
        self.asked.append(("stop", key))

    def close(self) -> None:
        self.closed += 1
        super().close()


Play = Callable[[SharedSeats, list[RecordedBus]], Awaitable[None]]


def play(scenario: Play) -> None:
    """Seats of one process on a network in memory; the buses that they have opened."""

    async def run() -> None:
        network, opened = MemoryNetwork(), list[RecordedBus]()

        async def open_bus() -> RecordedBus:
            bus = network.join(f"process {len(opened)}")
            opened.append(RecordedBus(bus, network))
            return opened[-1]

        await scenario(SharedSeats(open_bus), opened)

    asyncio.run(run())


async def settled() -> None:
    for _ in range(20):
        await asyncio.sleep(0)


async def three(seats: SharedSeats) -> list[SharedSeat]:
    return [await seats.seat() for _ in range(3)]


def test_the_bus_is_asked_once_for_what_several_want_and_until_nobody_does() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, c = await three(seats)
        for seat in (a, b):
            seat.subscribe("m/uav/*/claim")
            seat.watch_tokens("m/alive/*")
        a.unsubscribe("m/uav/*/claim")
        assert opened[0].asked == [("subscribe", "m/uav/*/claim"), ("watch", "m/alive/*")]

        b.close()
        assert opened[0].asked[2:] == [("unsubscribe", "m/uav/*/claim")]
        for seat in (a, c):
            assert opened[0].closed == 0
            seat.close()
        assert (len(opened), opened[0].closed) == (1, 1)

        again = await seats.seat()
        assert len(opened) == 2
        again.close()

    play(scenario)


def test_one_that_comes_while_others_gather_hears_all_with_what_they_gather() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, _ = await three(seats)
        a.subscribe("claims", latest=True, gathered=True)
        b.subscribe("claims")
        assert opened[0].ways["claims"] == (False, True)
        other = opened[0].network.join("another process")
        for payload in (b"1", b"2"):
            other.publish("claims", payload)
        await settled()
        assert [s for s in b.inbox.take() if isinstance(s, Sample)] == []

        a.gather()

        assert [s for s in a.inbox.take() if isinstance(s, Sample)] == [Sample("claims", b"2")]
        heard = [s for s in b.inbox.take() if isinstance(s, Sample)]
        assert heard == [Sample("claims", b"1"), Sample("claims", b"2")]

    play(scenario)


@pytest.mark.parametrize("gathered", [False, True])
def test_what_comes_is_admitted_once_for_all_seats(gathered: bool) -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        abc = await three(seats)
        asked: list[tuple[int, BusEvent]] = []
        for number, seat in enumerate(abc):
            seat.subscribe("claims", gathered=gathered)

            def admits(event: BusEvent, number: int = number) -> bool:
                asked.append((number, event))
                return event != Sample("claims", b"flood")

            seat.inbox.admits = admits
        await settled()
        asked.clear()
        other = opened[0].network.join("another process")
        for payload in (b"flood", b"word"):
            other.publish("claims", payload)
        await settled()
        for seat in abc:
            seat.gather()

        assert asked == [(0, Sample("claims", b"flood")), (0, Sample("claims", b"word"))]
        for seat in abc:
            heard = [event for event in seat.inbox.take() if isinstance(event, Sample)]
            assert heard == [Sample("claims", b"word")]

    play(scenario)


def said_on(other: MemoryBus) -> list[tuple[str, bytes]]:
    """Since it was asked last."""
    return [(s.key, s.payload) for s in other.inbox.take() if isinstance(s, Sample)]


def test_what_may_get_lost_is_said_in_its_turn_with_what_must_not_and_when_a_seat_is_left() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, c = await three(seats)
        b.subscribe("**")
        other = opened[0].network.join("another process")
        other.subscribe("**")
        await settled()

        a.publish("where/a", b"1", reliable=False)
        c.publish("where/c", b"2", reliable=False)
        await settled()
        words = [("where/a", b"1"), ("where/c", b"2")]
        assert [(s.key, s.payload) for s in b.inbox.take() if isinstance(s, Sample)] == words
        assert said_on(other) == []
        b.publish("claim/b", b"3")
        await settled()
        assert said_on(other) == [*words, ("claim/b", b"3")]

        a.publish("where/a", b"4", reliable=False)
        a.close()
        await settled()
        assert said_on(other) == [("where/a", b"4")]

    play(scenario)


def test_what_may_get_lost_is_said_soon_though_nothing_else_is() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, _, _ = await three(seats)
        other = opened[0].network.join("another process")
        other.subscribe("**")
        await settled()
        said_on(other)

        a.publish("where/a", b"1", reliable=False)
        await other.inbox.wait()

        assert said_on(other) == [("where/a", b"1")]

    play(scenario)


def test_a_seat_that_is_left_is_seen_to_be_and_asks_for_nothing_more() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, _ = await three(seats)
        a.watch_tokens("alive/*")
        b.declare_token("alive/b")
        b.serve("state/b")
        b.close()
        await settled()

        told = [event for event in a.inbox.take() if not isinstance(event, LinkUp)]
        assert told == [TokenSeen("alive/b"), TokenGone("alive/b")]
        assert opened[0].asked[-2:] == [("release", "alive/b"), ("stop", "state/b")]

    play(scenario)


def test_all_lose_the_link_together_and_see_each_other_all_the_same() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, _ = await three(seats)
        await settled()
        a.watch_tokens("alive/*")
        a.subscribe("news")
        b.declare_token("alive/b")
        opened[0].network.cut("process 0")
        b.publish("news", b"still heard")
        await settled()

        told = [TokenSeen("alive/b"), Sample("news", b"still heard"), LinkDown()]
        assert [event for event in a.inbox.take() if not isinstance(event, LinkUp)] == told
        late = await seats.seat()
        assert late.inbox.take() == []
        opened[0].network.heal("process 0")
        await settled()
        assert late.inbox.take() == [LinkUp()]

    play(scenario)


def test_a_bug_in_handing_round_leaves_nobody_deaf(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, _ = await three(seats)
        b.subscribe("news")

        def fail(*_: object) -> None:
            raise ValueError("a bug")

        monkeypatch.setattr(b.inbox, "offer", fail)
        opened[0].network.join("another process").publish("news", b"")
        await settled()

        with pytest.raises(BusError, match="closed"):
            a.publish("a", b"")
        for seat in (a, b):
            seat.close()
        assert opened[0].closed == 1

    play(scenario)


def test_what_is_for_one_seat_alone_is_heard_by_that_one() -> None:
    async def scenario(seats: SharedSeats, opened: list[RecordedBus]) -> None:
        a, b, c = await three(seats)
        for name, seat in (("a", a), ("b", b)):
            seat.subscribe(f"m/uav/*/claim/{name}")
            seat.subscribe("m/uav/*/claim")
        c.publish("m/uav/c/claim/b", b"1")
        c.publish("m/uav/c/claim", b"2")
        await settled()

        assert [s for s in a.inbox.take() if isinstance(s, Sample)] == [
            Sample("m/uav/c/claim", b"2")
        ]
        assert [s for s in b.inbox.take() if isinstance(s, Sample)] == [
            Sample("m/uav/c/claim/b", b"1"),
            Sample("m/uav/c/claim", b"2"),
        ]

    play(scenario)
