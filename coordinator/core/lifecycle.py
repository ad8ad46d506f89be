"""What the coordinator hears and wants done, when a mission starts, and when it is over.

Waiting costs nothing on the ground, and energy in the air. As soon as somebody is airborne, whoever
was lost is waited for only as long as a restart of its agent takes, whoever else is not ready
(preparing, or never seen) only as long as the first in the air may hover, and whom the operator
does not want waited for not at all. Who gets ready later joins the mission that runs.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum

from coordinator.planner.online import EpochPolicy, ReplanResult, Situation
from swarm.model import Mission, Plan, Uav, UavId
from swarm.model.layers import layers_over
from swarm.model.plan import by_reason
from swarm.protocol.board import TaskBoard, TaskState, anything_doable, is_of_field, mission_of
from swarm.protocol.calibration import FlightRates, flight_rates, noticeably_otherwise
from swarm.protocol.events import CommonAction, CommonEvent, LogLine, MessagesReceived
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.membership import Membership
from swarm.protocol.messages import MissionConfig, MissionPhase, PlanEpoch
from swarm.protocol.operator_commands import dispensable, zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.timing import Timing, earliest
from swarm.protocol.uav_messages import ClaimPhase


@dataclass(frozen=True, slots=True)
class PlanMade:
    """The answer to a `MakePlan`."""

    request: int
    plan: Plan


@dataclass(frozen=True, slots=True)
class PlanFailed:
    """The answer to a `MakePlan` that could not be planned."""

    request: int
    reason: str


@dataclass(frozen=True, slots=True)
class MakePlan:
    """Plan this mission in the background; ends in `PlanMade` or `PlanFailed`."""

    request: int
    mission: Mission
    method: str
    seed: int
    rates: Mapping[str, FlightRates] = field(default_factory=dict)
    """UAVs of which it is known that they fly otherwise than the mission says, and how."""


@dataclass(frozen=True, slots=True)
class Replan:
    """Plan the rest of a running mission in the background; ends in `Replanned`."""

    request: int
    situation: Situation
    course: EpochPolicy
    """Of the epoch in force."""
    method: str
    seed: int
    reason: str
    """What has changed since the epoch in force was made."""


@dataclass(frozen=True, slots=True)
class Replanned:
    """The answer to a `Replan`."""

    request: int
    plan: ReplanResult


@dataclass(frozen=True, slots=True)
class StopPlanning:
    """Nobody waits for what is being planned any more."""


@dataclass(frozen=True, slots=True)
class Withdraw:
    """Take a task off the board: nobody need visit it any more."""

    task: str


@dataclass(frozen=True, slots=True)
class TakeSeat:
    """Show that the coordinator is there, and answer for it."""


CoordinatorEvent = CommonEvent | MessagesReceived | PlanMade | PlanFailed | Replanned | Withdraw
CoordinatorAction = CommonAction | MakePlan | Replan | StopPlanning | TakeSeat


EVERYBODY = "every UAV is airborne"


class StartDecision(Enum):
    """Whether a mission may begin."""

    WAIT = "the plan is not made, or somebody may yet get airborne"
    START = "everybody is airborne, held by the operator or given up, and planned for"
    NOBODY = "everybody is given up"
    OVER = "the fleet was at work already, and nobody of it is there any more"


class StartGate:
    """The beginning of one mission.

    Args:
        start_timeout_s: UAVs that are not airborne by then are given up, whatever the others
            do [s].
    """

    def __init__(
        self,
        mission: Mission,
        method: str,
        seed: int,
        replica: Replica,
        membership: Membership,
        start_timeout_s: float,
        timing: Timing,
    ) -> None:
        self.reason = EVERYBODY
        """Why the mission starts, in words."""
        self.plan: Plan | None = None
        """The plan that the mission starts with; None while there is none for those who fly."""
        self._mission = mission
        self._method = method
        self._seed = seed
        self._replica = replica
        self._membership = membership
        self._start_timeout_s = start_timeout_s
        self._timing = timing
        self._start_by_s: float | None = None
        self._wake_at_s: float | None = None
        self._hovers_since_s: dict[UavId, float] = {}
        """UAVs that are ready, and since when."""
        self._lost_since_s: dict[UavId, float] = {}
        """UAVs that have been there and are not, and since when."""
        self._seen: set[UavId] = set()
        self._planned_for: tuple[UavId, ...] = ()
        self._planned_tasks: set[str] = set()
        self._planned_zones: tuple[ZoneSpec, ...] = ()
        self.rates: Mapping[str, FlightRates] = {}
        """How UAVs fly by what the plan was made with."""
        self._request = 0
        self._over_at_s: float | None = None
        """When a fleet that was at work already, and of which nobody is there, has gone."""

    def begin(self, now_s: float) -> list[CoordinatorAction]:
        """The fleet is briefed: wait for it, and plan for all of it."""
        self._start_by_s = now_s + self._start_timeout_s
        self.reason = EVERYBODY
        return self._make_plan(self._fleet)

    def leave(self) -> None:
        """There is nothing to begin any more; a plan under way is for nothing."""
        self._start_by_s = self._wake_at_s = None
        self._request += 1

    def expects(self, request: int) -> bool:
        """Whether that is the plan that was wanted last."""
        return request == self._request

    @property
    def is_forestalled(self) -> bool:
        """Whether the fleet is at work already, so that its mission runs: find it, begin none."""
        at_work = any(claim.is_taken for claim in self._replica.claims.values())
        return at_work or bool(self._replica.outcomes)

    @property
    def is_for_nobody(self) -> bool:
        """Whether the fleet has been at work, and whoever is there has left that flight."""
        claims, present = self._replica.claims, self._membership.present
        there = [claims.get(uav) for uav in self._fleet if uav in present]
        left = all(claim is not None and claim.phase is ClaimPhase.OUT for claim in there)
        return left and self.is_forestalled

    def advance(self, now_s: float) -> tuple[StartDecision, list[CoordinatorAction]]:
        """Whether to start by now, and what is to do before."""
        self._wake_at_s = None
        if self.is_forestalled:
            self._start_by_s = None
            return self._look_for_the_fleet(now_s), []
        self._over_at_s = None
        if self._start_by_s is not None and self._start_by_s <= now_s:
            self._start_by_s = None
        uavs = self._fleet
        phases = {uav: self._phase_of(uav) for uav in uavs}
        ready = tuple(uav for uav in uavs if phases[uav] is ClaimPhase.IDLE)
        paused = [uav for uav in uavs if phases[uav] is ClaimPhase.PAUSED]
        settled = (ClaimPhase.IDLE, ClaimPhase.OUT, ClaimPhase.PAUSED)
        missing = [uav for uav in uavs if phases[uav] not in settled]
        self._look(uavs, ready, now_s)
        if self.plan is not None and self._is_otherwise:
            # Mostly while vehicles get ready: they tell it as soon as they are briefed.
            note = LogLine("plans anew", {"because": "UAVs have told how they fly"})
            return StartDecision.WAIT, [note, *self._make_plan(self._planned_for)]
        if missing and self._start_by_s is not None:
            given_up = dispensable(self._replica)
            needed = [uav for uav in missing if uav not in given_up]
            until_s = self._waits_until_s(needed, now_s) if ready else self._start_by_s
            if now_s < until_s:
                self._wake_at_s = until_s
                return StartDecision.WAIT, []
        if not ready:  # whom the operator has stopped may yet be told to go on
            return StartDecision.WAIT if paused else StartDecision.NOBODY, []
        if self._planned_for != ready:
            # Somebody is missing: the sequence must be one of those who fly.
            without = [uav for uav in sorted(uavs) if uav not in ready]
            why = "; ".join(f"{uav}: {self._why_not(uav, phases[uav])}" for uav in without)
            self.reason = f"without {why}" if without else EVERYBODY
            note = LogLine("starting without", {"uavs": ", ".join(without), "because": why})
            return StartDecision.WAIT, [note, *self._make_plan(ready)]
        if self._planned_tasks != self._open_tasks:
            note = LogLine("plans anew", {"because": "the operator has added or withdrawn tasks"})
            return StartDecision.WAIT, [note, *self._make_plan(ready)]
        if self._planned_zones != zones_in_force(self._replica):
            note = LogLine("plans anew", {"because": "the operator has changed zones"})
            return StartDecision.WAIT, [note, *self._make_plan(ready)]
        if self.plan is None:
            return StartDecision.WAIT, []
        self._start_by_s = None
        return StartDecision.START, []

    def _look_for_the_fleet(self, now_s: float) -> StartDecision:
        """Whether to wait for word of the mission that runs: from whoever is there, or comes back.

        Where every question of this process is lost, that word never comes.
        """
        if not self._membership.present.isdisjoint(self._fleet):
            self._over_at_s = None
            return StartDecision.WAIT
        if self._over_at_s is None:
            self._over_at_s = now_s + self._timing.abandon_s
        if self._over_at_s <= now_s:
            return StartDecision.OVER
        self._wake_at_s = self._over_at_s
        return StartDecision.WAIT

    def _look(self, uavs: Iterable[UavId], ready: Collection[UavId], now_s: float) -> None:
        """Take note of who hovers, and who is lost."""
        hovers, lost, claims = self._hovers_since_s, self._lost_since_s, self._replica.claims
        present = self._membership.present
        self._seen.update(uav for uav in uavs if uav in present or uav in claims)
        self._hovers_since_s = {uav: hovers.get(uav, now_s) for uav in ready}
        gone = self._seen - present
        self._lost_since_s = {uav: lost.get(uav, now_s) for uav in gone}

    def _waits_until_s(self, missing: Iterable[UavId], now_s: float) -> float:
        """Until when those in the air wait for ``missing``; not after now if no longer."""
        timing, lost_s = self._timing, self._lost_since_s
        hovered_s = min(self._hovers_since_s.values()) + timing.hover_s
        latest_s = earliest(hovered_s, self._start_by_s) or now_s
        ends_s = (lost_s[uav] + timing.restart_s if uav in lost_s else latest_s for uav in missing)
        return min(latest_s, max(ends_s, default=now_s))

    def _why_not(self, uav: UavId, phase: ClaimPhase | None) -> str:
        """Why the mission starts without ``uav``, in words."""
        if phase is ClaimPhase.OUT:
            return "takes no part"
        if phase is ClaimPhase.PAUSED:
            return "held by the operator"
        if (start := dispensable(self._replica).get(uav)) is not None:
            return "the operator does not wait for it" + (f" ({start.reason})" * bool(start.reason))
        if uav in self._lost_since_s:
            return "its agent is lost"
        what = "not airborne" if uav in self._seen else "its agent was never seen"
        if self._start_by_s is None:
            return f"{what} within {self._start_timeout_s:g} s"
        return f"{what}, and others have waited {self._timing.hover_s:g} s in the air"

    def epoch(self, phase: MissionPhase, reason: str) -> PlanEpoch:
        """The first epoch, by the plan."""
        sequence = () if self.plan is None else self.plan.sequence or ()
        lists = {} if self.plan is None else self.plan.routes
        routes = {str(uav): tuple(map(str, tasks)) for uav, tasks in lists.items()}
        # Of other missions releases that fly them, too, could not read it.
        tells = self.plan is not None and bool(self.plan.left_out) and self._is_in_field
        left_out = by_reason(self.plan.left_out) if self.plan is not None and tells else {}
        return PlanEpoch(
            1, phase, self._method, tuple(sequence), 0.0, reason[:200], routes, left_out
        )

    @property
    def completion_s(self) -> dict[str, float]:
        """When the plan has each task done [s mission time]."""
        return {} if self.plan is None else {str(t): s for t, s in self.plan.completion_s.items()}

    def next_deadline_s(self) -> float | None:
        """When `advance` waits no longer for somebody who is not airborne."""
        return self._wake_at_s

    @property
    def _fleet(self) -> tuple[UavId, ...]:
        brief = self._replica.brief
        return () if brief is None else tuple(UavId(uav.id) for uav in brief.uavs)

    @property
    def _is_in_field(self) -> bool:
        replica, brief = self._replica, self._replica.brief
        return brief is not None and is_of_field(mission_of(replica, self._mission.name, brief))

    @property
    def _open_tasks(self) -> set[str]:
        return {task for task, entry in self._replica.board.items() if not entry.withdrawn}

    @property
    def _is_otherwise(self) -> bool:
        return bool(noticeably_otherwise(self.rates, flight_rates(self._replica)))

    def _phase_of(self, uav: str) -> ClaimPhase | None:
        """Phase of its claim; None while it has none, or is absent without having left."""
        claim = self._replica.claims.get(uav)
        if claim is None:
            return None
        left = claim.phase is ClaimPhase.OUT
        return claim.phase if left or uav in self._membership.present else None

    def _make_plan(self, uavs: tuple[UavId, ...]) -> list[CoordinatorAction]:
        self._request += 1
        self._planned_for, self._planned_tasks, self.plan = uavs, self._open_tasks, None
        self._planned_zones = zones_in_force(self._replica)
        self.rates = flight_rates(self._replica)
        brief = self._replica.brief
        if brief is None:
            return []
        mission = mission_of(self._replica, self._mission.name, brief)
        fleet = tuple(uav for uav in mission.uavs if uav.id in uavs)
        if is_of_field(mission):
            fleet = _in_layers(fleet, brief)
        tasks = tuple(task for task in mission.tasks if task.id in self._planned_tasks)
        mission = replace(
            mission,
            uavs=fleet,
            tasks=tasks,
            origin=self._mission.origin,
            # What is known of it may have no constraints, or not yet: its plan has a schedule.
            schema=max(mission.schema, self._mission.schema),
        )
        return [MakePlan(self._request, mission, self._method, self._seed, self.rates)]


def _in_layers(fleet: Sequence[Uav], brief: MissionConfig) -> tuple[Uav, ...]:
    """``fleet`` with its layers of the brief, where a planner would take it to fly in others."""
    told_m = {uav.id: uav.layer_m for uav in brief.uavs}
    usual = layers_over(None if brief.terrain is None else brief.terrain.terrain())
    return tuple(
        uav if told_m[uav.id] == usual.layer_m(row) else replace(uav, layer_m=told_m[uav.id])
        for row, uav in enumerate(fleet)
    )


ALL_ENDED = "every task has ended"
NOBODY_LEFT = "nobody is left who could go on"
NOBODY_WILL = "nobody takes what is left"


class MissionEndCondition:
    """The end of one mission."""

    def __init__(self, board: TaskBoard, membership: Membership, timing: Timing) -> None:
        self._board = board
        self._membership = membership
        self._timing = timing
        self._grace_until_s = 0.0
        self._ignorant_until_s = 0.0
        self._prospect: tuple[str | None, float] = None, 0.0
        """How it will end if nothing changes, and how long that is waited for [s]."""
        self._over_at_s: float | None = None

    def wait_until(self, grace_until_s: float, *, was_away: bool = False) -> None:
        """Nobody is missed before then: they need the time to show themselves.

        Who ``was_away`` may not know of tasks that the operator has added, nor will before then.
        """
        if was_away:
            self._ignorant_until_s = max(self._ignorant_until_s, grace_until_s)
        self._grace_until_s = max(self._grace_until_s, grace_until_s)
        if self._over_at_s is not None:
            self._over_at_s = max(self._over_at_s, grace_until_s)

    def reason(self, now_s: float, mission_s: float, *, more_to_come: bool) -> str | None:
        """Why the mission is over; None if it is not. More tasks may be yet to come.

        Args:
            now_s: of the own clock [s].
            mission_s: mission time [s]; in the field what can be done depends on it.
            more_to_come: whether tasks have yet to appear.
        """
        before, self._prospect = self._prospect, self._outlook(mission_s, more_to_come=more_to_come)
        prospect, patience_s = self._prospect
        if prospect is None:
            self._over_at_s = None
            return None
        grace_s = self._ignorant_until_s if prospect == ALL_ENDED else self._grace_until_s
        at_s = max(now_s + patience_s, grace_s)
        if self._prospect != before or self._over_at_s is None:
            self._over_at_s = at_s
        self._over_at_s = min(self._over_at_s, at_s)
        return prospect if self._over_at_s <= now_s else None

    @property
    def somebody_knows_more(self) -> bool:
        """Whether a UAV of the fleet that is there claims a task that is not known here."""
        replica, present = self._board.replica, self._membership.present
        fleet = () if replica.brief is None else (uav.id for uav in replica.brief.uavs)
        claimed = (replica.claims[u].task for u in fleet if u in present and u in replica.claims)
        return any(task is not None and task not in replica.board for task in claimed)

    def settle(self) -> None:
        """The mission has ended: nothing more to find out."""
        self._over_at_s = None

    def next_deadline_s(self) -> float | None:
        """When `reason` may find that it has waited long enough."""
        return self._over_at_s

    def _can_go_on(self, present: Collection[str], mission_s: float) -> bool:
        """Whether an open task is left that one of those could still do."""
        field = self._board.field_problem
        if field is None:
            return anything_doable(self._board, present)
        # Plain missions never load it.
        from swarm.protocol.field_board import anything_doable_in_field

        return bool(present) and anything_doable_in_field(field, self._board, present, mission_s)

    def _outlook(self, mission_s: float, *, more_to_come: bool) -> tuple[str | None, float]:
        """How the mission will end if nothing changes, and how long that may yet change [s]."""
        claims, problem = self._board.replica.claims, self._board.problem
        fleet = () if problem is None else problem.uav_ids
        taking_part = {u for u in fleet if u in claims and claims[u].phase is not ClaimPhase.OUT}
        here = taking_part & self._membership.present
        silent = self._without_a_claim(fleet)
        if self._can_go_on(here, mission_s) or (more_to_come and here):
            paused = {uav for uav in here if claims[uav].phase is ClaimPhase.PAUSED}
            if self._can_go_on(paused, mission_s) or (more_to_come and paused):
                return None, 0.0  # the operator has stopped whom it may take: it is for them to say
            if more_to_come or any(claims[u].phase is not ClaimPhase.IDLE for u in here - paused):
                return None, 0.0
            # Every UAV may refuse a task for reasons of its own, such as a geofence.
            away_s = self._waits_s(taking_part - here, silent, mission_s, more_to_come=False)
            return NOBODY_WILL, max(away_s, self._timing.stalemate_s)
        if self.somebody_knows_more:
            return None, 0.0
        if TaskState.OPEN not in self._board.states.values() and not more_to_come:
            return ALL_ENDED, 0.0
        away_s = self._waits_s(taking_part, silent, mission_s, more_to_come=more_to_come)
        return NOBODY_LEFT, away_s or self._may_claim_s(here, mission_s)

    def _waits_s(
        self, lost: set[UavId], silent: set[UavId], mission_s: float, *, more_to_come: bool
    ) -> float:
        """How long to wait for who is not there to come back, or to get ready [s].

        Who was lost and never said that it is out may only have been cut off.
        """
        able = self._can_go_on(lost, mission_s) or anything_doable(self._board, silent)
        return self._timing.abandon_s if able or (more_to_come and lost | silent) else 0.0

    def _without_a_claim(self, fleet: Iterable[UavId]) -> set[UavId]:
        """Who gets ready, or was lost while it did, and may yet take part.

        Not who was never there, nor whom the operator does not wait for.
        """
        claims, members = self._board.replica.claims, self._membership
        given_up = dispensable(self._board.replica)
        silent = {uav for uav in fleet if uav not in claims and uav not in given_up}
        return {uav for uav in silent if uav in members.present or members.missed(uav)}

    def _may_claim_s(self, here: Collection[str], mission_s: float) -> float:
        """How long the word of a claim may take that is not expected from what is known [s].

        In the field what a UAV can do depends on where it is, and who is in the air without a task
        may be anywhere on a way that it has left. It claims at once what it can do, and flies to a
        base for what it can do then as late as its battery allows.
        """
        field = self._board.field_problem
        if field is None or all(self._board.replica.claims[uav].base is not None for uav in here):
            return 0.0
        # Plain missions never load it.
        from swarm.protocol.field_board import may_claim_until_s

        until_s = may_claim_until_s(field, self._board, here, mission_s)
        at_once_s = 2.0 * self._timing.patience_s
        return max(at_once_s, until_s - mission_s) if math.isfinite(until_s) else at_once_s
