"""Planning in a mission that runs: where it stands, where it is heading, and what would be better.

A claimed task is finished first by the UAV that claims it; only what nobody has claimed is planned.
What is predicted of lists is at least what keeping to them brings, as a UAV leaves them only for
something better. Where few tasks are open, each decision is made as agents will make it, and the
prediction is what they fly if nothing else happens. Where many are, lists that hold all that is
open are taken to be kept to, in time linear in the tasks. Lists that do not are mended first, as
decisions mend them one by one, by a search in which each open task has its turn a few times; that
is within 1 % of what decisions come to. Lists that are found are searched from the predicted ones
on, so none is worse by its own prediction, whenever the search is stopped.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from coordinator.planner.options import ShouldStop, after_evaluations, first_of, never, part_of
from coordinator.planner.plan import guided_plan
from coordinator.planner.sequence_search import search_sequence
from coordinator.planner.visits import Visits
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
from swarm.protocol.uav_messages import AttemptResult, ClaimPhase

if TYPE_CHECKING:
    from coordinator.planner.field_online import FieldCourse, FieldStanding

Lists = Mapping[str, tuple[str, ...]]
"""Task ids by UAV id, in order of execution."""
_ITERATIONS_PER_TASK, _MOST_ITERATIONS = 400, 200_000
"""Of a search without a limit in time: what one with a limit gets done at 50 × 500."""
_SEQUENCES = 200
"""Tried at most: UAVs under way decide in the order in which they become free, and a sequence
settles only what two of them decide at the same moment."""
_GOING_ON_FRAC, _SEARCH_FRAC = 0.2, 0.93
"""Of a limit in time, what has passed at most when it is known what comes of going on, and when the
search ends; the rest is for its last steps and for telling what it found."""
_DECIDED_TASKS = 60
"""With so many open tasks at the most each decision is made: some 50 ms at 10 × 50 after a loss."""
_MENDING_PER_TASK = 10
"""Steps of search in which lists are mended; see the module."""
_LEAST_S, _MOST_S, _TASKS_PER_S = 2.0, 5.0, 1000


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
            if uav in problem.row_of and states.get(task) is TaskState.OPEN
        }
        state = after_outcomes(problem, board)
        rows, columns = problem.row_of, problem.column_of
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
            Visits(replica.outcomes, states),
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
    def open_tasks(self) -> tuple[str, ...]:
        """What nobody has ended or claims."""
        ids = self.problem.task_ids
        return tuple(str(ids[task]) for task in np.flatnonzero(self.state.open).tolist())

    @property
    def is_settled(self) -> bool:
        """Nothing is left that a plan could decide."""
        if self.field is not None:
            return self.field.is_settled
        capable, open_ = self.problem.capable, self.state.open
        rows = np.flatnonzero(self.state.active)
        return not any((capable[row] & open_).any() for row in rows)  # mostly the first one can


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


def replan_limit_s(situation: Situation) -> float:
    """How long a running mission waits for a better plan [wall s]: 2 s, and up to 5 s where more
    than two thousand tasks are open.
    """
    n_open = int(np.count_nonzero(situation.state.open))
    return min(_MOST_S, max(_LEAST_S, n_open / _TASKS_PER_S))


def predicted(situation: Situation, course: EpochPolicy, stop: ShouldStop = never) -> Prediction:
    """What comes of it if the fleet goes on by ``course`` until nothing is left; see the module.

    Told to stop, the rest is as the lists of ``course`` have it, with the tasks that are on none
    put where they fit best; without lists it is decided greedily.
    """
    if situation.field is not None:
        from coordinator.planner.field_online import going_on

        on = going_on(situation.field, course.rule, course.sequence, course.routes, stop)
        return _in_field(situation, on)
    n_open = int(np.count_nonzero(situation.state.open))
    if course.rule == GuidedRule.name and n_open > _DECIDED_TASKS:
        return _by_lists(situation, _mended(situation, course.routes, stop))
    return _by_decisions(situation, course, stop)


def _by_decisions(situation: Situation, course: EpochPolicy, stop: ShouldStop) -> Prediction:
    """Everybody decides in turn."""
    problem = situation.problem
    rule = rule_of(course.rule, course.routes)
    lists: list[list[int]] = [[] for _ in problem.uav_ids]
    if rule is not None:
        rank = ranks(course.sequence, problem.uav_ids)
        places = np.array([rank[uav] for uav in problem.uav_ids], dtype=np.int64)
        lists, _ = run(problem, situation.state, places, rule, lambda: stop(0.0))
        if course.rule == GuidedRule.name and stop(0.0):
            lists = _ended_by_lists(situation, course.routes, lists)
    return _by_lists(situation, lists)


def _by_lists(situation: Situation, lists: Sequence[Sequence[int]]) -> Prediction:
    """UAVs keep to lists of open tasks."""
    problem = situation.problem
    objective, times_s = evaluate(problem, lists, situation.state)
    completion_s = _under_way_s(situation)
    completion_s |= {
        str(problem.task_ids[task]): float(times_s[task]) for route in lists for task in route
    }
    return Prediction(_by_id(problem, lists), completion_s, objective)


def _mended(situation: Situation, routes: Lists, stop: ShouldStop) -> Sequence[Sequence[int]]:
    """Lists of open tasks by ``routes``, as they are if they hold all that is open."""
    problem, state = situation.problem, situation.state
    lists = [
        [task for task in route if is_active and state.open[task] and problem.capable[uav, task]]
        for uav, (route, is_active) in enumerate(
            zip(_by_index(problem, routes), state.active.tolist(), strict=True)
        )
    ]
    doable = problem.capable[state.active].any(axis=0) & state.open
    n_doable = int(np.count_nonzero(doable))
    if sum(map(len, lists)) == n_doable:
        return lists
    steps = after_evaluations(_MENDING_PER_TASK * n_doable)
    ends = first_of(stop, steps)
    return guided_plan(problem, stop=ends, state=state, lists=lists, threads=1).routes


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
    on by ``course`` until there is another one. ``stop`` ends searching and predicting earlier;
    what it leaves is a whole plan, by the method's own prediction never worse than going on by it.
    ``threads`` (one for each processor when None) change nothing but speed.

    Raises:
        ValueError: there is no such rule.
    """
    if situation.field is not None:
        return _replanned_in_field(situation, course, method, seed=seed, stop=stop, threads=threads)
    expected = predicted(situation, course, part_of(stop, _GOING_ON_FRAC))
    search_stop = part_of(stop, _SEARCH_FRAC)
    if method == GuidedRule.name:
        if search_stop(0.0):  # to lay a search out takes longer than to say so
            sequence = _of_active(situation, _rows(situation, course.sequence))
            return ReplanResult(method, sequence, expected, expected)
        return _guided_anew(situation, expected, seed=seed, stop=search_stop, threads=threads)
    problem, state = situation.problem, situation.state
    order = search_sequence(
        problem,
        rule_by_name(method),
        np.random.default_rng(seed),
        first_of(search_stop, after_evaluations(_SEQUENCES)),
        state,
        threads=threads,
    ).sequence
    sequence = _of_active(situation, order)
    prediction = predicted(situation, EpochPolicy(method, sequence, {}), stop)
    if course.rule == method and not prediction.objective > expected.objective:
        sequence = _of_active(situation, _rows(situation, course.sequence))
        prediction = expected
    return ReplanResult(method, sequence, prediction, expected)


