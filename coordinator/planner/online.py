"""Planning in a mission that runs: where it stands, where it is heading, and what would be better.

A claimed task is finished first by the UAV that claims it; only what nobody has claimed is planned.
Old and new plan are predicted alike: by letting the fleet decide by them until nothing is left.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from coordinator.planner.options import ShouldStop, after_evaluations, first_of, never, part_of
from coordinator.planner.plan import guided_plan
from coordinator.planner.sequence_search import search_sequence
from swarm.allocation.lower_level import TeamState, run
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import Problem
from swarm.allocation.rules import GuidedRule, rule_by_name, team_arrays
from swarm.kernels.rollout import guided_choice
from swarm.protocol.board import (
    TaskBoard,
    TaskState,
    after_outcomes,
    finish_claim,
    holders,
    ranks,
    rule_of,
)
from swarm.protocol.calibration import FlightRates
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.messages import PlanEpoch
from swarm.protocol.operator_commands import zones_in_force
from swarm.protocol.uav_messages import AttemptResult, ClaimPhase, Outcome

if TYPE_CHECKING:
    from coordinator.planner.field_online import FieldCourse, FieldStanding

Lists = Mapping[str, tuple[str, ...]]
"""Task ids by UAV id, in order of execution."""
_ITERATIONS_PER_TASK = 400
_SEQUENCES = 200
"""Tried at most: UAVs under way decide in the order in which they become free, and a sequence
settles only what two of them decide at the same moment."""
_GOING_ON_FRAC, _SEARCH_FRAC = 0.2, 0.7
"""Of a limit in time, what has passed at most when it is known what comes of going on, and when the
search ends; the rest is for what comes of the new plan."""


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Where a running mission stands."""

    problem: Problem
    """Every UAV of the brief and every task posted so far."""
    state: TeamState
    """Open is what nobody has ended or claims; active is who takes part."""
    now_s: float
    """Mission time [s]."""
    visited: Mapping[str, tuple[str, ...]]
    """Closed tasks by who has ended them, in order; what two have ended is the first one's."""
    under_way: Mapping[str, str]
    """UAV id -> id of the open task that it is going to end."""
    withdrawn: frozenset[str]
    failures: int
    """Attempts that failed so far."""
    zones: tuple[ZoneSpec, ...] = ()
    """Where not to fly."""
    field: FieldStanding | None = None
    """The same under the field's constraints; None where there are none. ``state`` knows nothing
    of these: it tells who is where, and what is open."""
    rates: tuple[tuple[str, FlightRates], ...] = ()
    """UAVs that fly otherwise than the brief says, and how they do."""

    @classmethod
    def of(cls, board: TaskBoard, credible: Collection[str], mission_s: float) -> Situation | None:
        """The situation as the registers of one replica show it; None before the brief.

        ``credible`` are the writers believed alive whose claims count.
        """
        problem = board.problem
        if problem is None:
            return None
        states, replica = board.states, board.replica
        claims = {uav: claim for uav, claim in replica.claims.items() if uav in credible}
        under_way = {
            uav: task
            for task, uav in holders(claims).items()
            if uav in problem.uav_ids and states.get(task) is TaskState.OPEN
        }
        state = after_outcomes(problem, board)
        rows: dict[str, int] = {uav: index for index, uav in enumerate(problem.uav_ids)}
        columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
        for uav, task in under_way.items():
            finish_claim(problem, state, rows[uav], columns[task], claims[uav])
        state.active[:] = [
            uav in claims and claims[uav].phase not in (ClaimPhase.OUT, ClaimPhase.PAUSED)
            for uav in problem.uav_ids
        ]
        # Who is late may be there any moment, and who waits may decide at once.
        np.maximum(state.free_s, mission_s, out=state.free_s)
        taking_part = [uav for uav, part in zip(problem.uav_ids, state.active, strict=True) if part]
        standing = None
        if (in_field := board.field_problem) is not None:
            # Plain missions never load it.
            from coordinator.planner.field_online import FieldStanding as Standing

            standing = Standing.of(in_field, board, claims, under_way, taking_part, mission_s)
        return cls(
            problem,
            state,
            mission_s,
            _visited(replica.outcomes, states),
            under_way,
            frozenset(task for task, what in states.items() if what is TaskState.WITHDRAWN),
            sum(outcome.result is AttemptResult.FAILED for outcome in replica.outcomes.values()),
            zones_in_force(replica),
            standing,
            tuple(sorted(board.rates.items())),
        )

    @property
    def taking_part(self) -> frozenset[str]:
        """UAVs that can be given tasks."""
        ids, active = self.problem.uav_ids, self.state.active
        return frozenset(uav for uav, is_active in zip(ids, active, strict=True) if is_active)

    @property
    def is_settled(self) -> bool:
        """Nothing is left that a plan could decide."""
        if self.field is not None:
            return self.field.is_settled
        capable = self.problem.capable[self.state.active][:, self.state.open]
        return not bool(capable.any())


