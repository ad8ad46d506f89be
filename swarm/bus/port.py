"""What the runtime asks of a bus, whatever carries it.

Leaves out: what is said (swarm.wire) and how it travels (swarm.bus.memory,
swarm.bus.zenoh_bus, sim.network). Every implementation passes tests/contract/.

A bus hands everything that happens to one bounded `Inbox`, in order of arrival,
from whichever thread; nothing of the runtime is ever called on a bus thread.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

__all__ = [
    "Answer",
    "Bus",
    "BusEvent",
    "Inbox",
    "LinkDown",
    "LinkUp",
    "Query",
    "Sample",
    "TokenGone",
    "TokenSeen",
]


@dataclass(frozen=True, slots=True)
class Sample:
    """A payload was published on a subscribed key."""

    key: str
    payload: bytes


@dataclass(frozen=True, slots=True)
class TokenSeen:
    """A watched liveliness token is there."""

    key: str


@dataclass(frozen=True, slots=True)
class TokenGone:
    """A watched liveliness token has disappeared."""

    key: str


@dataclass(frozen=True, slots=True)
class LinkUp:
    """This process has its first, or again a, transport to somebody."""


@dataclass(frozen=True, slots=True)
class LinkDown:
    """This process has lost its last transport: what it sees of others proves nothing."""


@dataclass(frozen=True, slots=True)
class Query:
    """Somebody asks on a key served here; call `reply` once, from any thread."""

    key: str
    reply: Callable[[bytes], None]


@dataclass(frozen=True, slots=True)
class Answer:
    """One reply to a query."""

    key: str
    """Concrete key of the one that answered."""
    payload: bytes


BusEvent = Sample | TokenSeen | TokenGone | LinkUp | LinkDown | Query


class Inbox:
    """A bounded hand-over from bus threads to one asyncio loop.

    Two lanes: events that must not be lost (commands, claims, tokens, queries)
    and *latest* samples (status), of which only the newest per key is kept. When
    the first lane is full its oldest entry goes and `dropped` counts it: the
    registers inside are re-announced, so a drop delays agreement only.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, capacity: int = 4096) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be >= 1, not {capacity}")
        self._loop = loop
        self._capacity = capacity
        self._events: deque[BusEvent] = deque()
        self._latest: dict[str, Sample] = {}
        self._ready = asyncio.Event()
        self.dropped = 0
        """Events dropped because the reader was too slow."""

    def offer_threadsafe(self, event: BusEvent, *, latest: bool = False) -> None:
        """Hand ``event`` over from a foreign thread; returns at once.

        A loop that has ended takes nothing any more: the event is forgotten.
        """
        try:
            self._loop.call_soon_threadsafe(self.offer, event, latest)
        except RuntimeError:
            self.dropped += 1

    def offer(self, event: BusEvent, latest: bool = False) -> None:
        """Hand ``event`` over from the loop's own thread."""
        if latest and isinstance(event, Sample):
            self._latest[event.key] = event
        else:
            if len(self._events) >= self._capacity:
                self._events.popleft()
                self.dropped += 1
            self._events.append(event)
        self._ready.set()

    def take(self) -> list[BusEvent]:
        """All that has arrived, oldest first, latest-only samples last; maybe nothing."""
        events = [*self._events, *self._latest.values()]
        self._events.clear()
        self._latest.clear()
        self._ready.clear()
        return events

    async def wait(self) -> None:
        """Return as soon as `take` has something to give."""
        await self._ready.wait()


class Bus(Protocol):
    """One process's seat on the bus. Close it in ``finally``; closing twice is fine."""

    @property
    def inbox(self) -> Inbox:
        """Where everything arrives."""
        ...

    def publish(self, key: str, payload: bytes, *, reliable: bool = True) -> None:
        """Send ``payload`` on ``key``; not reliable means it may be dropped under load.

        Raises:
            BusError: the bus is closed.
            ValueError: ``key`` is not a concrete key expression.
        """
        ...

    def subscribe(self, key_expr: str, *, latest: bool = False) -> None:
        """Receive a `Sample` for everything others publish on ``key_expr``.

        Own publications do not come back. ``latest`` keeps only the newest
        unread sample of each key.
        """
        ...

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token on ``key`` until this process or its link ends."""
        ...

    def watch_tokens(self, key_expr: str) -> None:
        """Receive `TokenSeen` for tokens there are and will be, and `TokenGone`."""
        ...

    def serve(self, key: str) -> None:
        """Receive a `Query` whenever somebody asks on ``key``."""
        ...

    async def query(self, key_expr: str, *, timeout_s: float) -> Sequence[Answer]:
        """Ask everyone who serves a key matching ``key_expr``; never later than the timeout.

        Answers that came in time are returned; whoever is too late is left out.
        """
        ...

    def close(self) -> None:
        """Undeclare everything and leave; returns within a few seconds whatever the network."""
        ...