def _guided_anew(
    situation: Situation,
    expected: Prediction,
    *,
    seed: int,
    stop: ShouldStop,
    threads: int | None,
) -> ReplanResult:
    """The best lists found, searched from those that are expected to be flown."""
    problem, state = situation.problem, situation.state
    n_open = max(1, int(np.count_nonzero(state.open)))
    most = after_evaluations(min(_MOST_ITERATIONS, _ITERATIONS_PER_TASK * n_open))
    plan = guided_plan(
        problem,
        seed=seed,
        stop=first_of(stop, most),
        state=state,
        lists=_by_index(problem, expected.lists),
        threads=threads,
    )
    method, sequence = GuidedRule.name, _of_active(situation, plan.sequence)
    routes = complete_lists(situation, _by_id(problem, plan.routes))
    prediction = predicted(situation, EpochPolicy(method, sequence, routes), stop)
    if not prediction.objective > expected.objective:
        prediction = expected
    return ReplanResult(method, sequence, prediction, expected)


def _of_active(situation: Situation, order: Sequence[int]) -> tuple[str, ...]:
    ids, active = situation.problem.uav_ids, situation.state.active
    return tuple(str(ids[uav]) for uav in order if active[uav])


def _rows(situation: Situation, sequence: Sequence[str]) -> list[int]:
    """All UAVs by ``sequence``."""
    rank = ranks(sequence, situation.problem.uav_ids)
    ids = situation.problem.uav_ids
    return sorted(range(len(ids)), key=lambda uav: rank[ids[uav]])


