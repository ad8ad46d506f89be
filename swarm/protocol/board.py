"""What the registers say about tasks: the state of each, who holds it, where the team stands.

One UAV wins a task wherever the registers are equal. Held beats proposed. Proposed against
proposed: earlier decision, then rank, then id. Held against held, which takes a partition:
earlier predicted completion, then rank, then id. Who is alive each process judges for itself, and
passes in by leaving the lost out.
"""

from __future__ import annotations

from bisect import insort
from collections.abc import Callable, Collection, Mapping, Sequence
from enum import StrEnum
from itertools import islice

from swarm.allocation import field
from swarm.allocation.lower_level import Rule, TeamState
from swarm.allocation.problem import Problem
from swarm.allocation.rules import RULE_NAMES, GuidedRule, rule_by_name
from swarm.model import Mission, Task
from swarm.protocol.attempts import Attempts
from swarm.protocol.board_arrays import (
    BOARD_ARRAYS,
    BoardArrays,
    board_order,
    fleet_of,
    mission_with,
    task_of,
)
from swarm.protocol.calibration import (
    FlightRates,
    field_as_flown,
    field_as_told,
    flight_rates,
    told_by,
)
from swarm.protocol.encoding import FIELD_DEFAULTS
from swarm.protocol.messages import MissionConfig, TaskEntry
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
    """Whether some UAV that is or may yet take part in the mission is capable of some open task.

    ``present`` are the writers believed alive; the lost take no part.
    """
    problem, claims = board.problem, board.replica.claims
    if problem is None or not present:
        return False
    able = [
        index
        for index, uav in enumerate(problem.uav_ids)
        if uav in present and (uav not in claims or claims[uav].phase is not ClaimPhase.OUT)
    ]
    all_open, capable = board.open, problem.capable
    open_ = (column for column, task in enumerate(problem.task_ids) if task in all_open)
    # Mostly one of the first will do.
    first = list(islice(open_, _LOOKED_AT_FIRST))
    return bool(capable[:, first][able].any() or capable[:, list(open_)][able].any())


