"""A bus inside one asyncio loop, for tests: what is sent has arrived.

Leaves out: delay, loss and partitions of many (sim.world.network). It behaves as clients
of one router do: a seat has its link as soon as it joins, `MemoryNetwork.cut` takes
it away. Call everything from the loop's thread; only replies may come from others.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import zenoh

from swarm.bus.port import (
    Answer,
    Inbox,
    LinkDown,
    LinkUp,
    Query,
    Sample,
    TokenGone,
    TokenSeen,
    check_key,
    check_key_expr,
    check_payload,
)
from swarm.protocol.seal import Seal
from swarm.runtime.errors import BusError


@lru_cache(maxsize=1 << 16)
def intersects(one: str, other: str) -> bool:
    """Whether some key matches both expressions; a key is an expression too."""
    return zenoh.KeyExpr(one).intersects(zenoh.KeyExpr(other))


@dataclass(slots=True, eq=False)
class _Node:
    """What the network knows of one who joined."""

    inbox: Inbox
    linked: bool = True
    subscribed: dict[str, bool] = field(default_factory=dict)
    """Key expression to whether only the newest samples are kept."""
    gathered: dict[str, bool] = field(default_factory=dict)
    """The same of what waits until it is gathered."""
    waiting: list[Sample] = field(default_factory=list)
    watched: set[str] = field(default_factory=set)
    tokens: set[str] = field(default_factory=set)
    served: set[str] = field(default_factory=set)


@dataclass(slots=True, eq=False)
class _PendingQuery:
    """A query under way."""

    loop: asyncio.AbstractEventLoop
    asker: _Node
    payload: bytes
    missing: list[tuple[_Node, str]] = field(default_factory=list)
    """Seats and their served keys that have not answered yet."""
    answers: list[Answer] = field(default_factory=list)
    complete: asyncio.Event = field(default_factory=asyncio.Event)

    def query_to(self, seat: _Node, key: str) -> Query:
        """The event by which ``seat`` is asked; its reply comes back to here."""

        def reply(payload: bytes) -> None:
            check_payload(payload)
            if not self.loop.is_closed():
                self.loop.call_soon_threadsafe(self._arrive, seat, key, bytes(payload))

        return Query(key, reply, self.payload)

    def forget(self, seat: _Node) -> None:
        """Wait no longer for a seat that left."""
        self.missing = [(other, key) for other, key in self.missing if other is not seat]
        if not self.missing:
            self.complete.set()

    def _arrive(self, seat: _Node, key: str, payload: bytes) -> None:
        place = (seat, key)
        if place in self.missing and seat.linked and self.asker.linked:
            self.answers.append(Answer(key, payload, self.loop.time()))
            self.missing.remove(place)
            if not self.missing:
                self.complete.set()


class _Hub:
    """Where all seats meet."""

    def __init__(self) -> None:
        self._seats: list[_Node] = []
        self._questions: list[_PendingQuery] = []

    def enter(self, seat: _Node) -> None:
        self._seats.append(seat)
        seat.inbox.offer(LinkUp())

    def leave(self, seat: _Node) -> None:
        self._seats.remove(seat)
        self._lose_sight_of(seat)

    def cut(self, seat: _Node) -> None:
        unseen = self._tokens_of(self._reached_from(seat))
        self._lose_sight_of(seat)
        seat.inbox.offer(LinkDown())
        _tell([seat], TokenGone, unseen)

    def heal(self, seat: _Node) -> None:
        if seat not in self._seats:
            return  # closed meanwhile
        seat.linked = True
        seat.inbox.offer(LinkUp())
        others = self._reached_from(seat)
        there = self._tokens_of(others)
        _tell([seat], TokenSeen, there)
        _tell(others, TokenSeen, seat.tokens - there)

    def publish(self, seat: _Node, sample: Sample) -> None:
        for other in self._reached_from(seat):
            lanes = [
                latest
                for key_expr, latest in other.subscribed.items()
                if intersects(key_expr, sample.key)
            ]
            for latest in lanes:
                other.inbox.offer(sample, latest)
            for key_expr in other.gathered:
                if intersects(key_expr, sample.key):
                    other.waiting.append(sample)
                    break

    def declare_token(self, seat: _Node, key: str) -> None:
        others = self._reached_from(seat)
        is_new = key not in self._tokens_of(others) | seat.tokens
        seat.tokens.add(key)
        if is_new:
            _tell(others, TokenSeen, {key})

    def watch_tokens(self, seat: _Node, key_expr: str) -> None:
        there = self._tokens_of(self._reached_from(seat)) - seat.tokens
        seat.watched.add(key_expr)
        for key in sorted(there):
            if intersects(key_expr, key):
                seat.inbox.offer(TokenSeen(key))

    def ask(
        self, seat: _Node, key_expr: str, payload: bytes, loop: asyncio.AbstractEventLoop
    ) -> _PendingQuery:
        question = _PendingQuery(loop, seat, payload)
        question.missing = [
            (other, key)
            for other in self._reached_from(seat)
            for key in sorted(other.served)
            if intersects(key_expr, key)
        ]
        for other, key in question.missing:
            other.inbox.offer(question.query_to(other, key))
        self._questions.append(question)
        question.forget(seat)  # complete at once if there is nobody to ask
        return question

    def drop(self, question: _PendingQuery) -> None:
        question.missing.clear()
        self._questions.remove(question)

    def _lose_sight_of(self, seat: _Node) -> None:
        others = self._reached_from(seat)
        seat.linked = False
        _tell(others, TokenGone, seat.tokens - self._tokens_of(others))
        for question in self._questions:
            question.forget(seat)

    def _reached_from(self, seat: _Node) -> list[_Node]:
        others = [other for other in self._seats if other is not seat and other.linked]
        return others if seat.linked else []

    @staticmethod
    def _tokens_of(seats: Iterable[_Node]) -> set[str]:
        return {key for seat in seats for key in seat.tokens}


def _tell(seats: Iterable[_Node], change: type[TokenSeen | TokenGone], keys: Iterable[str]) -> None:
    for seat in seats:
        for key in sorted(keys):
            if key not in seat.tokens and any(intersects(watch, key) for watch in seat.watched):
                seat.inbox.offer(change(key))


class MemoryNetwork:
    """What joins the seats; each is known by a name."""

    def __init__(self) -> None:
        self._hub = _Hub()
        self._seats: dict[str, _Node] = {}

    def join(self, name: str, *, inbox_capacity: int = 4096, seal: Seal | None = None) -> MemoryBus:
        """Take a seat in the running loop, under a ``name`` never used here before."""
        if name in self._seats:
            raise ValueError(f"{name} has a seat already")
        loop = asyncio.get_running_loop()
        seat = _Node(Inbox(loop, inbox_capacity))
        self._seats[name] = seat
        self._hub.enter(seat)
        return MemoryBus(self._hub, seat, loop, seal)

    def cut(self, name: str) -> None:
        """Take the link of ``name`` away: it and the others lose sight of each other."""
        if self._seats[name].linked:
            self._hub.cut(self._seats[name])

    def heal(self, name: str) -> None:
        """Give the link of ``name`` back."""
        if not self._seats[name].linked:
            self._hub.heal(self._seats[name])


class MemoryBus:
    """One seat on a `MemoryNetwork`; see `swarm.bus.port.Bus`."""

    def __init__(
        self, hub: _Hub, seat: _Node, loop: asyncio.AbstractEventLoop, seal: Seal | None = None
    ) -> None:
        self.seal = seal
        """Of whoever sits here."""
        self._hub = hub
        self._seat = seat
        self._loop = loop
        self._closed = False

    @property
    def inbox(self) -> Inbox:
        """Where everything arrives."""
        return self._seat.inbox

    def publish(self, key: str, payload: bytes, *, reliable: bool = True) -> None:
        """Send ``payload`` on ``key``."""
        self._check_open()
        check_payload(payload)
        self._hub.publish(self._seat, Sample(check_key(key), bytes(payload), self._loop.time()))

    def subscribe(self, key_expr: str, *, latest: bool = False, gathered: bool = False) -> None:
        """Receive a `Sample` for everything others publish on ``key_expr``."""
        self._check_open()
        self.unsubscribe(key_expr)
        kept = self._seat.gathered if gathered else self._seat.subscribed
        kept[check_key_expr(key_expr)] = latest

    def gather(self) -> None:
        """See `swarm.bus.port.Bus`."""
        self._check_open()
        waiting, self._seat.waiting = self._seat.waiting, []
        for sample in waiting:
            for key_expr, latest in self._seat.gathered.items():
                if intersects(key_expr, sample.key):
                    self._seat.inbox.offer(sample, latest)

    def unsubscribe(self, key_expr: str) -> None:
        """See `swarm.bus.port.Bus`."""
        self._check_open()
        self._seat.subscribed.pop(check_key_expr(key_expr), None)
        self._seat.gathered.pop(key_expr, None)

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token on ``key``."""
        self._check_open()
        self._hub.declare_token(self._seat, check_key(key))

    def watch_tokens(self, key_expr: str) -> None:
        """Receive `TokenSeen` and `TokenGone`."""
        self._check_open()
        self._hub.watch_tokens(self._seat, check_key_expr(key_expr))

    def serve(self, key: str) -> None:
        """Receive a `Query` whenever somebody else asks on ``key``."""
        self._check_open()
        self._seat.served.add(check_key(key))

    async def query(
        self, key_expr: str, payload: bytes = b"", *, timeout_s: float
    ) -> Sequence[Answer]:
        """Ask all others who serve a key matching ``key_expr``."""
        self._check_open()
        asked = check_key_expr(key_expr), bytes(check_payload(payload))
        question = self._hub.ask(self._seat, *asked, self._loop)
        try:
            async with asyncio.timeout(timeout_s):
                await question.complete.wait()
        except TimeoutError:
            pass  # what has come until now is the answer
        finally:
            self._hub.drop(question)
        return tuple(question.answers)

    def close(self) -> None:
        """Leave; the others see the tokens go."""
        if not self._closed:
            self._closed = True
            self._hub.leave(self._seat)

    def _check_open(self) -> None:
        if self._closed:
            raise BusError("the bus is closed")
