"""Seats of several agents of one process that share one seat on the bus, and with it a session.

With a session for each, what is said comes into the process once for every agent of it, a router
sends it as often, and each session has threads that wake. Here it comes once and is handed round;
what one of them says is handed to the others, and said on the bus for everybody else. To each other
they are there as long as both are, whatever the link. For a process whose agents trust each other:
no router is between them, and the bus has no keys. Leaves out: carrying (swarm.bus.zenoh_bus).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections import Counter, deque
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Final, Protocol

import zenoh

from swarm.bus.port import (
    Answer,
    Bus,
    BusEvent,
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
from swarm.runtime.errors import BusError
from swarm.runtime.log import get_logger

MOST_WAITING: Final = 8192
"""Samples of one seat that wait to be gathered."""
_GATHER_S: Final = 0.005
"""Between two looks at what waits on the bus, whichever seats want it: there are dozens."""
_SAY_S: Final = 0.005
"""So much later is said what may be lost, such as where UAVs are: to wake the thread that says it
for each word would cost more than the words."""
_MOST_KEYS: Final = 4096
"""Keys of which is kept by what they are subscribed to."""


class SharedBus(Bus, Protocol):
    """A bus of which a part may be given back before it is closed."""

    def release_token(self, key: str) -> None:
        """Hold the token on ``key`` no longer.

        `TokenGone` tells that nobody does then, `TokenSeen` that somebody else still does.
        """

    def stop_serving(self, key: str) -> None:
        """Receive no further `Query` on ``key``."""


@dataclass(frozen=True, slots=True)
class _Subscription:
    latest: bool
    gathered: bool


class SharedSeats:
    """Seats on one bus, which is opened with the first of them and closed with the last.

    Args:
        open_bus: opens it.
    """

    def __init__(self, open_bus: Callable[[], Awaitable[SharedBus]]) -> None:
        self._open_bus = open_bus
        self._opening = asyncio.Lock()
        self._bus: SharedBus | None = None
        self._reading: asyncio.Task[None] | None = None
        self._seats: list[SharedSeat] = []
        self._linked = False
        self._subscribed: dict[str, _Subscription] = {}
        """By key expression, what the bus has been asked for."""
        self._hearers: dict[str, list[tuple[SharedSeat, _Subscription]]] = {}
        """By key expression, who wants to hear it, and how."""
        self._tokens: dict[str, set[str]] = {}
        """By key expression that is watched, tokens of others on the bus."""
        self._matching: dict[str, list[str]] = {}
        """By key, the expressions subscribed to that match it."""
        self._dropped = 0
        self._gathered_s = -math.inf
        """When the bus was last asked for what waits, in the loop's time."""
        self._unsaid: list[Sample] = []
        """What is to be said on the bus with the next that must not be lost, or soon."""

    async def seat(self, *, inbox_capacity: int = 4096) -> SharedSeat:
        """One more seat.

        Raises:
            BusError: the bus cannot be opened.
        """
        async with self._opening:
            if self._bus is None:
                self._bus = await self._open_bus()
                self._dropped = 0
                self._reading = asyncio.get_running_loop().create_task(self._read(self._bus))
                self._reading.add_done_callback(self._fail)
        seat = SharedSeat(self, inbox_capacity)
        self._seats.append(seat)
        if self._linked:
            seat.inbox.offer(LinkUp())
        return seat

    @property
    def bus(self) -> SharedBus:
        """What carries all that is said.

        Raises:
            BusError: nobody has a seat.
        """
        if self._bus is None:
            raise BusError("the bus is closed")
        return self._bus

    def leave(self, seat: SharedSeat) -> None:
        """Nobody sits there any more."""
        self._say_unsaid()
        self._seats.remove(seat)
        if not self._seats or self._bus is None:
            self._close()
            return
        for key_expr in seat.subscriptions:
            self.subscribed(key_expr)
        for key in sorted(seat.tokens):
            if not any(key in other.tokens for other in self._seats):
                self.bus.release_token(key)  # which tells whether anybody else holds it
        for key in sorted(seat.served):
            if not any(key in other.served for other in self._seats):
                self.bus.stop_serving(key)

    def _close(self) -> None:
        bus, self._bus = self._bus, None
        if self._reading is not None:
            self._reading.cancel()
        self._linked = False
        for known in (self._subscribed, self._hearers, self._tokens, self._matching):
            known.clear()
        if bus is not None:
            bus.close()

    def _fail(self, task: asyncio.Task[None]) -> None:
        """A bug here must leave nobody deaf: whoever sits here finds the bus closed."""
        if not task.cancelled() and (fault := task.exception()):
            get_logger("swarm.bus").error("nobody is handed what comes any more", fault=repr(fault))
            self._close()

    # -- what seats ask for ---------------------------------------------------------------

    def subscribed(self, key_expr: str) -> None:
        """What seats want to hear of it has changed."""
        wanted = [
            (seat, how)
            for seat in self._seats
            if (how := seat.subscriptions.get(key_expr)) is not None
        ]
        self._hearers[key_expr] = wanted
        if key_expr not in self._subscribed or not wanted:
            self._matching.clear()
        if not wanted:
            del self._hearers[key_expr]
            if self._subscribed.pop(key_expr, None) is not None:
                self.bus.unsubscribe(key_expr)
            return
        # One that gathers does so often enough for who has just come and wants all at once, and
        # to change from one to the other would lose what waits.
        latest = all(how.latest for _, how in wanted)
        gathered = any(how.gathered for _, how in wanted)
        if self._subscribed.get(key_expr) != (now := _Subscription(latest, gathered)):
            self._subscribed[key_expr] = now
            self.bus.subscribe(key_expr, latest=latest, gathered=gathered)

    def publish(self, seat: SharedSeat, sample: Sample, *, reliable: bool) -> None:
        """Say on the bus and hand round what ``seat`` says."""
        if reliable:
            self._say_unsaid()
            self.bus.publish(sample.key, sample.payload)
        else:
            if not self._unsaid:
                asyncio.get_running_loop().call_later(_SAY_S, self._say_unsaid)
            self._unsaid.append(sample)
        self._hand_round(sample, but=seat)

    def _say_unsaid(self) -> None:
        unsaid, self._unsaid = self._unsaid, []
        if self._bus is not None:
            with contextlib.suppress(BusError):  # it ends, and all that was to be said may be lost
                for sample in unsaid:
                    self._bus.publish(sample.key, sample.payload, reliable=False)

    def gather(self) -> None:
        """Hand round what waits outside of the bus's inbox, if that was not done just now."""
        now_s = asyncio.get_running_loop().time()
        if now_s - self._gathered_s >= _GATHER_S:
            self._gathered_s = now_s
            self.bus.gather()
            self._take(self.bus)

    def declare_token(self, key: str) -> None:
        """One of the seats holds it from now on."""
        self.bus.declare_token(key)
        self._tell_token(TokenSeen(key))

    def _tell_token(self, event: TokenSeen | TokenGone) -> None:
        """Tell whoever watches it and does not hold it."""
        matching = [key_expr for key_expr in self._tokens if _matches(key_expr, event.key)]
        for seat in self._seats:
            if event.key not in seat.tokens and not seat.watched.isdisjoint(matching):
                seat.inbox.offer(event)

    def watch_tokens(self, seat: SharedSeat, key_expr: str) -> None:
        """``seat`` wants to know of these."""
        there = self._tokens.get(key_expr)
        if there is None:
            there = self._tokens[key_expr] = set()
            self.bus.watch_tokens(key_expr)  # which tells of those that there are
        beside = {key for other in self._seats for key in other.tokens}
        for key in sorted((there | beside) - seat.tokens):
            if _matches(key_expr, key):
                seat.inbox.offer(TokenSeen(key))

    def serving(self, asker: SharedSeat, key_expr: str) -> Iterator[tuple[SharedSeat, str]]:
        """Other seats that answer a question on it, and where."""
        for seat in self._seats:
            if seat is not asker:
                for key in sorted(seat.served):
                    if _matches(key_expr, key):
                        yield seat, key

    # -- what comes from the bus ----------------------------------------------------------

    async def _read(self, bus: SharedBus) -> None:
        while True:
            await bus.inbox.wait()
            self._take(bus)

    def _take(self, bus: SharedBus) -> None:
        for event in bus.inbox.take():
            self._tell(event)
        lost, self._dropped = bus.inbox.dropped - self._dropped, bus.inbox.dropped
        for seat in self._seats if lost else ():
            seat.inbox.dropped += lost

    def _tell(self, event: BusEvent) -> None:
        match event:
            case Sample():
                if self._admits(event):
                    self._hand_round(event)
            case TokenSeen(key) | TokenGone(key):
                for key_expr, there in self._tokens.items():
                    if _matches(key_expr, key):
                        (there.add if isinstance(event, TokenSeen) else there.discard)(key)
                self._tell_token(event)
            case Query(key):
                serving = next((seat for seat in self._seats if key in seat.served), None)
                if serving is not None:
                    serving.inbox.offer(event)
            case LinkUp() | LinkDown():
                self._linked = isinstance(event, LinkUp)
                for seat in self._seats:
                    seat.inbox.offer(event)

    def _admits(self, sample: Sample) -> bool:
        """Whether it is let in, by the first seat's rules: all hear the same, and have the same.

        So it is looked at once, and what is not let in is counted there alone.
        """
        admits = next((s.inbox.admits for s in self._seats if s.inbox.admits is not None), None)
        return admits is None or admits(sample)

    def _hand_round(self, sample: Sample, but: SharedSeat | None = None) -> None:
        matching = self._matching.get(sample.key)
        if matching is None:
            if len(self._matching) >= _MOST_KEYS:
                self._matching.clear()
            ends = "*", sample.key.rpartition("/")[2]  # what is for one of dozens ends in its name
            maybe = [each for each in self._subscribed if each.endswith(ends)]
            matching = [each for each in maybe if _matches(each, sample.key)]
            self._matching[sample.key] = matching
        for key_expr in matching:
            for seat, how in self._hearers[key_expr]:
                if seat is but:
                    continue
                if how.gathered:
                    seat.inbox.dropped += len(seat.waiting) == MOST_WAITING  # the oldest of them
                    seat.waiting.append((sample, how.latest))
                else:
                    seat.inbox.offer(sample, how.latest, admitted=True)