@dataclass(frozen=True, slots=True)
class EpochPolicy:
    """What an epoch has the fleet decide by."""

    rule: str
    sequence: tuple[str, ...]
    routes: Lists

    @classmethod
    def of(cls, epoch: PlanEpoch) -> EpochPolicy:
        """That of ``epoch``."""
        return cls(epoch.rule, epoch.sequence, epoch.routes)


@dataclass(frozen=True, slots=True)
class Prediction:
    """What becomes of the tasks that are not closed yet."""

    lists: Lists
    """What each UAV is going to do, after what it is doing now."""
    completion_s: Mapping[str, float]
    """Predicted completion of the tasks on the lists and of those under way [s mission time]."""
    objective: float
    """Σ of eq. 1 over the lists [value·s]."""
    n_left_out: int = 0
    """Of the open tasks without due_s, those that no list holds; told in the field alone."""


@dataclass(frozen=True, slots=True)
class ReplanResult:
    """What may become the next epoch, beside what comes of the one that runs."""

    rule: str
    sequence: tuple[str, ...]
    """Of the UAVs taking part."""
    prediction: Prediction
    going_on: Prediction
    """What happens without the new plan."""


def predicted(situation: Situation, course: EpochPolicy, stop: ShouldStop = never) -> Prediction:
    """Let the fleet go on by ``course``, everybody deciding in turn, until nothing is left.

    Told to stop, the rest is as the lists of ``course`` have it, repaired where tasks are on none;
    without lists it is decided greedily.
    """
    problem = situation.problem
    if situation.field is not None:
        from coordinator.planner.field_online import going_on

        on = going_on(situation.field, course.rule, course.sequence, course.routes)
        return _in_field(situation, on)
    rule = rule_of(course.rule, course.routes)
    lists: list[list[int]] = [[] for _ in problem.uav_ids]
    if rule is not None:
        rank = ranks(course.sequence, problem.uav_ids)
        places = np.array([rank[uav] for uav in problem.uav_ids], dtype=np.int64)
        lists, _ = run(problem, situation.state, places, rule, lambda: stop(0.0))
        if course.rule == GuidedRule.name and stop(0.0):
            lists = _ended_by_lists(situation, course.routes, lists)
    objective, times_s = evaluate(problem, lists, situation.state)
    completion_s = _under_way_s(situation)
    completion_s |= {
        str(problem.task_ids[task]): float(times_s[task]) for route in lists for task in route
    }
    return Prediction(_by_id(problem, lists), completion_s, objective)


def replan(
    situation: Situation,
    course: EpochPolicy,
    method: str,
    *,
    seed: int = 0,
    stop: ShouldStop = never,
    threads: int | None = None,
) -> ReplanResult:
    """The best plan found in a second's work or so for what is open, from where everybody is.

    Predicted is what comes of the lists as they are published, see `complete_lists`. The fleet goes
    on by ``course`` until there is another one; ``stop`` ends searching and predicting earlier;
    ``threads`` (one for each processor when None) change nothing but speed.

    Raises:
        ValueError: there is no such rule.
    """
    problem, state = situation.problem, situation.state
    expected = predicted(situation, course, part_of(stop, _GOING_ON_FRAC))
    search_stop = part_of(stop, _SEARCH_FRAC)
    if situation.field is not None:
        return _replanned_in_field(
            situation, course, method, expected, seed=seed, stop=search_stop, threads=threads
        )
    routes: Lists = {}
    n_open = int(np.count_nonzero(state.open))
    if method == GuidedRule.name:
        plan = guided_plan(
            problem,
            seed=seed,
            stop=first_of(search_stop, after_evaluations(_ITERATIONS_PER_TASK * max(1, n_open))),
            state=state,
            lists=_by_index(problem, expected.lists),
            threads=threads,
        )
        order = plan.sequence
        routes = complete_lists(situation, _by_id(problem, plan.routes))
    else:
        order = search_sequence(
            problem,
            rule_by_name(method),
            np.random.default_rng(seed),
            first_of(search_stop, after_evaluations(_SEQUENCES)),
            state,
            threads=threads,
        ).sequence
    sequence = tuple(str(problem.uav_ids[uav]) for uav in order if state.active[uav])
    prediction = predicted(situation, EpochPolicy(method, sequence, routes), stop)
    return ReplanResult(method, sequence, prediction, expected)