def _replanned_in_field(
    situation: Situation,
    course: EpochPolicy,
    method: str,
    *,
    seed: int,
    stop: ShouldStop,
    threads: int | None,
) -> ReplanResult:
    """Better lists under the field's constraints; rules by themselves go on as they do."""
    from coordinator.planner.field_online import going_on, planned_anew

    sequence = tuple(uav for uav in course.sequence if uav in situation.taking_part)
    sequence = (*sequence, *sorted(situation.taking_part.difference(sequence)))
    standing = situation.field
    if standing is None:
        raise ValueError("the situation must be one in the field")
    on_stop = part_of(stop, _GOING_ON_FRAC)
    on = going_on(standing, course.rule, course.sequence, course.routes, on_stop)
    expected = _in_field(situation, on)
    if method != GuidedRule.name:
        return ReplanResult(method, sequence, expected, expected)
    search_stop = part_of(stop, _SEARCH_FRAC)
    found = planned_anew(standing, on.items, seed=seed, stop=search_stop, threads=threads)
    better = (-found.n_left_out, found.objective) > (-on.n_left_out, on.objective)
    return ReplanResult(
        method, sequence, _in_field(situation, found) if better else expected, expected
    )


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
    for column in np.flatnonzero(problem.capable.any(axis=0) & ~takers).tolist():
        # Whose list it is on makes no difference now.
        able = int(problem.capable[:, column].argmax())
        add(problem.uav_ids[able], problem.task_ids[column])
    return {uav: tuple(tasks) for uav, tasks in lists.items()}


def left_out_by(situation: Situation, lists: Lists) -> dict[str, tuple[str, ...]]:
    """Open tasks that are on none of ``lists``, by why; see `swarm.model.plan.LeftOut`.

    Nothing without the field's constraints: releases that fly such missions, too, cannot read it.
    """
    if situation.field is None:
        return {}
    from coordinator.planner.field_online import left_out_by as left_out_in_field

    return left_out_in_field(situation.field, lists)


def worth_to_go(situation: Situation, lists: Lists) -> tuple[int, float]:
    """Required tasks left out, and J of what is open, if UAVs keep to ``lists`` from here on.

    Closed tasks are skipped; tasks of no UAV taking part are put where a decision would put them.
    Far cheaper than `predicted`. Without the field's constraints none is left out; J is in value·s.
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


def _by_id(problem: Problem, lists: Sequence[Sequence[int]]) -> Lists:
    return {
        str(uav): tuple(str(problem.task_ids[task]) for task in route)
        for uav, route in zip(problem.uav_ids, lists, strict=True)
    }


def _by_index(problem: Problem, lists: Lists) -> list[list[int]]:
    columns = problem.column_of
    return [
        [columns[task] for task in lists.get(uav, ()) if task in columns] for uav in problem.uav_ids
    ]