class SharedSeat:
    """One of several seats; see `swarm.bus.port.Bus`. Made by `SharedSeats.seat`."""

    seal = None

    def __init__(self, seats: SharedSeats, inbox_capacity: int) -> None:
        self._seats = seats
        self._loop = asyncio.get_running_loop()
        self._inbox = Inbox(self._loop, inbox_capacity)
        self._closed = False
        self.subscriptions: dict[str, _Subscription] = {}
        self.tokens: set[str] = set()
        self.watched: set[str] = set()
        self.served: set[str] = set()
        self.waiting: deque[tuple[Sample, bool]] = deque(maxlen=MOST_WAITING)
        """What is to be gathered, and whether the latest of its key is enough."""
        self.asked: set[_NearQuestion] = set()
        """Questions that wait for an answer from here."""

    @property
    def inbox(self) -> Inbox:
        """Where everything arrives."""
        return self._inbox

    def publish(self, key: str, payload: bytes, *, reliable: bool = True) -> None:
        """Say ``payload`` on ``key``; see `swarm.bus.port.Bus.publish`."""
        self._open_bus()
        sample = Sample(check_key(key), bytes(check_payload(payload)), self._loop.time())
        self._seats.publish(self, sample, reliable=reliable)

    def subscribe(self, key_expr: str, *, latest: bool = False, gathered: bool = False) -> None:
        """Receive a `Sample` for everything others publish on ``key_expr``."""
        self._open_bus()
        self.subscriptions[check_key_expr(key_expr)] = _Subscription(latest, gathered)
        self._seats.subscribed(key_expr)

    def gather(self) -> None:
        """See `swarm.bus.port.Bus`."""
        self._open_bus()
        self._seats.gather()
        if self.waiting:
            self._inbox.offer_admitted(self.waiting)
            self.waiting.clear()

    def unsubscribe(self, key_expr: str) -> None:
        """Receive nothing more by that very subscription."""
        self._open_bus()
        if self.subscriptions.pop(key_expr, None) is not None:
            self._seats.subscribed(key_expr)

    def declare_token(self, key: str) -> None:
        """Hold a liveliness token on ``key``."""
        self._open_bus()
        if check_key(key) not in self.tokens:
            self.tokens.add(key)
            self._seats.declare_token(key)

    def watch_tokens(self, key_expr: str) -> None:
        """Receive `TokenSeen` and `TokenGone`."""
        self._open_bus()
        if check_key_expr(key_expr) not in self.watched:
            self.watched.add(key_expr)
            self._seats.watch_tokens(self, key_expr)

    def serve(self, key: str) -> None:
        """Receive a `Query` whenever somebody else asks on ``key``."""
        self._open_bus().serve(check_key(key))
        self.served.add(key)

    async def query(
        self, key_expr: str, payload: bytes = b"", *, timeout_s: float
    ) -> Sequence[Answer]:
        """Ask all others who serve a key matching ``key_expr``."""
        bus = self._open_bus()
        check_key_expr(key_expr)
        check_payload(payload)
        question = _NearQuestion(self._loop)
        for seat, key in self._seats.serving(self, key_expr):
            question.put_to(seat, key, bytes(payload))
        elsewhere, _ = await asyncio.gather(
            bus.query(key_expr, payload, timeout_s=timeout_s), question.answered(timeout_s)
        )
        return tuple(sorted([*elsewhere, *question.answers], key=lambda each: each.arrived_s))

    def close(self) -> None:
        """Leave; the others see the tokens go."""
        if self._closed:
            return
        self._closed = True
        for question in tuple(self.asked):
            question.forget(self)
        self._seats.leave(self)

    def _open_bus(self) -> SharedBus:
        if self._closed:
            raise BusError("the bus is closed")
        return self._seats.bus


