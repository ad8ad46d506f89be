"""The coordinator's core with the fleet played by the test."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TypeVar

from coordinator.core.active import CoordinatorCore
from coordinator.core.lifecycle import CoordinatorAction, CoordinatorEvent, MakePlan, PlanMade
from swarm.model import Mission, Plan, UavId
from swarm.model.layers import FlightLayers
from swarm.protocol.events import (
    Ask,
    Finish,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, OUT, message

T = TypeVar("T")

TIMING = Timing(announce_s=1e6, silence_s=2e6, ask_gap_s=1e-6, replan_interval_s=1e6)
START_TIMEOUT_S = 60.0
LAYERS = FlightLayers(lowest_m=10.0, spacing_m=3.0)


def plan_of(mission: Mission, *sequence: str) -> Plan:
    """A plan of which only the sequence matters."""
    return Plan(
        scenario=mission.name,
        method="greedy",
        routes={uav.id: () for uav in mission.uavs},
        objective=0.0,
        completion_s={},
        sequence=tuple(UavId(uav) for uav in sequence),
        optimum=None,
        evaluations=1,
        elapsed_s=0.0,
        seed=0,
    )


class LoneCoordinator:
    """The coordinator of ``mission``, from the start of its process on.

    Args:
        mission: the scenario.
        timing: timers.
        begin_s: its clock at the start of the process.
        answers: what the others answer to all its questions; None if it must wait.
        incarnation: of its process.
        memory: of an earlier life.
        memory_age_s: how old that is.
    """

    def __init__(
        self,
        mission: Mission,
        *,
        timing: Timing = TIMING,
        begin_s: float = 100.0,
        answers: Sequence[Snapshot] | None = (),
        incarnation: int = 1,
        memory: Snapshot | None = None,
        memory_age_s: float = 0.0,
    ) -> None:
        self.mission = mission
        self.answers = answers
        self.uavs: list[str] = [uav.id for uav in mission.uavs]
        self.core = CoordinatorCore(
            mission,
            method="greedy",
            seed=7,
            incarnation=incarnation,
            timing=timing,
            start_timeout_s=START_TIMEOUT_S,
            layers=LAYERS,
            memory=memory,
            memory_age_s=memory_age_s,
        )
        self.timing = timing
        self.now_s = begin_s
        self.log: list[CoordinatorAction] = []
        self._counters: Counter[str] = Counter()
        self._do(self.core.start(self.now_s))

    def happen(self, event: CoordinatorEvent, at_s: float | None = None) -> list[CoordinatorAction]:
        """Step the core, at that time of its clock if one is given."""
        if at_s is not None:
            assert at_s >= self.now_s, "time never goes back"
            self.now_s = at_s
        return self._do(self.core.step(event, self.now_s))

    def run_until(self, at_s: float) -> list[CoordinatorAction]:
        """Tick at every deadline up to then."""
        actions: list[CoordinatorAction] = []
        while (due_s := self.core.next_deadline_s()) is not None and due_s <= at_s:
            assert due_s > self.now_s or not actions, "it spins"
            self.now_s = max(self.now_s, due_s)
            actions += self.happen(Tick())
        return actions + self.happen(Tick(), at_s)

    def hear(self, writer: str, body: Body, at_s: float | None = None) -> list[CoordinatorAction]:
        self._counters[writer] += 1
        return self.happen(MessageReceived(message(writer, body, self._counters[writer])), at_s)

    def see(self, *uavs: str) -> list[CoordinatorAction]:
        """Their tokens are there, and what it asks about that is answered."""
        actions = [action for uav in uavs for action in self.happen(PeerSeen(uav))]
        return actions + self.run_until(self.now_s + 2.0 * self.timing.ask_gap_s)

    def lose(self, uav: str, at_s: float) -> list[CoordinatorAction]:
        """Its token goes and does not come back."""
        before = self.happen(PeerGone(uav), at_s)
        return before + self.happen(Tick(), at_s + self.timing.loss_delay_s)

    def answer_plan(self, *sequence: str) -> list[CoordinatorAction]:
        """The plan it asked for last is made."""
        request = plans_wanted(self.log)[-1]
        return self.happen(PlanMade(request.request, plan_of(request.mission, *sequence)))

    def ready(self, *uavs: str) -> list[CoordinatorAction]:
        """They are there and airborne."""
        return self.see(*uavs) + [action for uav in uavs for action in self.hear(uav, IDLE)]

    def started(self) -> LoneCoordinator:
        """The same with its mission running since now."""
        self.answer_plan(*self.uavs)
        self.ready(*self.uavs)
        return self

    def leave(self, uav: str) -> None:
        """It goes home and its process ends."""
        self.hear(uav, OUT)
        self.lose(uav, self.now_s)

    @property
    def epoch(self) -> PlanEpoch | None:
        epochs = said(self.log, PlanEpoch)
        return epochs[-1] if epochs else None

    @property
    def phase(self) -> MissionPhase | None:
        epoch = self.epoch
        return None if epoch is None else epoch.phase

    @property
    def reason(self) -> str | None:
        epoch = self.epoch
        return None if epoch is None else epoch.reason

    def _do(self, actions: Sequence[CoordinatorAction]) -> list[CoordinatorAction]:
        self.log += actions
        done = list(actions)
        if self.answers is not None and Ask() in actions:
            done += self.happen(SnapshotsReceived(tuple(self.answers)))
        return done


def said(actions: Sequence[CoordinatorAction], kind: type[T]) -> list[T]:
    """Bodies of that kind that were published."""
    bodies = [action.message.body for action in actions if isinstance(action, Publish)]
    return [body for body in bodies if isinstance(body, kind)]


def plans_wanted(actions: Sequence[CoordinatorAction]) -> list[MakePlan]:
    return [action for action in actions if isinstance(action, MakePlan)]


def finishes(actions: Sequence[CoordinatorAction]) -> list[int]:
    return [action.status for action in actions if isinstance(action, Finish)]


def notes(actions: Sequence[CoordinatorAction]) -> list[LogLine]:
    return [action for action in actions if isinstance(action, LogLine)]
