"""What the runtime asks of a bus, whatever carries it.

Every implementation passes tests/contract/ (swarm.bus.zenoh_bus, sim.world.network,
tests.support.memory_bus).

A key is chunks joined by ``/``. In an expression the chunk ``*`` stands for any one chunk and
``**`` for any number of them, none included; neither for one that starts with ``@``. This is Zenoh
without ``$*``, wildcards inside a chunk, which no key of ours needs:
https://zenoh.io/docs/manual/abstractions/#key-expression

A bus hands everything that happens to one bounded `Inbox`, in order of arrival,
from whichever thread; nothing of the runtime is ever called on a bus thread.
"""

from __future__ import annotations

import asyncio
import threading
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from swarm.protocol.seal import Seal

MAX_PAYLOAD_BYTES = 4 << 20
"""Longest payload of a sample or an answer [bytes]."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A payload was published on a subscribed key."""

    key: str
    payload: bytes
    arrived_s: float | None = field(default=None, compare=False)
    """When it came, in the time of the reader's loop; None: that was not noted."""


@dataclass(frozen=True, slots=True)
class TokenSeen:
    """A watched liveliness token is there; told again after each `LinkUp`."""

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
    """This process has lost its last transport: what it sees of others proves nothing.

    It comes before the `TokenGone` of every watched token, which it entails. A
    token that went because the cut reached the others' side first comes earlier:
    suspect nobody before some hysteresis has passed without a `LinkDown`.
    """


@dataclass(frozen=True, slots=True)
class Query:
    """Somebody asks on a key served here; call `reply` once, from any thread.

    Replies after the first, after the asker's timeout, or after the bus has closed
    go nowhere and do no harm. An event thrown away counts as no answer.
    """

    key: str
    """The served key."""
    reply: Callable[[bytes], None]
    payload: bytes = b""
    """What came with the question."""


@dataclass(frozen=True, slots=True)
class Answer:
    """One reply to a query."""

    key: str
    """Concrete key of the one that answered."""
    payload: bytes
    arrived_s: float = field(compare=False)
    """When it came, in the time of the asker's loop; others may have been waited for since."""


BusEvent = Sample | TokenSeen | TokenGone | LinkUp | LinkDown | Query


class Inbox:
    """A bounded hand-over from bus threads to one asyncio loop.

    Two lanes: events that must not be lost (commands, claims, tokens, queries)
    and *latest* samples (status), of which only the newest per key is kept. When
    a lane is full its oldest sample or query goes and `dropped` counts it: the
    registers inside are re-announced, so a drop delays agreement only. Tokens and
    links are told once, so they go last. The bound holds also while the loop is
    too busy to read.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, capacity: int = 4096) -> None:
        if capacity < 1:
            raise ValueError(f"capacity must be >= 1, not {capacity}")
        self._loop = loop
        self._capacity = capacity
        self._lock = threading.Lock()
        self._events: deque[BusEvent] = deque()
        self._latest: dict[str, Sample] = {}
        self._waking = False
        self._ready = asyncio.Event()
        self.dropped = 0
        """Events dropped because the reader was too slow."""
        self.linger_s = 0.0
        """Wall time from the first event on for which more are waited for, so that who hears very
        many is not woken for each."""
        self.admits: Callable[[BusEvent], bool] | None = None
        """What is not to be taken in at all; asked by whichever thread brings an event, one at
        a time. None to take everything."""

    def offer_threadsafe(self, event: BusEvent, *, latest: bool = False) -> bool:
        """Hand ``event`` over from a foreign thread; returns at once, whether it was let in.

        A loop that has ended takes nothing any more: the event is forgotten.
        """
        with self._lock:
            if not self._put(event, latest):
                return False
            if self._waking:
                return True
            self._waking = True
        try:
            self._loop.call_soon_threadsafe(self._ready.set)
        except RuntimeError:  # the loop is closed
            with self._lock:
                self.dropped += len(self._events) + len(self._latest)
                self._events.clear()
                self._latest.clear()
                self._waking = False
            return False
        return True

    def offer(self, event: BusEvent, latest: bool = False, *, admitted: bool = False) -> None:
        """Hand ``event`` over from the loop's own thread; one ``admitted`` is not asked about."""
        with self._lock:
            if not self._put(event, latest, admitted):
                return
            self._waking = True
        self._ready.set()

    def offer_admitted(self, samples: Iterable[tuple[Sample, bool]]) -> None:
        """Hand over what was admitted, and whether the latest of its key is enough; see `offer`."""
        with self._lock:
            for sample, latest in samples:
                self._put(sample, latest, admitted=True)
            self._waking = True
        self._ready.set()

    def take(self) -> list[BusEvent]:
        """All that has arrived, oldest first, latest-only samples last; maybe nothing."""
        self._ready.clear()
        with self._lock:
            self._waking = False
            events = [*self._events, *self._latest.values()]
            self._events.clear()
            self._latest.clear()
        return events

    async def wait(self) -> None:
        """Return as soon as `take` has something to give, or `linger_s` later.

        It may have less than expected: whoever took in between has the rest.
        """
        await self._ready.wait()
        if self.linger_s > 0.0:
            await asyncio.sleep(self.linger_s)

    def _put(self, event: BusEvent, latest: bool, admitted: bool = False) -> bool:
        """Append under the lock, making room if there is none; False if it is not let in."""
        if not admitted and self.admits is not None and not self.admits(event):
            return False
        if latest and isinstance(event, Sample):
            if event.key not in self._latest and len(self._latest) >= self._capacity:
                del self._latest[next(iter(self._latest))]
                self.dropped += 1
            self._latest[event.key] = event
            return True
        if len(self._events) >= self._capacity:
            for place, old in enumerate(self._events):
                if isinstance(old, Sample | Query):
                    del self._events[place]
                    break
            else:
                self._events.popleft()
            self.dropped += 1
        self._events.append(event)
        return True


