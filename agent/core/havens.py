"""Which base one UAV had better fly to: with nothing to do, or while it waits above another one.

Worked out from everybody's claims, so it is the same wherever they are known. Leaves out: the
visit itself (agent.core.base_visits), and bases on the way to tasks (agent.core.field_decision).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from agent.core.base_visits import BaseVisits
from agent.core.context import AgentContext, AgentPart
from agent.core.decision import RefusedTasks
from agent.core.energy import TOLERANCE_S, SortieClock
from agent.core.flights import Flights, HomeFlight
from agent.core.states import AgentState
from swarm.allocation import field
from swarm.model import BaseId, UavId
from swarm.protocol import bases
from swarm.protocol.field_messages import BaseSpec


@dataclass(frozen=True, slots=True)
class Haven:
    """A base that the UAV can fly to."""

    base: BaseSpec
    way: field.Way
    arrives_s: float
    """Mission time at which it is above it."""
    ready_s: float
    """Mission time at which its battery is full there, as far as it is known who is ahead."""
    beside: bool = False
    """Whether it goes there to come down beside slots that are all blocked, until somebody clears
    one; it is ready when nobody knows."""


class Havens(AgentPart):
    """Bases as one UAV may choose among them.

    Args:
        flights: knows the ways.
        sortie: how long the UAV can stay in the air.
        visits: knows whose slots are blocked.
        refused: bases at which the vehicle would not land.
    """

    def __init__(
        self,
        context: AgentContext,
        flights: Flights,
        sortie: SortieClock,
        visits: BaseVisits,
        refused: RefusedTasks,
    ) -> None:
        super().__init__(context)
        self._flights = flights
        self._sortie = sortie
        self._visits = visits
        self._refused = refused
        self._ways: dict[str, field.Way | None] = {}
        """By base; asked for again and again by who hovers."""
        self._ways_from: object = None
        """Place and problem of these ways."""

    def is_usable(self, base: BaseSpec, now_s: float) -> bool:
        """Whether the vehicle lands there, and not all slots are blocked."""
        return base.id not in self._refused.left_alone(now_s) and not self._visits.is_blocked(base)

    def home(self, now_s: float) -> HomeFlight | None:
        """The nearest home, but another base in reach where that is a base of no use.

        Or where that is its start, from where it does not come back, and tasks are open that it
        could do with another battery: whoever is to do them may be lost.
        """
        nearest = self._flights.way_home()
        base = None if nearest is None or nearest.base is None else self._base(nearest.base)
        if nearest is None or (base is not None and self.is_usable(base, now_s)):
            return nearest
        reached = []
        if base is not None:
            reached = self._within_reach(now_s)
        elif self._machine.state is AgentState.IDLE and self._tasks_ahead().any():
            reached = [haven for haven in self._within_reach(now_s) if self._leads_on(haven)]
        found = min(reached, key=_arrival, default=None)
        if found is None:
            return nearest
        way = found.way
        return HomeFlight(way.via_enu_m, way.end_enu_m, found.base.id, way.duration_s)

    def _tasks_ahead(self) -> npt.NDArray[np.bool_]:
        """(n_task,) which tasks are open that the UAV is able to do."""
        problem = self._flights.problem
        if problem is None:
            return np.zeros(0, dtype=np.bool_)
        there = np.array([self._mission_view.is_open(task) for task in problem.task_ids], bool)
        ahead: npt.NDArray[np.bool_] = there & problem.capable[self._row(problem)]
        return ahead

    def _leads_on(self, haven: Haven) -> bool:
        """Whether a task is open that the UAV could do alone from there, with a full battery."""
        problem = self._flights.problem
        if problem is None:
            return False
        row, base = self._row(problem), BaseId(haven.base.id)
        leg_s = problem.leg_s[problem.kind[row], problem.n_uav + problem.base_ids.index(base)]
        enter, leave = problem.enter, problem.enter[:, ::-1]
        line_s = problem.line_s[problem.kind[row]] + problem.service_s[:, None]
        in_time = np.maximum(haven.ready_s + leg_s[enter], problem.opens_s[:, None])
        in_time = in_time <= problem.closes_s[:, None]
        lasts = leg_s[enter] + line_s + problem.home_s[row][leave] <= problem.full_s[row]
        return bool((in_time & lasts & self._tasks_ahead()[:, None]).any())

    def reach(self, name: str, now_s: float) -> Haven | None:
        """That base, flown to from here; None if it is unknown, or zones leave no way."""
        base, way = self._base(name), self._way_to(name)
        if base is None or way is None:
            return None
        mission_s = self._mission_view.mission_s(now_s)
        arrives_s = mission_s + way.duration_s
        ready_s = self._begins_s(base, arrives_s, mission_s) + base.swap_s
        return Haven(base, way, arrives_s, ready_s)

    def refuge(self, name: str, now_s: float) -> Haven | None:
        """That base, to be on the ground there in time, beside the slots if they are blocked.

        None where it cannot go, or the vehicle would not land.
        """
        haven = self.reach(name, now_s)
        if haven is None or name in self._refused.left_alone(now_s):
            return None
        if not self._visits.is_blocked(haven.base):
            return haven
        ready_s = haven.arrives_s + haven.base.swap_s  # as if somebody cleared a slot by then
        return replace(haven, ready_s=ready_s, beside=True)

    def instead_of_waiting(self, now_s: float) -> Haven | None:
        """Where the UAV, which waits above a base longer than it said, is ready earlier.

        None if it waits for no longer than it said: a plan may have it wait though another base
        is free.
        """
        claim = self._visits.claim
        waits = self._machine.state is AgentState.ABOVE_BASE and self._visits.waits_long
        own = None if claim is None or claim.base is None else self._base(claim.base)
        if not waits or claim is None or own is None:
            return None
        mission_s = self._mission_view.mission_s(now_s)
        arrived_s = mission_s if claim.arrives_s is None else claim.arrives_s
        ready_s = self._begins_s(own, arrived_s, mission_s) + own.swap_s
        best = min(self._within_reach(now_s, but=own.id), key=_readiness, default=None)
        gains = best is not None and best.ready_s < ready_s - self._timing.patience_s
        return best if gains else None

    def _within_reach(self, now_s: float, but: str | None = None) -> list[Haven]:
        """Bases of use at which it finds a slot, as far as is known, before its sortie ends."""
        brief, end_s = self._replica.brief, self._sortie.end_s
        names = [] if brief is None else [base.id for base in brief.bases]
        found = [self.reach(name, now_s) for name in names if name != but]
        return [
            haven
            for haven in found
            if haven is not None
            and self.is_usable(haven.base, now_s)
            and haven.ready_s - haven.base.swap_s <= end_s + TOLERANCE_S
        ]

    def _begins_s(self, base: BaseSpec, arrives_s: float, mission_s: float) -> float:
        """When the UAV, which arrives then, lands on a slot, in the order in which all land."""
        if base.slots is None:
            return arrives_s
        credible, me = self._peers.credible, self._uav
        claims = {uav: each for uav, each in self._replica.claims.items() if uav in credible}
        claims.pop(me, None)
        blocked = sum(where == base.id for where in self._visits.blocking().values())
        free = base.slots - blocked
        land_s = self._flights.land_s
        return bases.lands_s(base.id, free, base.swap_s, claims, arrives_s, mission_s, land_s)

    def _way_to(self, name: str) -> field.Way | None:
        here = self._mission_view.place_enu_m, id(self._flights.problem)
        if self._ways_from != here:
            self._ways, self._ways_from = {}, here
        if name not in self._ways:
            self._ways[name] = self._flights.way_to_base(name)
        return self._ways[name]

    def _row(self, problem: field.FieldProblem) -> int:
        return problem.uav_ids.index(UavId(self._uav))

    def _base(self, name: str) -> BaseSpec | None:
        return self._flights.base(name)


def _arrival(haven: Haven) -> tuple[float, str]:
    return haven.arrives_s, haven.base.id


def _readiness(haven: Haven) -> tuple[float, str]:
    return haven.ready_s, haven.base.id
