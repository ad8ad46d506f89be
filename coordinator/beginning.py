"""How a mission begins: planned while the vehicles get ready, started when they are.

Leaves out: saying so (coordinator.core).
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

from coordinator.events import Action, MakePlan
from swarm.events import Note
from swarm.model import Mission, Plan, UavId
from swarm.state.board import mission_of
from swarm.state.membership import Membership
from swarm.state.registers import Replica
from swarm.wire.messages import ClaimPhase, Epoch, EpochPhase

__all__ = ["Beginning", "Verdict"]


class Verdict(Enum):
    """Whether a mission may begin."""

    WAIT = "the plan is not made, or somebody may yet get airborne"
    START = "everybody is airborne, held by the operator or given up, and planned for"
    NOBODY = "everybody is given up"


class Beginning:
    """The beginning of one mission.

    Args:
        mission: the scenario.
        method: planning method.
        seed: of the planner.
        replica: brief, board and claims.
        membership: who is there.
        start_timeout_s: UAVs that are not airborne by then are given up [s].
    """

    def __init__(
        self,
        mission: Mission,
        method: str,
        seed: int,
        replica: Replica,
        membership: Membership,
        start_timeout_s: float,
    ) -> None:
        self.plan: Plan | None = None
        """The plan that the mission starts with; None while there is none for those who fly."""
        self._mission = mission
        self._method = method
        self._seed = seed
        self._replica = replica
        self._membership = membership
        self._start_timeout_s = start_timeout_s
        self._start_by_s: float | None = None
        self._planned_for: tuple[UavId, ...] = ()
        self._planned_tasks: set[str] = set()
        self._request = 0

    def begin(self, now_s: float) -> list[Action]:
        """The fleet is briefed: wait for it, and plan for all of it."""
        self._start_by_s = now_s + self._start_timeout_s
        return self._make_plan(self._fleet)

    def leave(self) -> None:
        """There is nothing to begin any more; a plan under way is for nothing."""
        self._start_by_s = None
        self._request += 1

    def expects(self, request: int) -> bool:
        """Whether that is the plan that was wanted last."""
        return request == self._request

    @property
    def is_forestalled(self) -> bool:
        """Whether the fleet is at work already, so that its mission runs: find it, begin none."""
        at_work = any(claim.task is not None for claim in self._replica.claims.values())
        return at_work or bool(self._replica.outcomes)

    def advance(self, now_s: float) -> tuple[Verdict, list[Action]]:
        """Whether to start by now, and what is to do before."""
        if self.is_forestalled:
            self._start_by_s = None
            return Verdict.WAIT, []
        if self._start_by_s is not None and self._start_by_s <= now_s:
            self._start_by_s = None
        uavs = self._fleet
        phases = {uav: self._phase_of(uav) for uav in uavs}
        ready = tuple(uav for uav in uavs if phases[uav] is ClaimPhase.IDLE)
        out = [uav for uav in uavs if phases[uav] is ClaimPhase.OUT]
        paused = [uav for uav in uavs if phases[uav] is ClaimPhase.PAUSED]
        settled = len(ready) + len(out) + len(paused)
        if settled < len(uavs) and self._start_by_s is not None:
            return Verdict.WAIT, []
        if not ready:  # whom the operator has stopped may yet be told to go on
            return Verdict.WAIT if paused else Verdict.NOBODY, []
        if self._planned_for != ready:
            # Somebody is missing: the sequence must be one of those who fly.
            missing = sorted(set(uavs) - set(ready))
            note = Note("starting without", {"uavs": ", ".join(missing)})
            return Verdict.WAIT, [note, *self._make_plan(ready)]
        if self._planned_tasks != self._open_tasks:
            note = Note("plans anew", {"because": "the operator has added or withdrawn tasks"})
            return Verdict.WAIT, [note, *self._make_plan(ready)]
        if self.plan is None:
            return Verdict.WAIT, []
        self._start_by_s = None
        return Verdict.START, []

    def epoch(self, phase: EpochPhase, reason: str) -> Epoch:
        """The first epoch, by the plan."""
        sequence = () if self.plan is None else self.plan.sequence or ()
        lists = {} if self.plan is None else self.plan.routes
        routes = {str(uav): tuple(map(str, tasks)) for uav, tasks in lists.items()}
        return Epoch(1, phase, self._method, tuple(sequence), 0.0, reason[:200], routes)

    @property
    def completion_s(self) -> dict[str, float]:
        """When the plan has each task done [s mission time]."""
        return {} if self.plan is None else {str(t): s for t, s in self.plan.completion_s.items()}

    def next_deadline_s(self) -> float | None:
        """When `advance` gives up on who is not airborne."""
        return self._start_by_s

    @property
    def _fleet(self) -> tuple[UavId, ...]:
        brief = self._replica.brief
        return () if brief is None else tuple(UavId(uav.id) for uav in brief.uavs)

    @property
    def _open_tasks(self) -> set[str]:
        return {task for task, entry in self._replica.board.items() if not entry.withdrawn}

    def _phase_of(self, uav: str) -> ClaimPhase | None:
        """Phase of its claim; None while it is absent or has none."""
        claim = self._replica.claims.get(uav)
        return None if claim is None or uav not in self._membership.present else claim.phase

    def _make_plan(self, uavs: tuple[UavId, ...]) -> list[Action]:
        self._request += 1
        self._planned_for, self._planned_tasks, self.plan = uavs, self._open_tasks, None
        brief = self._replica.brief
        if brief is None:
            return []
        mission = mission_of(self._replica, self._mission.name, brief)
        fleet = tuple(uav for uav in mission.uavs if uav.id in uavs)
        tasks = tuple(task for task in mission.tasks if task.id in self._planned_tasks)
        mission = replace(mission, uavs=fleet, tasks=tasks, origin=self._mission.origin)
        return [MakePlan(self._request, mission, self._method, self._seed)]