def check_payload(payload: bytes) -> bytes:
    """Return ``payload``.

    Raises:
        ValueError: it is longer than `MAX_PAYLOAD_BYTES`.
    """
    if len(payload) > MAX_PAYLOAD_BYTES:
        raise ValueError(
            f"{len(payload)} bytes are more than the {MAX_PAYLOAD_BYTES} a bus carries"
        )
    return payload


def check_key(key: str) -> str:
    """Return ``key``.

    Raises:
        ValueError: it is not a key: empty, or with an empty chunk or one of ``*$#?``.
    """
    fault = _key_fault(key)
    if fault is None and "*" in key:
        fault = "a key names one thing, without *"
    if fault is not None:
        raise ValueError(f"not a key: {key!r}: {fault}")
    return key


def check_key_expr(key_expr: str) -> str:
    """Return ``key_expr``.

    Raises:
        ValueError: it is not a key expression in its one canonical form: ``**``
            follows neither itself nor precedes ``*``.
    """
    fault = _key_fault(key_expr)
    if fault is not None:
        raise ValueError(f"not a key expression: {key_expr!r}: {fault}")
    return key_expr


def _key_fault(key_expr: str) -> str | None:
    if not key_expr:
        return "it is empty"
    if not key_expr.isascii() and any("\ud800" <= sign <= "\udfff" for sign in key_expr):
        return "half a surrogate pair is no text"
    before = None
    for chunk in key_expr.split("/"):
        if not chunk:
            return "an empty chunk (a / at either end, or two together)"
        if any(sign in chunk for sign in "$#?"):
            return "$, # and ? are reserved"
        if "*" in chunk and chunk not in ("*", "**"):
            return "* and ** stand alone between slashes"
        if before == "**" and chunk in ("*", "**"):
            return "write */** for **/* and ** for **/**"
        before = chunk
    return None


class Bus(Protocol):
    """One process's seat on the bus. Close it in ``finally``; closing twice is fine.

    All methods but `close` raise `BusError` once the bus is closed, and `ValueError`
    for a key or key expression that is none. All are called from the loop's thread.
    What is declared here takes a moment to reach the others: a sample published
    before they know of a subscription is not for it. Whoever joins asks for the
    current state after subscribing.
    """

    @property
    def inbox(self) -> Inbox:
        """Where everything arrives."""

    @property
    def seal(self) -> Seal | None:
        """What the others believe whoever sits here by, and it them; None without keys.

        A bus carries what it is given: whoever sits there seals and unseals it."""

    def publish(self, key: str, payload: bytes, *, reliable: bool = True) -> None:
        """Send ``payload`` on ``key``; never waits for the network.

        Samples of one publisher arrive in the order published. Not reliable means
        that one may be dropped under load.

        Raises:
            BusError: the bus is closed.
            ValueError: ``key`` is not a concrete key, or ``payload`` is longer than
                `MAX_PAYLOAD_BYTES`.
        """

    def subscribe(self, key_expr: str, *, latest: bool = False, gathered: bool = False) -> None:
        """Receive a `Sample` for everything others publish on ``key_expr``.

        Own publications do not come back. ``latest`` keeps only the newest
        unread sample of each key. What is ``gathered`` waits outside of the inbox until `gather`,
        and wakes nobody; if there is too much of it, the oldest is lost. To subscribe again
        changes how it is kept, without a gap.
        """

    def gather(self) -> None:
        """Hand over to the inbox what has come for subscriptions that are ``gathered``."""

    def unsubscribe(self, key_expr: str) -> None:
        """Receive nothing more by that very subscription; fine if there is none.

        What has arrived may still be in the inbox.
        """

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token on ``key`` until this process or its link ends.

        Two holders of one key look like one: it is gone when both are.
        """

    def watch_tokens(self, key_expr: str) -> None:
        """Receive `TokenSeen` for tokens there are and will be, and `TokenGone`.

        Tokens on keys held by this bus itself are not told.
        """

    def serve(self, key: str) -> None:
        """Receive a `Query` whenever somebody else asks on ``key``."""

    async def query(
        self, key_expr: str, payload: bytes = b"", *, timeout_s: float
    ) -> Sequence[Answer]:
        """Ask all others who serve a key matching ``key_expr``; never later than the timeout.

        Answers that came in time are returned, in order of arrival; whoever is too
        late is left out. ``payload`` is no longer than `MAX_PAYLOAD_BYTES`.
        """

    def close(self) -> None:
        """Send what is published, undeclare everything and leave.

        Returns within a few seconds whatever the network.
        """
