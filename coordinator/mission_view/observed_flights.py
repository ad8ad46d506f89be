"""What an observer knows of where UAVs went: lists by their claims and outcomes, places by status.

What nobody told is told of nobody: a visit is known by its outcome, the way home by the word that
a UAV takes no further part, ways as everybody finds them (`FlownWays`), and how near UAVs come to
each other by the places in their statuses (`ObservedApproaches`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from coordinator.mission_view.approaches import ObservedApproaches
from coordinator.mission_view.flown_ways import FlownWays, MapPoint
from swarm.allocation import field as constrained
from swarm.model import BaseId, Mission, Task, Uav, UavId
from swarm.model.plan import START, ScheduleEntry, at_base
from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, Outcome, Status, StatusPhase

_ON_THE_GROUND = (BaseStage.LANDED, BaseStage.PARKED)
_NEAR_GROUND_M = 20.0
"""From a start or a base: who stands that near, stands there."""
_LIFTED_M = 1.0
"""Above the ground, from where on a vehicle is in the air; heights drift by less."""

_FRESH_S = 2.0
"""From the time of a decision: what is told then is of that moment."""
_STAYED_M = 5.0
"""From where the last visit ended: who is that near has waited there."""

_Fix = tuple[float, Point]
"""Mission time [s] and place [m], its layer included."""


@dataclass(slots=True)
class _ObservedFlight:
    """What is known of one UAV."""

    claim: Claim | None = None
    claims: dict[str, Claim] = field(default_factory=dict)
    """The newest on each task."""
    visits: list[tuple[Claim, float, float | None]] = field(default_factory=list)
    """Claims that came to something, when that ended, and when it landed at a base [s]."""
    decided_m: dict[float, MapPoint] = field(default_factory=dict)
    """By the time of a decision [s], where it was then."""
    departed_s: dict[tuple[str | None, float], float] = field(default_factory=dict)
    """By task, None for a base, and since when it was free for it, when it set off [s]."""
    fix: _Fix | None = None
    """When and where it was last in flight; None while it stands on the ground."""
    left_s: float | None = None
    """When it was to take no further part [s]."""
    left_at_base: bool = False
    """Whether it stood at a base then: that is home, too."""
    home_s: float | None = None
    """When it was first heard to be home after that [s]."""

    def executed(self, mission: Mission, uav: Uav, ways: FlownWays) -> tuple[ScheduleEntry, ...]:
        """Its list, as far as it is known."""
        tasks = {str(task.id): task for task in mission.tasks}
        bases = {str(base.id): base for base in mission.bases}
        here, entries = uav.position_enu_m, []
        for claim, end_s, landed_s in self.visits:
            here = self._departed(claim, here)
            since_s = self.departed_s.get((claim.task, claim.decided_s), claim.decided_s)
            if claim.task is not None and claim.task in tasks:
                entry, here = _visit(uav.id, tasks[claim.task], claim, here, (since_s, end_s), ways)
            elif claim.base is not None and claim.base in bases:
                base = bases[claim.base]
                via_m = (*ways.to_base(uav.id, here, base.id), base.position_enu_m[:2])
                begin_s = end_s if landed_s is None else landed_s
                times_s = since_s, begin_s, begin_s, end_s
                entry = ScheduleEntry(at_base(BaseId(base.id)), here[:2], via_m, *times_s)
                here = base.position_enu_m
            else:
                continue
            entries.append(entry)
        goes_home = entries and not self.left_at_base
        if goes_home and self.left_s is not None and self.home_s is not None:
            via_m = (*ways.to_start(uav.id, here), uav.position_enu_m[:2])
            times_s = self.left_s, self.home_s, self.home_s, self.home_s
            entries.append(ScheduleEntry(START, here[:2], via_m, *times_s))
        return tuple(entries)

    def _departed(self, claim: Claim, here: Point) -> Point:
        """Where it set off: where its last visit ended, or where it was when it turned aside."""
        east_m, north_m = self.decided_m.get(claim.decided_s, here[:2])
        if math.hypot(east_m - here[0], north_m - here[1]) <= _STAYED_M:
            return here
        return east_m, north_m, here[2]


class ObservedFlights:
    """The flights of one fleet, in mission time.

    Args:
        approaches: told who is in flight, and where.
    """

    def __init__(self, approaches: ObservedApproaches) -> None:
        self.approaches = approaches
        self._flights: dict[str, _ObservedFlight] = {}

    # -- what is heard ------------------------------------------------------------------

    def hear_status(
        self, uav: str, status: Status, layer_m: float, grounds: Sequence[Point], now_s: float
    ) -> None:
        """A UAV tells where it is.

        Args:
            uav: who.
            status: what it tells.
            layer_m: its layer in the brief [m].
            grounds: starts and bases: where it stands at one it is not in flight.
            now_s: by the observer's clock, for what is told before there is mission time [s].
        """
        flight = self._flights.setdefault(uav, _ObservedFlight())
        mission_s, place = status.mission_s, status.flown_enu_m(layer_m)
        is_home = status.phase is StatusPhase.HOME
        if is_home and flight.left_s is not None and flight.home_s is None:
            flight.home_s = mission_s
        if place is None or is_home or any(_stands_at(place, ground) for ground in grounds):
            flight.fix = None
            self.approaches.land(uav)
            return
        at_s = now_s if mission_s is None else mission_s
        started = mission_s is not None
        self.approaches.fly(uav, at_s, place, status.velocity_enu_m_s, started=started)
        if started and (flight.fix is None or flight.fix[0] < at_s):
            flight.fix = at_s, place

    def hear(self, writer: str, body: object, mission_s: float | None = None) -> None:
        """Somebody says something that was not known, at that mission time where it is known."""
        match body:
            case Claim():
                self._hear_claim(writer, body, mission_s)
            case Outcome():
                self._hear_outcome(writer, body)
            case _:
                pass

    def _hear_claim(self, uav: str, claim: Claim, mission_s: float | None) -> None:
        """A UAV says what it is about."""
        flight = self._flights.setdefault(uav, _ObservedFlight())
        before, flight.claim = flight.claim, claim
        if claim.task is not None:
            flight.claims[claim.task] = claim
        if claim.departs_s is None and (claim.task is not None or claim.base is not None):
            # Who has waited without anything to do sets off when it says what it is about.
            waited = mission_s is not None and mission_s > claim.decided_s + _FRESH_S
            since_s = mission_s if waited and mission_s is not None else claim.decided_s
            flight.departed_s.setdefault((claim.task, claim.decided_s), since_s)
        if flight.fix is not None and abs(flight.fix[0] - claim.decided_s) <= _FRESH_S:
            flight.decided_m.setdefault(claim.decided_s, flight.fix[1][:2])
        if claim.phase is ClaimPhase.OUT and flight.left_s is None:
            flight.left_s = claim.decided_s
            flight.left_at_base = before is not None and before.stage in _ON_THE_GROUND
        elif claim.phase is not ClaimPhase.OUT:
            flight.left_s = flight.home_s = None
        if claim.stage is BaseStage.LANDED and claim.task is None and claim.arrives_s is not None:
            landed = before is not None and before.stage is BaseStage.LANDED
            if not (landed and before is not None and before.base == claim.base):
                flight.visits.append((claim, claim.completion_s, None))
            flight.visits[-1] = (claim, claim.completion_s, claim.arrives_s)

    def _hear_outcome(self, uav: str, outcome: Outcome) -> None:
        """An attempt is over; the claim on what comes next may have been heard before."""
        flight = self._flights.setdefault(uav, _ObservedFlight())
        known = {(claim.task, end_s) for claim, end_s, _ in flight.visits}
        claim = flight.claims.get(outcome.task)
        if claim is None:
            return
        if (outcome.task, outcome.completed_s) not in known:
            flight.visits.append((claim, outcome.completed_s, None))

    # -- what follows -------------------------------------------------------------------

    def swaps(self, uav: str) -> int:
        """How often that UAV has landed at a base for another battery."""
        flight = self._flights.get(uav)
        return 0 if flight is None else sum(claim.task is None for claim, _, _ in flight.visits)

    def executed_schedule(
        self, mission: Mission, problem: constrained.FieldProblem | None = None
    ) -> dict[UavId, tuple[ScheduleEntry, ...]]:
        """Every UAV's list, as far as it is known.

        Args:
            mission: as it was flown.
            problem: the same, for ways and times along lines; None of a plain one.
        """
        ways = FlownWays(problem)
        return {
            uav.id: self._flights.get(str(uav.id), _ObservedFlight()).executed(mission, uav, ways)
            for uav in mission.uavs
        }


def _visit(
    uav: str, task: Task, claim: Claim, here: Point, times_s: tuple[float, float], ways: FlownWays
) -> tuple[ScheduleEntry, Point]:
    """One visit from departure to end, begun as late as its line and service let it; and where."""
    depart_s, end_s = times_s
    points = task.path_enu_m or (task.position_enu_m,)
    backwards = bool(claim.reversed)
    ends = points[:: -1 if backwards else 1]
    begin_s = end_s - task.service_s - ways.line_s(uav, task.id, backwards=backwards)
    begin_s = max(begin_s, min(depart_s, end_s - task.service_s))
    entry = ScheduleEntry(
        go=task.id,
        from_enu_m=here[:2],
        via_enu_m=(*ways.to_task(uav, here, task.id, backwards=backwards), ends[0][:2]),
        depart_s=min(depart_s, begin_s),
        arrive_s=begin_s,
        begin_s=begin_s,
        end_s=end_s,
        is_reversed=backwards,
    )
    return entry, ends[-1]


def _stands_at(place: Point, ground: Point) -> bool:
    away_m = math.hypot(place[0] - ground[0], place[1] - ground[1])
    return away_m <= _NEAR_GROUND_M and place[2] <= ground[2] + _LIFTED_M