class TaskBoard:
    """What the registers of one replica say about tasks, worked out once per change."""

    def __init__(self, replica: Replica, mission: str) -> None:
        self.replica = replica
        self._name = mission
        self._entries: list[TaskEntry] = []
        """In board order."""
        self._entries_version = -1
        self._brief: MissionConfig | None = None
        self._fleet: Mission | None = None
        """The mission of that brief, without tasks and zones."""
        self._fleet_in_field = False
        self.all_in_field = False
        """Whether tables of legs are made where a plain problem tells enough, too."""
        self._limited = False
        """Whether a plain problem does not tell all of some task."""
        self._mission: Mission | None = None
        self._mission_version = -1
        self._field_briefed: field.FieldProblem | None = None
        """With its UAVs as the brief has them and as vehicles have told of their parameters."""
        self._field_told: dict[str, tuple[float | None, float | None]] = {}
        """What these had told then."""
        self._field_problem: field.FieldProblem | None = None
        self._field_version = -1
        self._field_rates: dict[str, FlightRates] = {}
        self._states: dict[str, TaskState] = {}
        self.generation = 0
        """Of the states: grows when they were worked out anew, not when some came or changed."""
        self._open: set[str] = set()
        """Tasks of that state."""
        self._attempts = Attempts()
        self._basis: tuple[int, int] | None = None
        """Versions of brief and board, and of outcomes apart from further ones, of the states."""
        self._n_outcomes = 0
        """How many outcomes the states take into account."""
        self._arrays: BoardArrays | None = None
        self._arrays_version = -1, -1
        self._rates: dict[str, FlightRates] = {}
        self._rates_version = -1, -1
        self._told: dict[str, tuple[float | None, float | None]] = {}
        """What of that vehicles have told of their parameters."""

    @property
    def states(self) -> dict[str, TaskState]:
        """State of every task on the board, in the order of the replica's board."""
        self._catch_up()
        return self._states

    @property
    def unfinished(self) -> bool:
        """Whether any task on the board is open."""
        return bool(self.open)

    @property
    def open(self) -> Collection[str]:
        """Tasks on the board that are open, in no order."""
        self._catch_up()
        return self._open

    @property
    def attempts(self) -> Attempts:
        """At tasks on the board."""
        self._catch_up()
        return self._attempts

    @property
    def problem(self) -> Problem | None:
        """Every UAV of the brief, as it flies, and every task posted so far; None before the brief.

        Times of its legs hold where there is no `field_problem`.
        """
        version = self.replica.board_version, self.replica.calibration_version
        if self._arrays_version != version:
            self._sort()
            brief = self.replica.brief
            self._arrays = None
            if brief is not None:
                self._arrays = BOARD_ARRAYS.of(self._name, brief, self._entries, self.rates)
            self._arrays_version = version
        return None if self._arrays is None else self._arrays.problem

    @property
    def mission(self) -> Mission | None:
        """The same with the zones in force; None before the brief."""
        if self._mission_version != self.replica.board_version:
            fleet, tasks, brief = self._fleet_now(), self._tasks_now(), self.replica.brief
            zones = zones_in_force(self.replica)
            self._mission = (
                None
                if fleet is None or brief is None
                else mission_with(self._name, brief, fleet.uavs, tasks, zones)
            )
            self._mission_version = self.replica.board_version
        return self._mission

    @property
    def field_problem(self) -> field.FieldProblem | None:
        """Of `mission`, each UAV as it flies, in its layer; None where `problem` tells all."""
        briefed, rates = self._field_briefed, self.rates
        if self._field_version != self.replica.board_version or self._field_told != self._told:
            briefed = self._field_briefed = self._field_problem_now()
            self._field_version, self._field_problem = self.replica.board_version, None
            self._field_told = self._told
        if briefed is not None and (self._field_problem is None or self._field_rates != rates):
            self._field_problem, self._field_rates = field_as_flown(briefed, rates), rates
        return self._field_problem

    @property
    def rates(self) -> dict[str, FlightRates]:
        """Of UAVs that fly otherwise than the brief says, how they do; by id."""
        version = self.replica.board_version, self.replica.calibration_version
        if self._rates_version != version:
            self._rates, self._rates_version = flight_rates(self.replica), version
            self._told = told_by(self._rates)
        return self._rates

    def _field_problem_now(self) -> field.FieldProblem | None:
        self._sort()
        brief = self.replica.brief
        if self._fleet_now() is None or brief is None:
            return None
        if not (self._limited or self._fleet_in_field or zones_in_force(self.replica)):
            return None
        mission = self.mission
        layers_m = [uav.layer_m for uav in brief.uavs]
        if mission is None:
            return None
        return field_as_told(mission, self.rates, lambda told: field.problem_of(told, layers_m))

    def _fleet_now(self) -> Mission | None:
        """The mission without tasks and zones, made once per brief; None before the brief."""
        brief = self.replica.brief
        if brief is not None and brief is not self._brief:
            self._brief = brief
            self._fleet = BOARD_ARRAYS.fleet(self._name, brief)
            asks_more = self.all_in_field and not self._fleet.is_plain
            self._fleet_in_field = asks_more or is_of_field(self._fleet)
        return self._fleet

    def _tasks_now(self) -> list[Task]:
        """In board order; what nothing new was said of is the same as before."""
        self._sort()
        return [BOARD_ARRAYS.task(entry) for entry in self._entries]

    def _sort(self) -> None:
        """Bring the entries up to date; most changes add one."""
        board, version = self.replica.board, self.replica.board_version
        if self._entries_version == version:
            return
        if self._has_only_grown(self._entries_version, len(self._entries)):
            for entry in islice(reversed(board.values()), version - self._entries_version):
                insort(self._entries, entry, key=board_order)
                self._limited |= _is_limited(entry)
        else:
            self._entries = sorted(board.values(), key=board_order)
            self._limited = any(map(_is_limited, self._entries))
        self._entries_version = version

    def _has_only_grown(self, version: int, n_task: int) -> bool:
        """Whether since that version of the board, with so many tasks, others have been added and
        nothing else has changed: then they are the last ones of the replica's board.
        """
        # Each change adds at most one task, so as many tasks as changes are nothing but additions.
        board, n_changes = self.replica.board, self.replica.board_version - version
        return version >= 0 and len(board) - n_task == n_changes

    def _catch_up(self) -> None:
        """Work the states out of brief, board and outcomes, or add what has come at their end.

        An outcome makes of a task the same whatever others there are and whichever comes first.
        """
        replica, outcomes = self.replica, self.replica.outcomes
        basis = replica.board_version, replica.reattempts
        if basis == self._basis and len(outcomes) == self._n_outcomes:
            return
        if self._arrays_version[0] != basis[0]:
            # The newest of this process are kept elsewhere; others need not wait to be forgotten.
            self._arrays, self._arrays_version = None, (-1, -1)
        if basis != self._basis and not self._add_entries(basis):
            self._states = {task: _untried(entry) for task, entry in replica.board.items()}
            self._open = {t for t, state in self._states.items() if state is TaskState.OPEN}
            self._n_outcomes, self._attempts = 0, Attempts()
            self.generation += 1
        final = replica.brief is None or not replica.brief.reattempt_failed
        states, further = self._states, len(outcomes) - self._n_outcomes
        for (uav, task), outcome in islice(reversed(outcomes.items()), further):
            before = states.get(task)
            if before is None:
                continue
            self._attempts.add(outcome.completed_s, replica.board[task].number, task, uav)
            if outcome.result is AttemptResult.DONE:
                states[task] = TaskState.DONE
            elif final and before is TaskState.OPEN:
                states[task] = TaskState.FAILED
            if states[task] is not TaskState.OPEN:
                self._open.discard(task)
        self._n_outcomes = len(outcomes)
        self._basis = basis

    def _add_entries(self, basis: tuple[int, int]) -> bool:
        """Add the states of new tasks that nobody has told an outcome of; whether that is all."""
        version, reattempts = self._basis or (-1, -1)
        if reattempts != basis[1] or not self._has_only_grown(version, len(self._states)):
            return False
        board, outcomes = self.replica.board, self.replica.outcomes
        new = list(islice(reversed(board.values()), basis[0] - version))
        if any((uav, entry.task) in outcomes for entry in new for uav in self.replica.heads):
            return False
        for entry in reversed(new):
            self._states[entry.task] = _untried(entry)
            if not entry.withdrawn:
                self._open.add(entry.task)
        return True