def _replanned_in_field(
    situation: Situation,
    course: EpochPolicy,
    method: str,
    expected: Prediction,
    *,
    seed: int,
    stop: ShouldStop,
    threads: int | None,
) -> ReplanResult:
    """Better lists under the field's constraints; rules by themselves go on as they do."""
    standing = situation.field
    sequence = tuple(uav for uav in course.sequence if uav in situation.taking_part)
    sequence = (*sequence, *sorted(situation.taking_part.difference(sequence)))
    if standing is None or method != GuidedRule.name:
        return ReplanResult(method, sequence, expected, expected)
    from coordinator.planner.field_online import planned_anew
    from swarm.allocation.field.rules import item_lists

    begin = item_lists(standing.problem, expected.lists)
    found = planned_anew(standing, begin, seed=seed, stop=stop, threads=threads)
    return ReplanResult(method, sequence, _in_field(situation, found), expected)


def _in_field(situation: Situation, course: FieldCourse) -> Prediction:
    completion_s = _under_way_s(situation) | course.completion_s
    return Prediction(course.routes, completion_s, course.objective, course.n_left_out)


def _under_way_s(situation: Situation) -> dict[str, float]:
    """When the tasks that are under way will be done [s mission time]."""
    free_s = situation.state.free_s
    return {
        situation.under_way[uav]: float(free_s[index])
        for index, uav in enumerate(situation.problem.uav_ids)
        if uav in situation.under_way
    }


def complete_lists(situation: Situation, new: Lists) -> Lists:
    """New lists after all that is closed or under way.

    UAVs search anew at each decision while a task stands on no list. So every task is put on one,
    except those that nobody has planned for, because they have opened since.
    """
    problem, state = situation.problem, situation.state
    lists: dict[str, list[str]] = {}
    listed: set[str] = set()

    def add(uav: str, task: str) -> None:
        if task not in listed:
            listed.add(task)
            lists.setdefault(uav, []).append(task)

    for uav, tasks in situation.visited.items():
        for task in tasks:
            add(uav, task)
    for uav, task in situation.under_way.items():
        add(uav, task)
    for uav, tasks in new.items():
        for task in tasks:
            add(uav, task)
    takers = problem.capable[state.active].any(axis=0) & state.open
    for task, able, may_be_taken in zip(problem.task_ids, problem.capable.T, takers, strict=True):
        if able.any() and not may_be_taken:  # whose list it is on makes no difference now
            add(problem.uav_ids[int(able.argmax())], task)
    return {uav: tuple(tasks) for uav, tasks in lists.items()}


def worth_to_go(situation: Situation, lists: Lists) -> tuple[int, float]:
    """Required tasks left out, and J of what is open, if UAVs keep to ``lists`` from here on.

    Closed tasks are skipped; tasks of no UAV taking part are put where J gains most. Far cheaper
    than `predicted`. Without the field's constraints none is left out; J is in value·s.
    """
    state = situation.state
    if situation.is_settled:
        return 0, 0.0
    if situation.field is not None:
        from coordinator.planner.field_online import worth_to_go as field_worth

        return field_worth(situation.field, lists)
    next_s = np.where(state.active, state.free_s, np.inf)
    team = team_arrays(situation.problem, state, state.active, situation.now_s)
    indices = _by_index(situation.problem, lists)
    return 0, guided_choice(team, indices, int(next_s.argmin())).worth


def _ended_by_lists(
    situation: Situation, routes: Lists, begun: Sequence[Sequence[int]]
) -> list[list[int]]:
    """What has been decided, and then what ``routes`` have left."""
    problem, state = situation.problem, situation.state
    _, times_s = evaluate(problem, begun, state)
    state = state.copy()
    for uav, route in enumerate(begun):
        for task in route:
            state.free_s[uav] = times_s[task]
            state.place_enu_m[uav] = problem.task_enu_m[task]
            state.survived[uav] *= problem.survival[uav, task]
            state.open[task] = False
    rest = guided_plan(problem, stop=lambda _: True, state=state, lists=_by_index(problem, routes))
    return [[*route, *more] for route, more in zip(begun, rest.routes, strict=True)]


def _visited(
    outcomes: Mapping[tuple[str, str], Outcome], states: Mapping[str, TaskState]
) -> dict[str, tuple[str, ...]]:
    visited: dict[str, list[str]] = {}
    seen: set[str] = set()
    for (uav, task), _ in sorted(outcomes.items(), key=lambda item: (item[1].completed_s, item[0])):
        if task not in seen and states.get(task, TaskState.OPEN) is not TaskState.OPEN:
            seen.add(task)
            visited.setdefault(uav, []).append(task)
    return {uav: tuple(tasks) for uav, tasks in visited.items()}


def _by_id(problem: Problem, lists: Sequence[Sequence[int]]) -> Lists:
    return {
        str(uav): tuple(str(problem.task_ids[task]) for task in route)
        for uav, route in zip(problem.uav_ids, lists, strict=True)
    }


def _by_index(problem: Problem, lists: Lists) -> list[list[int]]:
    columns: dict[str, int] = {task: index for index, task in enumerate(problem.task_ids)}
    return [
        [columns[task] for task in lists.get(uav, ()) if task in columns] for uav in problem.uav_ids
    ]
