"""What the registers say about tasks: the state of each, who holds it, where the team stands.

One UAV wins a task wherever the registers are equal. Held beats proposed. Proposed against
proposed: earlier decision, then rank, then id. Held against held, which takes a partition:
earlier predicted completion, then rank, then id. Who is alive each process judges for itself, and
passes in by leaving the lost out.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from enum import StrEnum
from itertools import islice

from swarm.allocation import field
from swarm.allocation.lower_level import Rule, TeamState
from swarm.allocation.problem import Problem
from swarm.allocation.rules import RULE_NAMES, GuidedRule, rule_by_name
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.model.mission import PLAIN_CONSTRAINTS
from swarm.protocol.calibration import (
    FlightRates,
    field_as_flown,
    fleet_as_flown,
    flight_rates,
)
from swarm.protocol.encoding import FIELD_DEFAULTS
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.messages import MissionConfig, PostedTask, TaskEntry, UavSpec
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase

_UNLIMITED = FIELD_DEFAULTS[TaskEntry]
"""Of a task of which a plain problem tells all."""
_LOOKED_AT_FIRST = 50
"""Open tasks, before all others are looked at together."""


def claim_strength(uav: str, claim: Claim) -> tuple[bool, float, int, str]:
    """Sort key of claims on one task: the smallest wins."""
    proposed = claim.phase is ClaimPhase.PROPOSED
    return (proposed, claim.decided_s if proposed else claim.completion_s, claim.rank, uav)


def winner(claims: Sequence[tuple[str, Claim]]) -> str | None:
    """The UAV that keeps the task all ``claims`` (UAV id, claim) name; None if there are none."""
    if len(claims) == 1:
        return claims[0][0]
    strongest = min(claims, key=lambda item: claim_strength(*item), default=None)
    return None if strongest is None else strongest[0]


def holders(claims: Mapping[str, Claim]) -> dict[str, str]:
    """Task id -> winning UAV id, for every task that any of ``claims`` names."""
    rivals: dict[str, list[tuple[str, Claim]]] = {}
    for uav, claim in claims.items():
        if claim.task is not None:
            rivals.setdefault(claim.task, []).append((uav, claim))
    found = {task: winner(items) for task, items in rivals.items()}
    return {task: uav for task, uav in found.items() if uav is not None}


class TaskState(StrEnum):
    """What became of a task so far."""

    OPEN = "open"
    DONE = "done"
    FAILED = "failed"
    WITHDRAWN = "withdrawn"


def anything_doable(board: TaskBoard, present: Collection[str]) -> bool:
    """Whether some UAV taking part in the mission is capable of some open task.

    ``present`` are the writers believed alive; the lost take no part.
    """
    problem, claims = board.problem, board.replica.claims
    if problem is None or not present:
        return False
    able = [
        index
        for index, uav in enumerate(problem.uav_ids)
        if uav in present and uav in claims and claims[uav].phase is not ClaimPhase.OUT
    ]
    # In board order, as the problem's tasks are; mostly one of the first that are open will do.
    open_ = [
        column for column, state in enumerate(board.states.values()) if state is TaskState.OPEN
    ]
    first, rest = open_[:_LOOKED_AT_FIRST], open_[_LOOKED_AT_FIRST:]
    return any(some and bool(problem.capable[:, some][able].any()) for some in (first, rest))


class TaskBoard:
    """What the registers of one replica say about tasks, worked out once per change."""

    def __init__(self, replica: Replica, mission: str) -> None:
        self.replica = replica
        self._name = mission
        self._entries: list[TaskEntry] = []
        """In board order."""
        self._untried: dict[str, TaskState] = {}
        """In board order, what each task would be if nobody had attempted any."""
        self._entries_version = -1
        self._brief: MissionConfig | None = None
        self._fleet: Mission | None = None
        """The mission of that brief, without tasks and zones."""
        self._tasks: dict[str, tuple[TaskEntry, Task]] = {}
        """By id, with the entry each was made from."""
        self._limited: set[str] = set()
        """Of these, tasks that a plain problem does not tell all of."""
        self._mission: Mission | None = None
        self._mission_version = -1
        self._field_briefed: field.FieldProblem | None = None
        """As the brief has its UAVs."""
        self._field_problem: field.FieldProblem | None = None
        self._field_version = -1
        self._field_rates: dict[str, FlightRates] = {}
        self._states: dict[str, TaskState] = {}
        self._unfinished = False
        self._basis: tuple[int, int] | None = None
        """Versions of brief and board, and of outcomes apart from further ones, of the states."""
        self._attempts = 0
        """How many outcomes the states take into account."""
        self._columns: list[Task] = []
        """Of the problem."""
        self._fleet_of_problem: Mission | None = None
        self._problem: Problem | None = None
        self._problem_version = -1, -1
        self._rates: dict[str, FlightRates] = {}
        self._rates_version = -1, -1
        self._flown: tuple[Mission, dict[str, FlightRates], Mission] | None = None
        """The fleet, its rates, and what comes of both."""

    @property
    def states(self) -> dict[str, TaskState]:
        """State of every task on the board, in board order, until the replica changes."""
        self._catch_up()
        return self._states

    @property
    def unfinished(self) -> bool:
        """Whether any task on the board is open."""
        self._catch_up()
        return self._unfinished

    @property
    def problem(self) -> Problem | None:
        """Every UAV of the brief, as it flies, and every task posted so far; None before the brief.

        Times of its legs hold where there is no `field_problem`.
        """
        version = self.replica.board_version, self.replica.calibration_version
        if self._problem_version != version:
            self._problem = self._problem_now()
            self._problem_version = version
        return self._problem

    @property
    def mission(self) -> Mission | None:
        """The same with the zones in force; None before the brief."""
        if self._mission_version != self.replica.board_version:
            fleet, tasks, brief = self._fleet_now(), self._tasks_now(), self.replica.brief
            zones = zones_in_force(self.replica)
            self._mission = (
                None
                if fleet is None or brief is None
                else _mission(self._name, brief, fleet.uavs, tasks, zones)
            )
            self._mission_version = self.replica.board_version
        return self._mission

    @property
    def field_problem(self) -> field.FieldProblem | None:
        """Of `mission`, each UAV as it flies, in its layer; None where `problem` tells all."""
        briefed, rates = self._field_briefed, self.rates
        if self._field_version != self.replica.board_version:
            briefed = self._field_briefed = self._field_problem_now()
            self._field_version, self._field_problem = self.replica.board_version, None
        if briefed is not None and (self._field_problem is None or self._field_rates != rates):
            self._field_problem, self._field_rates = field_as_flown(briefed, rates), rates
        return self._field_problem

    @property
    def rates(self) -> dict[str, FlightRates]:
        """Of UAVs that fly otherwise than the brief says, how they do; by id."""
        version = self.replica.board_version, self.replica.calibration_version
        if self._rates_version != version:
            self._rates, self._rates_version = flight_rates(self.replica), version
        return self._rates

    def _field_problem_now(self) -> field.FieldProblem | None:
        fleet, tasks = self._fleet_now(), self._tasks_now()
        brief = self.replica.brief
        if fleet is None or brief is None:
            return None
        limited = not self._limited.isdisjoint(task.id for task in tasks)
        if not (limited or zones_in_force(self.replica) or is_of_field(fleet)):
            return None
        mission = self.mission
        layers_m = [uav.layer_m for uav in brief.uavs]
        return None if mission is None else field.problem_of(mission, layers_m)

    def _problem_now(self) -> Problem | None:
        """Of `mission_of`; what nothing new was said of is not made anew."""
        known, fleet = self._problem, self._fleet_as_flown()
        if fleet is None:
            return None
        tasks = self._tasks_now()
        before = known if fleet is self._fleet_of_problem else None
        had = {id(task): column for column, task in enumerate(self._columns)}
        columns = [had.get(id(task), -1) for task in tasks]
        self._columns, self._fleet_of_problem = tasks, fleet
        if before is None:
            return Problem.from_mission(fleet, tasks=tasks)
        return before.with_tasks(fleet, tasks, columns)

    def _fleet_as_flown(self) -> Mission | None:
        """The same object as long as nothing has changed that concerns it."""
        fleet, rates = self._fleet_now(), self.rates
        if fleet is None or not rates:
            return fleet
        if self._flown is None or self._flown[0] is not fleet or self._flown[1] != rates:
            self._flown = fleet, rates, fleet_as_flown(fleet, rates)
        return self._flown[2]

    def _fleet_now(self) -> Mission | None:
        """The mission without tasks and zones, made once per brief; None before the brief."""
        brief = self.replica.brief
        if brief is not None and brief is not self._brief:
            self._brief = brief
            self._fleet = _mission(self._name, brief, map(_uav_of, brief.uavs), (), ())
        return self._fleet

    def _tasks_now(self) -> list[Task]:
        """In board order; what nothing new was said of is the same as before."""
        self._sort()
        for entry in self._entries:
            if (known := self._tasks.get(entry.task)) is None or known[0] is not entry:
                self._tasks[entry.task] = entry, task_of(entry)
                limited = any(
                    getattr(entry, name) != default for name, default in _UNLIMITED.items()
                )
                (self._limited.add if limited else self._limited.discard)(entry.task)
        return [self._tasks[entry.task][1] for entry in self._entries]

    def _sort(self) -> None:
        if self._entries_version != self.replica.board_version:
            self._entries = sorted(self.replica.board.values(), key=_order)
            self._untried = {
                entry.task: TaskState.WITHDRAWN if entry.withdrawn else TaskState.OPEN
                for entry in self._entries
            }
            self._entries_version = self.replica.board_version

    def _catch_up(self) -> None:
        """Work the states out of brief, board and outcomes, or add what has come at their end.

        An outcome makes of a task the same whatever others there are and whichever comes first.
        """
        replica, outcomes = self.replica, self.replica.outcomes
        basis = replica.board_version, replica.reattempts
        if basis == self._basis and len(outcomes) == self._attempts:
            return
        if basis != self._basis:
            self._sort()
            self._states, self._attempts = self._untried.copy(), 0
        final = replica.brief is None or not replica.brief.reattempt_failed
        states, further = self._states, len(outcomes) - self._attempts
        for (_, task), outcome in islice(reversed(outcomes.items()), further):
            if task not in states:
                continue
            if outcome.result is AttemptResult.DONE:
                states[task] = TaskState.DONE
            elif final and states[task] is TaskState.OPEN:
                states[task] = TaskState.FAILED
        self._attempts = len(outcomes)
        self._unfinished = TaskState.OPEN in self._states.values()
        self._basis = basis


def is_of_field(mission: Mission) -> bool:
    """Whether it asks for more than `swarm.allocation.Problem` heeds."""
    return not PLAIN_CONSTRAINTS.issuperset(mission.constraints)


def mission_of(replica: Replica, name: str, brief: MissionConfig) -> Mission:
    """The mission as the board shows it now: all posted tasks, in board order, zones in force."""
    entries = sorted(replica.board.values(), key=_order)
    zones = zones_in_force(replica) if replica.brief is brief else brief.zones
    return _mission(name, brief, map(_uav_of, brief.uavs), map(task_of, entries), zones)


def _mission(
    name: str,
    brief: MissionConfig,
    uavs: Iterable[Uav],
    tasks: Iterable[Task],
    zones: Iterable[ZoneSpec],
) -> Mission:
    return Mission(
        name=name,
        horizon_s=brief.horizon_s,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        success_default=brief.success_default,
        survival_default=brief.survival_default,
        reattempt_failed=brief.reattempt_failed,
        origin=Origin(*brief.origin),
        bases=tuple(base.base() for base in brief.bases),
        zones=tuple(zone.zone() for zone in zones),
        wind_enu_m_s=brief.wind_enu_m_s,
        zone_margin_m=brief.zone_margin_m,
        band_m=brief.band_m,
    )


def _uav_of(entry: UavSpec) -> Uav:
    return Uav(
        id=UavId(entry.id),
        position_enu_m=entry.position_enu_m,
        speed_m_s=entry.speed_m_s,
        success=entry.success,
        survival=entry.survival,
        kind=entry.kind,
        acceleration_m_s2=entry.acceleration_m_s2,
        airspeed_m_s=entry.airspeed_m_s,
        endurance_s=entry.endurance_s,
        reserve_frac=entry.reserve_frac,
        charge_frac=entry.charge_frac,
    )


def task_of(entry: PostedTask) -> Task:
    """The task that ``entry`` tells of, as missions have it."""
    return Task(
        id=TaskId(entry.task),
        position_enu_m=entry.position_enu_m,
        value=entry.value,
        service_s=entry.service_s,
        kind=entry.kind,
        due_s=entry.due_s,
        opens_s=entry.opens_s,
        closes_s=entry.closes_s,
        path_enu_m=entry.path_enu_m,
        height_m=entry.height_m,
    )


def _order(entry: TaskEntry) -> tuple[int, str]:
    return entry.number, entry.task


RuleMaker = Callable[[str, Mapping[str, Sequence[str]]], Rule | None]
"""The decision rule of an epoch by the name of its rule and its routes; see `rule_of`."""


def rule_of(name: str, routes: Mapping[str, Sequence[str]]) -> Rule | None:
    """The decision rule of an epoch, one instance for all its decisions; None if unknown here.

    Rules keep what they worked out for one decision to be quicker at the next.
    """
    if name == GuidedRule.name:
        return GuidedRule(routes)
    return rule_by_name(name) if name in RULE_NAMES else None


def ranks(sequence: Sequence[str], uavs: Sequence[str]) -> dict[str, int]:
    """Rank of every UAV: place in the sequence; those not in it follow by id."""
    listed = [uav for uav in sequence if uav in uavs]
    return {uav: rank for rank, uav in enumerate([*listed, *sorted(set(uavs) - set(listed))])}


def after_outcomes(problem: Problem, board: TaskBoard) -> TeamState:
    """Where every UAV stands after the attempts it has ended, as if nobody claimed anything.

    ``free_s`` and ``place_enu_m`` are of the last attempt, or 0 and the start before the first;
    ``open`` is as on the board. All are active: who takes part is the caller's judgement.
    """
    state = TeamState.at_start(problem)
    states = board.states
    state.open[:] = [states.get(task) is TaskState.OPEN for task in problem.task_ids]
    rows: dict[str, int] = {uav: index for index, uav in enumerate(problem.uav_ids)}
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    ended = sorted(
        (outcome.completed_s, columns[task], rows[uav])
        for (uav, task), outcome in board.replica.outcomes.items()
        if uav in rows and task in columns
    )
    for completed_s, task, uav in ended:
        _end_at(problem, state, uav, task, completed_s)
    return state


def finish_claim(problem: Problem, state: TeamState, uav: int, task: int, claim: Claim) -> None:
    """Let ``uav`` end the ``task`` it claims: then it is free, there, and nobody else takes it."""
    _end_at(problem, state, uav, task, claim.completion_s)
    state.open[task] = False


def _end_at(problem: Problem, state: TeamState, uav: int, task: int, completed_s: float) -> None:
    state.free_s[uav] = completed_s
    state.place_enu_m[uav] = problem.task_enu_m[task]
    state.survived[uav] *= problem.survival[uav, task]