class _NearQuestion:
    """A question to other seats of the process."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.answers: list[Answer] = []
        self._loop = loop
        self._missing: Counter[SharedSeat] = Counter()
        self._complete = asyncio.Event()

    def put_to(self, seat: SharedSeat, key: str, payload: bytes) -> None:
        """Ask ``seat`` on ``key``."""
        self._missing[seat] += 1
        seat.asked.add(self)
        reply = _AnswerOnce(self._loop, partial(self._arrive, seat, key))
        if not seat.inbox.offer_threadsafe(Query(key, reply, payload)):
            reply.give_up()

    async def answered(self, timeout_s: float) -> None:
        """Return when everyone has answered, or has none, or it is too late."""
        if not self._missing:
            return
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._complete.wait()
        for seat in tuple(self._missing):
            self.forget(seat)

    def forget(self, seat: SharedSeat) -> None:
        """Wait no longer for that one."""
        self._missing.pop(seat, None)
        seat.asked.discard(self)
        if not self._missing:
            self._complete.set()

    def _arrive(self, seat: SharedSeat, key: str, payload: bytes | None) -> None:
        if seat not in self._missing:
            return
        if payload is not None:
            self.answers.append(Answer(key, payload, self._loop.time()))
        self._missing[seat] -= 1
        if self._missing[seat] == 0:
            self.forget(seat)


@dataclass(slots=True, eq=False)
class _AnswerOnce:
    """The way back to who asked; given up when it is dropped."""

    loop: asyncio.AbstractEventLoop
    arrive: Callable[[bytes | None], None]
    used: bool = field(default=False)

    def __call__(self, payload: bytes) -> None:
        """Answer; every call but the first goes nowhere."""
        check_payload(payload)
        self._end(bytes(payload))

    def give_up(self) -> None:
        """There is no answer."""
        self._end(None)

    def __del__(self) -> None:
        self._end(None)

    def _end(self, payload: bytes | None) -> None:
        if not self.used:
            self.used = True
            with contextlib.suppress(RuntimeError):  # the loop has ended, and nobody asks any more
                self.loop.call_soon_threadsafe(self.arrive, payload)


def _matches(key_expr: str, key: str) -> bool:
    return zenoh.KeyExpr(key_expr).includes(key)
