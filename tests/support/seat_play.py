"""Coordinators on one seat, in virtual time: at work and standing by, cut off and reunited.

The fleet is one stand-in that has heard everything on its side, answers for it and takes
no decisions. Everything follows from a seed.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import (
    CoordinatorAction,
    CoordinatorEvent,
    MakePlan,
    PlanMade,
    TakeSeat,
)
from coordinator.core.standby import StandbyCore
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    Ask,
    Finish,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, held, message
from tests.support.lone_coordinator import LAYERS, plan_of

TIMING = Timing()
ANSWER_S = 1.0
FIRST_LIFE = 1_000


@dataclass(slots=True)
class Place:
    """One process: a coordinator, or the stand-in of one UAV."""

    name: str
    core: CoordinatorCore | StandbyCore | None = None
    """None for a UAV, and for a process that is dead."""
    uav: Replica | None = None
    writer: str | None = None
    """Whose token it holds."""
    alive: bool = True
    held: bool = False
    inbox: list[CoordinatorEvent] = field(default_factory=list)
    wake_s: float = np.inf
    lives: int = 0
    status: int | None = None


class SeatPlay:
    """Some coordinators' processes and one UAV.

    Args:
        mission: of the coordinators; the UAV is its first, for ever at work on the first task.
        seed: of all delays.
        delay_s: longest delay of anything.
        standbys: how many stand by.
    """

    def __init__(self, mission: Mission, *, seed: int, delay_s: float, standbys: int = 1) -> None:
        self.mission = mission
        self.now_s = 0.0
        self.uav = Place(mission.uavs[0].id, uav=Replica(), writer=mission.uavs[0].id)
        names = [f"c{number}" for number in range(1 + standbys)]
        self.coordinators = {name: Place(name) for name in names}
        self.epochs: list[tuple[float, str, Message]] = []
        """Running epochs: when, by whose process, and what was said."""
        self._rng = np.random.default_rng([seed, 5])
        self._delay_s = delay_s
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._count = itertools.count()
        self._cut: set[str] = set()
        self._counter = 0
        self._zero_s: float | None = None
        self._arrived: dict[tuple[str, str], float] = {}
        self._at(0.1, self._announce)
        for number, name in enumerate(names):
            self._at(0.0, partial(self.begin, name, standby=number > 0))

    # -- what befalls processes ---------------------------------------------------------

    def begin(self, name: str, *, standby: bool, memory: Snapshot | None = None) -> None:
        """A coordinator's process starts."""
        place = self.coordinators[name]
        place.lives += 1
        place.alive, place.held, place.inbox, place.status = True, False, [], None
        if standby:
            place.core = StandbyCore(self.mission, partial(self._core, place), TIMING, memory, 0.0)
            place.writer = None
        else:
            place.core = self._core(place, memory, 0.0)
            place.writer = COORDINATOR
            self._show(place, PeerSeen(COORDINATOR))
        self._do(place, place.core.start(self.now_s))
        if self.uav.alive and self._joined(place, self.uav):
            self._send(self.uav, place, PeerSeen(self.uav.name))
        for other in self.coordinators.values():
            if other is not place and other.writer and other.alive and self._joined(place, other):
                self._send(other, place, PeerSeen(other.writer))

    def kill(self, name: str) -> None:
        """A coordinator's process dies."""
        place = self.coordinators[name]
        place.alive, place.core = False, None
        self._hide(place)

    def cut(self, *names: str) -> None:
        """Part those from the others, and nobody else; each side keeps its links."""
        before = self._pairs()
        self._cut = set(names)
        for one, other in sorted(before - self._pairs()):
            self._unsee(one, other)
        for one, other in sorted(self._pairs() - before):
            place, there = self._place(one), self._place(other)
            if there.writer is not None:
                self._send(there, place, PeerSeen(there.writer))

    def heal(self) -> None:
        """Join everybody again."""
        self.cut()

    def hold(self, name: str) -> None:
        """Stop a process: what arrives waits."""
        self.coordinators[name].held = True

    def release(self, name: str) -> None:
        """Let it go on."""
        place = self.coordinators[name]
        place.held = False
        waiting, place.inbox = place.inbox, []
        if place.wake_s <= self.now_s:
            self._step(place, Tick())
        for event in waiting:
            self._step(place, event)

    def run(self, until_s: float) -> None:
        """Let time pass."""
        while self._queue and self._queue[0][0] <= until_s:
            at_s, _, act = heapq.heappop(self._queue)
            self.now_s = max(self.now_s, at_s)
            act()
        self.now_s = until_s

    @property
    def in_charge(self) -> list[str]:
        """Coordinators that hold the seat and say that the mission runs."""
        found = []
        for name, place in self.coordinators.items():
            core = place.core
            if isinstance(core, StandbyCore):
                core = core.coordinator
            if place.alive and core is not None and core.stood_down is None:
                epoch = core.replica.epoch
                if epoch is not None and epoch.phase is MissionPhase.RUNNING:
                    found.append(name)
        return found

    # -- the network ----------------------------------------------------------------------

    def _place(self, name: str) -> Place:
        return self.uav if name == self.uav.name else self.coordinators[name]

    def _pairs(self) -> set[tuple[str, str]]:
        names = [self.uav.name, *self.coordinators]
        return {
            (one, other)
            for one, other in itertools.permutations(names, 2)
            if (one in self._cut) is (other in self._cut)
        }

    def _joined(self, one: Place, other: Place) -> bool:
        return (one.name in self._cut) is (other.name in self._cut)

    def _others(self, place: Place) -> list[Place]:
        everyone = [self.uav, *self.coordinators.values()]
        return [p for p in everyone if p is not place and p.alive and self._joined(p, place)]

    def _unsee(self, one: str, other: str) -> None:
        """``one`` sees the token of ``other`` go, unless somebody else holds it there too."""
        place, gone = self._place(one), self._place(other)
        if gone.writer is not None and not self._is_shown(gone.writer, place):
            self._send(None, place, PeerGone(gone.writer))

    def _is_shown(self, writer: str, to: Place) -> bool:
        return any(other.writer == writer for other in self._others(to))

    def _show(self, place: Place, fact: PeerSeen) -> None:
        for other in self._others(place):
            if other.writer != fact.writer:
                self._send(place, other, fact)

    def _hide(self, place: Place) -> None:
        writer, place.writer = place.writer, None
        for other in [self.uav, *self.coordinators.values()]:
            hidden = writer is not None and not self._is_shown(writer, other)
            if other is not place and hidden and self._joined(place, other):
                self._send(None, other, PeerGone(writer or ""))

    def _send(self, sender: Place | None, to: Place, event: CoordinatorEvent) -> None:
        """In order per pair, as over TCP; lost if they are parted when it would arrive.

        What one is told of another's token keeps its order too, whoever tells it.
        """
        source = "" if sender is None else sender.name
        if isinstance(event, PeerSeen | PeerGone):
            source = f"token of {event.writer}"
        pair = (source, to.name)
        at_s = self.now_s + float(self._rng.uniform(0.0, self._delay_s))
        at_s = self._arrived[pair] = max(at_s, self._arrived.get(pair, 0.0))

        def arrive() -> None:
            if sender is None or self._joined(sender, to):
                self._step(to, event)

        self._at(at_s, arrive)

    def _ask(self, place: Place) -> None:
        life = place.lives
        answers: list[Snapshot] = []
        round_trip_s = float(self._rng.uniform(0.0, 2.0 * self._delay_s))

        def answer(other: Place) -> None:
            if other.alive and not other.held and self._joined(place, other):
                answers.append(self._snapshot(other))

        asked = [other for other in self._others(place) if other.writer is not None]
        for other in asked:
            self._at(self.now_s + round_trip_s / 2.0, partial(answer, other))
        everybody = not any(other.held for other in asked)
        wait_s = round_trip_s if everybody else ANSWER_S

        def learn() -> None:
            if place.lives == life:
                self._step(place, SnapshotsReceived(tuple(answers)))

        self._at(self.now_s + wait_s, learn)

    # -- processes ------------------------------------------------------------------------

    def _core(self, place: Place, memory: Snapshot | None, age_s: float) -> CoordinatorCore:
        number = list(self.coordinators).index(place.name)
        return CoordinatorCore(
            self.mission,
            method="greedy",
            seed=0,
            incarnation=FIRST_LIFE + 10 * round(self.now_s * 1000) + number,
            timing=TIMING,
            start_timeout_s=60.0,
            layers=LAYERS,
            memory=memory,
            memory_age_s=age_s,
        )

    def _snapshot(self, place: Place) -> Snapshot:
        if place.core is not None:
            return place.core.snapshot(self.now_s)
        assert place.uav is not None
        mission_s = None if self._zero_s is None else self.now_s - self._zero_s
        messages = tuple(place.uav.messages())
        return Snapshot(self.mission.name, place.name, 1, mission_s, messages)

    def _step(self, place: Place, event: CoordinatorEvent) -> None:
        if not place.alive:
            return
        if place.held:
            place.inbox.append(event)
        elif place.uav is not None:
            if isinstance(event, MessageReceived):
                place.uav.join(event.message)
                epoch = place.uav.epoch
                if self._zero_s is None and epoch is not None:
                    self._zero_s = self.now_s - epoch.mission_s
            elif isinstance(event, SnapshotsReceived):
                for snapshot in event.snapshots:
                    place.uav.join_all(snapshot.messages)
            elif isinstance(event, PeerSeen):
                self._ask(place)
        elif place.core is not None:
            self._do(place, place.core.step(event, self.now_s))

    def _do(self, place: Place, actions: Sequence[CoordinatorAction]) -> None:
        for action in actions:
            match action:
                case Publish(said):
                    self._publish(place, said)
                case Ask():
                    self._ask(place)
                case MakePlan(request, mission):
                    plan = plan_of(mission, *(uav.id for uav in mission.uavs))
                    self._at(self.now_s, partial(self._step, place, PlanMade(request, plan)))
                case TakeSeat():
                    place.writer = COORDINATOR
                    self._show(place, PeerSeen(COORDINATOR))
                case Finish(status):
                    self._finish(place, status)
                    return
        core = place.core
        due_s = None if core is None else core.next_deadline_s()
        if due_s is not None:
            place.wake_s = max(self.now_s, due_s)
            self._at(place.wake_s, partial(self._tick, place, place.wake_s, place.lives))

    def _tick(self, place: Place, at_s: float, life: int) -> None:
        if place.wake_s == at_s and place.lives == life and not place.held:
            self._step(place, Tick())

    def _finish(self, place: Place, status: int) -> None:
        core = place.core
        assert core is not None
        self._hide(place)
        if core.stood_down is not None:  # as the service does with one that stands by
            memory = core.memory(self.now_s)
            self.begin(place.name, standby=True, memory=memory)
            return
        place.alive, place.core, place.status = False, None, status

    def _publish(self, place: Place, said: Message) -> None:
        if isinstance(said.body, PlanEpoch) and said.body.phase is MissionPhase.RUNNING:
            self.epochs.append((self.now_s, place.name, said))
        for other in self._others(place):
            self._send(place, other, MessageReceived(said))

    def _announce(self) -> None:
        """The UAV repeats itself, as agents do."""
        self._counter += 1
        task = self.mission.tasks[0].id
        claim = IDLE if self._zero_s is None else held(task, 0.0)
        said = message(self.uav.name, claim, self._counter)
        assert self.uav.uav is not None
        self.uav.uav.join(said)
        self._publish(self.uav, said)
        self._at(self.now_s + 1.0, self._announce)

    def _at(self, at_s: float, act: Callable[[], None]) -> None:
        heapq.heappush(self._queue, (at_s, next(self._count), act))