def _is_limited(entry: TaskEntry) -> bool:
    """Whether a plain problem does not tell all of the task."""
    return any(getattr(entry, name) != default for name, default in _UNLIMITED.items())


def _untried(entry: TaskEntry) -> TaskState:
    """What the task is as long as nobody has attempted it."""
    return TaskState.WITHDRAWN if entry.withdrawn else TaskState.OPEN


def is_of_field(mission: Mission) -> bool:
    """Whether it asks for more than `swarm.allocation.Problem` heeds."""
    return not mission.is_flat


def mission_of(replica: Replica, name: str, brief: MissionConfig) -> Mission:
    """The mission as the board shows it now: all posted tasks, in board order, zones in force."""
    entries = sorted(replica.board.values(), key=board_order)
    zones = zones_in_force(replica) if replica.brief is brief else brief.zones
    return mission_with(name, brief, fleet_of(brief), map(task_of, entries), zones)


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
    known = set(uavs)
    listed = [uav for uav in sequence if uav in known]
    return {uav: rank for rank, uav in enumerate([*listed, *sorted(known.difference(listed))])}


def after_outcomes(problem: Problem, board: TaskBoard) -> TeamState:
    """Where every UAV stands after the attempts it has ended, as if nobody claimed anything.

    ``free_s`` and ``place_enu_m`` are of the last attempt, or 0 and the start before the first;
    ``open`` is as on the board. All are active: who takes part is the caller's judgement.
    """
    state, open_ = board.attempts.team(problem), board.open
    state.open[:] = [task in open_ for task in problem.task_ids]
    return state


def finish_claim(problem: Problem, state: TeamState, uav: int, task: int, claim: Claim) -> None:
    """Let ``uav`` end the ``task`` it claims: then it is free, there, and nobody else takes it."""
    state.free_s[uav] = claim.completion_s
    state.place_enu_m[uav] = problem.task_enu_m[task]
    state.survived[uav] *= problem.survival[uav, task]
    state.open[task] = False
