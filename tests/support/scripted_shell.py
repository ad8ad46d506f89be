"""A shell around a core that does what the test says, on a network in memory."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass

from swarm.protocol.events import CommonAction, CommonEvent, Finish, MessagesReceived, Stop, Tick
from swarm.protocol.key_space import KeySpace
from swarm.protocol.messages import Message, Snapshot
from swarm.runtime.joining import join_mission
from swarm.runtime.shell import Shell
from swarm.runtime.turns import SharedProcess
from tests.support.builders import MISSION, held, message
from tests.support.memory_bus import MemoryBus, MemoryNetwork
from tests.support.shell_play import HandClock

KEYS = KeySpace(MISSION)
CLAIM = message("u1", held("t0", 1.0))
SNAPSHOT = Snapshot(MISSION, "u0", 1, 7.0, (message("u0", held("t1", 2.0)),))
END = Stop("enough")


@dataclass(frozen=True, slots=True)
class Own:
    """An action that only this kind of process knows."""

    name: str


Action = CommonAction | Own
React = Callable[[CommonEvent], Sequence[Action]]


class ScriptedCore:
    """Remembers what it heard; answers by a function, and ends on `Stop`."""

    def __init__(self, react: React | None = None, first: Sequence[Action] = ()) -> None:
        self.heard: list[CommonEvent] = []
        self.instants_s: list[float] = []
        self.deadline_s: float | None = None
        self._react = react
        self._first = first

    def start(self, now_s: float) -> Sequence[Action]:
        return self._first

    def step(self, event: CommonEvent, now_s: float) -> Sequence[Action]:
        self.heard.append(event)
        self.instants_s.append(now_s)
        if isinstance(event, Tick):
            self.deadline_s = None
        if event == END:
            return [Finish(0)]
        return () if self._react is None else self._react(event)

    def next_deadline_s(self) -> float | None:
        return self.deadline_s


@dataclass(slots=True)
class Played:
    """One shell at work beside another seat."""

    shell: Shell[CommonEvent, Action]
    running: asyncio.Task[int]
    network: MemoryNetwork
    seat: MemoryBus
    other: MemoryBus
    clock: HandClock
    own: list[str]

    async def end(self) -> int:
        self.shell.step(END)
        return await self.running


def as_event(fact: CommonEvent) -> CommonEvent:
    return fact


@asynccontextmanager
async def at_work(
    core: ScriptedCore,
    *,
    execute: Callable[[Action], None] | None = None,
    answers: bool = True,
    snapshot: Snapshot = SNAPSHOT,
    known: Mapping[str, int] | None = None,
    register: Callable[[str], Message | None] = lambda _: None,
    left_out: Callable[[], int] = int,
    save: Callable[[float], None] | None = None,
    capacity: int = 4096,
    together: Callable[[MessagesReceived], CommonEvent] | None = None,
    crowd: Callable[[Collection[str]], Sequence[str]] | None = None,
    pressing_s: Callable[[], float | None] = lambda: None,
    runs_since: Callable[[float], None] = lambda _: None,
    shared: SharedProcess | None = None,
    name: str = "u0",
) -> AsyncIterator[Played]:
    """A shell that runs ``core`` on the seat of ``name``, seen from the seat of u1."""
    network = MemoryNetwork()
    other = network.join("u1")
    seat = network.join(name, inbox_capacity=capacity)
    join_mission(other, MISSION, "u1", status=True)
    join_mission(seat, MISSION, name, status=True)
    clock, own = HandClock(), list[str]()

    def remember(action: Action) -> None:
        assert isinstance(action, Own)
        own.append(action.name)

    shell: Shell[CommonEvent, Action] = Shell(
        core,
        seat,
        clock,
        mission=MISSION,
        name=name,
        from_bus=as_event,
        execute=execute or remember,
        snapshot=(lambda _: snapshot) if answers else None,
        known=lambda: known or {},
        register=register,
        left_out=left_out,
        save=save,
        together=together,
        crowd=crowd,
        pressing_s=pressing_s,
        runs_since=runs_since,
        shared=shared,
    )
    running = asyncio.create_task(shell.run())
    try:
        yield Played(shell, running, network, seat, other, clock, own)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        seat.close()
        other.close()
