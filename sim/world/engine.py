"""The engine of virtual time: event queue, clocks, random streams, and the life of a process.

A stream depends on one seed and on what it is for, and on nothing else: one purpose drawing more
numbers leaves every other as it was, so that worlds which differ in one respect can be compared. A
process hands what its core wants to the world. It may be held, as by SIGSTOP or a deadlock: then
what arrives waits.
"""

from __future__ import annotations

import heapq
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from agent.core.attention import Attention
from agent.core.interface import Telemetry
from swarm.protocol.events import (
    Cell,
    CommonEvent,
    LinkChanged,
    MessageReceived,
    MessagesReceived,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Message, Snapshot
from swarm.runtime.shell import Core

_FROM_OTHERS = MessageReceived, MessagesReceived, SnapshotsReceived
"""What others say; before a core hears it, it is told where its vehicle is."""


class EventQueue:
    """Runs callbacks in order of their time; equal times in order of scheduling."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Callable[[], None]]] = []
        self.scheduled = 0
        """How many callbacks there have been so far, those to come included."""
        self._now_s = 0.0
        self._stopped = False

    def now_s(self) -> float:
        """Virtual time [s]."""
        return self._now_s

    def at(self, time_s: float, callback: Callable[[], None]) -> None:
        """Run ``callback`` at ``time_s``; what is already past runs next, now."""
        when_s = max(time_s, self._now_s)
        heapq.heappush(self._heap, (when_s, self.scheduled, callback))
        self.scheduled += 1

    def after(self, delay_s: float, callback: Callable[[], None]) -> None:
        """Run ``callback`` in ``delay_s``."""
        self.at(self._now_s + delay_s, callback)

    def stop(self) -> None:
        """Run nothing more."""
        self._stopped = True

    def run(self, until_s: float) -> bool:
        """Run until nothing is left (True), or time would pass ``until_s`` or `stop` (False)."""
        heap = self._heap
        while heap:
            if self._stopped or heap[0][0] > until_s:
                return False
            self._now_s, _, callback = heapq.heappop(heap)
            callback()
        return True


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """The generator of ``seed`` for one ``purpose``, such as ("link", "u0", "u1")."""
    key = tuple("/".join(purpose).encode())
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def uniforms(rng: np.random.Generator) -> Iterator[float]:
    """Numbers from 0 to 1 without end, drawn in blocks since single draws are slow."""
    while True:
        yield from rng.random(64).tolist()


@dataclass(slots=True)
class LocalClock:
    """One machine's clock; no two machines need agree."""

    offset_s: float = 0.0
    """What it shows at virtual time 0 [s]."""
    rate: float = 1.0
    """Its seconds per virtual second; > 0."""

    def local_s(self, time_s: float) -> float:
        """What it shows at ``time_s``."""
        return self.offset_s + self.rate * time_s

    def time_s(self, local_s: float) -> float:
        """Virtual time at which it shows ``local_s``."""
        return (local_s - self.offset_s) / self.rate


class ProcessOwner(Protocol):
    """What the world does for its processes."""

    def execute(self, process: Process, action: Any) -> None:
        """Carry out an action of the core."""
        ...

    def stepped(self, process: Process) -> None:
        """A step with all its actions is over."""
        ...

    def raised(self, process: Process, fault: Exception) -> None:
        """The core has raised; the process is over."""
        ...


class Process:
    """One life of one process.

    Args:
        name: of the process; the same in its next life.
        writer: whose registers it writes; None for an observer.
        core: decides.
        queue: virtual time.
        owner: carries out what the core wants.
        clock: the machine's.
        snapshot: answers a question; None for a process that answers none.
        whole: answers one who wants all that is known; by default as ``snapshot``.
        telemetry: where the vehicle is, if there is one.
        telemetry_s: interval at which that is told to the core, whatever it hears [s]; None: before
            what it hears.
        together: whether the core takes several messages that come together as one event.
        attention: of a core that only remembers most of what it hears; with ``telemetry_at`` it is
            told of those words when something happens of which it thinks.
        telemetry_at: where the vehicle was at an earlier virtual time, since which it has been
            ordered nothing; None where nobody can tell.
    """

    def __init__(
        self,
        name: str,
        writer: str | None,
        core: Core[Any, Any],
        queue: EventQueue,
        owner: ProcessOwner,
        *,
        clock: LocalClock,
        snapshot: Callable[[float], Snapshot] | None = None,
        whole: Callable[[float], Snapshot] | None = None,
        telemetry: Callable[[], Telemetry | None] | None = None,
        telemetry_s: float | None = None,
        together: bool = False,
        attention: Attention | None = None,
        telemetry_at: Callable[[float], Telemetry | None] | None = None,
    ) -> None:
        self.name = name
        self.writer = writer
        self._core = core
        self.over = False
        """Whether this life has ended, in whatever way."""
        self.held = False
        """Whether it processes nothing for now."""
        self.cells: frozenset[Cell] = frozenset()
        """Of the sky, whose traffic it hears."""
        self.linked = True
        """Whether, for all it has been told, its own link is up."""
        self._queue = queue
        self._owner = owner
        self._clock = clock
        self._snapshot = snapshot
        self._whole = whole or snapshot
        self._telemetry = telemetry
        self._telemetry_s = telemetry_s
        self._together = together
        self._attention = attention if telemetry_s is None else None
        self._telemetry_at = telemetry_at
        self._unread: list[tuple[Message, float]] = []
        """Heard, and when by the own clock, and not told to the core yet."""
        self._heard_s = -math.inf
        """When the last of them was, in virtual time."""
        self._told_s = -math.inf
        self._now_s = -math.inf
        self._tick_at_s = math.inf
        self._inbox: deque[object] = deque()

    @property
    def core(self) -> Core[Any, Any]:
        """What decides, knowing all that it has heard."""
        self._read_up()
        return self._core

    @core.setter
    def core(self, core: Core[Any, Any]) -> None:
        self._core, self._attention = core, None

    def start(self) -> None:
        """Begin."""
        self._act(self._core.start)
        if self._telemetry_s is not None:
            self._queue.after(self._telemetry_s, self._stream_telemetry)

    def receive(self, fact: CommonEvent | MessagesReceived) -> None:
        """Something has arrived from the bus."""
        if isinstance(fact, MessagesReceived) and not self._together:
            for message in fact.messages:
                self.step(MessageReceived(message))
        else:
            self.step(fact)

    def step(self, event: object) -> None:
        """Step the core and carry out what it wants; later, if the process is held."""
        if self.over:
            return
        if self.held:
            self._inbox.append(event)
            return
        if isinstance(event, MessageReceived) and self._may_read_later(event.message):
            return
        self._read_up()
        if isinstance(event, LinkChanged):
            self.linked = event.up
        heard = isinstance(event, _FROM_OTHERS)
        if heard and self._telemetry_s is None:
            self._tell_telemetry()
        self._act(lambda now_s: self._core.step(event, now_s))

    def answer(self, *, whole: bool = False) -> Snapshot | None:
        """What it answers when asked, if need be for all it knows; None when it cannot."""
        self._read_up()
        snapshot = self._whole if whole else self._snapshot
        if self.over or self.held or snapshot is None:
            return None
        return snapshot(self.now_s())

    def resume(self) -> None:
        """Go on, with what has arrived meanwhile: first of all a deadline, if one has passed."""
        self.held = False
        self._read_up()
        if self._telemetry_s is not None:
            self._tell_telemetry()
        if self._tick_at_s <= self._queue.now_s():
            self._tick_at_s = math.inf
            self._act(lambda now_s: self._core.step(Tick(), now_s))
        while self._inbox and not self.held:
            self.step(self._inbox.popleft())

    def now_s(self) -> float:
        """What the process's own clock shows; never goes back."""
        self._now_s = max(self._now_s, self._clock.local_s(self._queue.now_s()))
        return self._now_s

    def _may_read_later(self, message: Message) -> bool:
        """Whether nothing follows from ``message`` but that it is known; then it waits.

        In a large fleet that is so of nearly all words. Where the vehicle is when one is heard
        matters to whoever thinks; so of the words that wait together it is told with the last.
        """
        attention = self._attention
        if attention is None or self._telemetry_at is None:
            return False
        now_s, due_s = self.now_s(), self._core.next_deadline_s()
        if due_s is not None and due_s <= now_s:
            return False
        if not attention.may_read_later(message, now_s):
            return False
        self._unread.append((message, now_s))
        self._heard_s = self._queue.now_s()
        return True

    def _read_up(self) -> None:
        """Tell the core what has waited, in its order and as of the times at which it was heard."""
        if not self._unread or self._attention is None or self._telemetry_at is None:
            return
        unread, self._unread = self._unread, []
        told = None if self._heard_s <= self._told_s else self._telemetry_at(self._heard_s)
        if told is not None:
            self._told_s = self._heard_s
            self._core.step(told, unread[-1][1])  # it is only noted, as nothing was due then
        self._attention.read(unread)

    def _stream_telemetry(self) -> None:
        if self.over or self._telemetry_s is None:
            return
        self._queue.after(self._telemetry_s, self._stream_telemetry)
        if not self.held:
            self._tell_telemetry()

    def _tell_telemetry(self) -> None:
        time_s = self._queue.now_s()
        told = None if self._telemetry is None or time_s <= self._told_s else self._telemetry()
        if told is not None:
            self._told_s = time_s
            self._act(lambda now_s: self._core.step(told, now_s))

    def _act(self, act: Callable[[float], Any]) -> None:
        if self.over:
            return
        try:
            for action in act(self.now_s()):
                self._owner.execute(self, action)
            deadline_s = None if self.over else self._core.next_deadline_s()
        except Exception as fault:  # noqa: BLE001 - the top of a process: the world is told
            self._owner.raised(self, fault)
            return
        self._owner.stepped(self)
        if deadline_s is not None:
            self._wake(deadline_s)

    def _wake(self, deadline_s: float) -> None:
        """Tick at the deadline, unless an earlier tick is already under way."""
        at_s = self._clock.time_s(deadline_s)
        if at_s >= self._tick_at_s:
            return
        self._tick_at_s = at_s

        def tick() -> None:
            if self._tick_at_s != at_s or self.held or self.over:
                return
            self._tick_at_s = math.inf
            # Converted there and back, the deadline may lie just ahead of the clock.
            self._now_s = max(self._now_s, deadline_s)
            self.step(Tick())

        self._queue.at(at_s, tick)
