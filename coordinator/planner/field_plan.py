"""From a mission in the field to a plan: batteries, windows, due times, lines, bases, zones, wind.

What `coordinator.planner.plan` is for the paper's missions. Plans compare by (fewest tasks without
due time left out, then largest J). Pop-ups are unknown to a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from coordinator.planner.field_bound import field_bound
from coordinator.planner.field_exact import FieldPlanLists, estimated_field_s, field_optimum_before
from coordinator.planner.field_guided import field_guided_plan
from coordinator.planner.field_schedule import left_out, schedule_of
from coordinator.planner.field_sequence import search_field_sequence, worth_of
from coordinator.planner.options import (
    Limit,
    ShouldStop,
    after_evaluations,
    after_time,
    first_of,
    never,
    part_of,
)
from coordinator.planner.sequence_search import Progress
from swarm.allocation import Rule
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.network import TooManyLegsError
from swarm.allocation.field.problem import FloatArray
from swarm.allocation.field.rules import FIELD_RULES
from swarm.kernels.field import FIELD_GREEDY, FlownLists, fly_lists, run_rule
from swarm.model import Mission, Plan, TaskId
from swarm.runtime.clock import Clock
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from swarm.protocol.calibration import FlightRates

FIELD_METHODS = (*FIELD_RULES, "guided", "exact")
_PROOF_S = 1.0
"""The optimum is proven beside any method when that is estimated to take at most this long."""
_PROOF_FRAC = 0.5
"""Of what a limit leaves, the most that such a proof takes."""
_KNOWN_ITERATIONS = 400
"""Of ``guided``, for lists that the proof of ``exact`` begins with."""


@dataclass(frozen=True, slots=True)
class FieldRequest:
    """What a plan is asked for; as the arguments of `coordinator.planner.plan.make_plan`."""

    mission: Mission
    method: str | Rule
    clock: Clock
    seed: int
    stop: ShouldStop | None
    progress: Progress | None
    bound_s: float | None
    bound_frac: float
    threads: int | None
    modest: bool
    rates: Mapping[str, FlightRates]
    bound_progress: Callable[[float], None] | None


def is_field(mission: Mission) -> bool:
    """Whether ``mission`` asks for more than the planner of the paper's missions heeds."""
    return not mission.is_flat


def make_field_plan(asked: FieldRequest) -> Plan:
    """Plan a mission in the field; see `coordinator.planner.plan.make_plan`.

    Raises:
        InputError: the method does not heed what the mission asks for, or it has too many places.
        ProblemTooLargeError: method ``exact`` on a mission too large for it.
    """
    method = _field_method(asked)
    begin_s = asked.clock.now_s()
    problem = _problem_of(asked.mission, asked.rates)
    ends = never if asked.stop is None else asked.stop
    keeps = asked.bound_s is not None and asked.bound_frac > 0.0
    search_ends = part_of(ends, 1.0 - asked.bound_frac) if keeps else ends
    search = _FieldSearch(problem, method, asked)
    optimum = search.optimum(search_ends if method == "exact" else ends)
    found = search.lists(optimum, search_ends if optimum is None else ends)
    if asked.stop is not None:  # which may have been before anything was found
        found = search.at_least_greedy(found)
    flown = fly_lists(problem.kernel, FieldState.at_start(problem, found.sequence), found.lists)
    plan = replace(
        _described(asked.mission.name, method, problem, found, flown),
        seed=asked.seed,
        elapsed_s=asked.clock.now_s() - begin_s,
    )
    if optimum is not None and optimum.proven:
        fewest, most = optimum.n_left_out, optimum.objective
        if plan.required_left_out <= fewest:  # sums in another order may be 1e-15 off
            most = max(most, plan.objective)
        plan = replace(plan, optimum=most, fewest_left_out=fewest)
    elif asked.bound_s is not None:
        bound = field_bound(
            problem,
            first_of(after_time(asked.clock, asked.bound_s), ends),
            known=plan.objective,
            price=_worth_each(problem, found.lists, flown),
            threads=asked.threads,
            progress=asked.bound_progress,
        )
        plan = replace(plan, bound=bound.objective, fewest_left_out=bound.fewest_left_out)
    return replace(plan, elapsed_s=asked.clock.now_s() - begin_s)


def _problem_of(mission: Mission, rates: Mapping[str, FlightRates]) -> FieldProblem:
    known = mission.known_at_start()
    try:
        if not rates:
            return FieldProblem.from_mission(known)
        # Planning on the desk loads no registers.
        from swarm.protocol.calibration import field_as_flown, field_as_told

        return field_as_flown(field_as_told(known, rates, FieldProblem.from_mission), rates)
    except TooManyLegsError as error:
        remedy = "fly fewer tasks at a time, or UAVs that are alike"
        raise InputError(Fault(f"mission {mission.name}", "", str(error), remedy)) from error


def _field_method(asked: FieldRequest) -> str:
    method = asked.method
    if isinstance(method, str) and method in FIELD_METHODS:
        return method
    name = method if isinstance(method, str) else method.name
    heeds = ", ".join(asked.mission.constraints)
    problem = f"does not heed {heeds} of mission {asked.mission.name} yet"
    raise InputError(Fault("--method", name, problem, f"choose one of {', '.join(FIELD_METHODS)}"))


@dataclass(frozen=True, slots=True)
class _FieldLists:
    """What a search found."""

    lists: tuple[tuple[int, ...], ...]
    sequence: tuple[int, ...]
    evaluations: int


@dataclass(frozen=True, slots=True)
class _FieldSearch:
    """How a method finds its lists."""

    problem: FieldProblem
    method: str
    asked: FieldRequest

    def optimum(self, ends: ShouldStop) -> FieldPlanLists | None:
        """What ``exact`` finds where it is asked for or quick; None otherwise, or if stopped."""
        known: tuple[tuple[int, ...], ...] = ()
        if self.method == "exact":
            known = self._guided(after_evaluations(_KNOWN_ITERATIONS)).lists
        elif estimated_field_s(self.problem) > _PROOF_S:
            return None
        else:
            ends = part_of(ends, _PROOF_FRAC)
        return field_optimum_before(
            self.problem, lambda: ends(0.0), known=known, threads=self.asked.threads
        )

    def lists(self, optimum: FieldPlanLists | None, ends: ShouldStop) -> _FieldLists:
        """Lists, with the sequence by which they are flown, and the work spent."""
        asked = self.asked
        if self.method in FIELD_RULES:
            found = search_field_sequence(
                self.problem,
                FIELD_RULES[self.method],
                np.random.default_rng(asked.seed),
                ends,
                limited=isinstance(asked.stop, Limit),
                modest=asked.modest,
                progress=asked.progress,
            )
            return _FieldLists(found.lists, found.sequence, found.evaluations)
        if self.method == "guided":
            return self._guided(None if asked.stop is None else ends)
        if optimum is None:
            return self._guided(after_evaluations(_KNOWN_ITERATIONS))
        return _FieldLists(optimum.lists, tuple(range(self.problem.n_uav)), 0)

    def at_least_greedy(self, found: _FieldLists) -> _FieldLists:
        """What was found, or the greedy decisions in the mission's order where they are better."""
        greedy = run_rule(self.problem.kernel, FieldState.at_start(self.problem), FIELD_GREEDY)
        lists = tuple(tuple(items) for items in greedy.lists(self.problem.n_uav))
        instead = replace(found, lists=lists, sequence=tuple(range(self.problem.n_uav)))
        return max(found, instead, key=self._worth)

    def _worth(self, found: _FieldLists) -> tuple[float, float]:
        state = FieldState.at_start(self.problem, found.sequence)
        return worth_of(self.problem, state, found.lists)

    def _guided(self, stop: ShouldStop | None) -> _FieldLists:
        made = field_guided_plan(
            self.problem,
            seed=self.asked.seed,
            stop=stop,
            progress=self.asked.progress,
            threads=self.asked.threads,
        )
        return _FieldLists(made.lists, made.sequence, made.iterations)


def _described(
    scenario: str, method: str, problem: FieldProblem, found: _FieldLists, flown: FlownLists
) -> Plan:
    """The plan of lists that can be flown, without what they are compared with."""
    schedule = schedule_of(problem, found.lists, flown)
    done = [item >> 1 for items in found.lists for item in items if item >= 0]
    work = [entry for entries in schedule.values() for entry in entries[:-1] if entry.base is None]
    return Plan(
        scenario=scenario,
        method=method,
        routes={
            uav: tuple(problem.task_ids[item >> 1] for item in items if item >= 0)
            for uav, items in zip(problem.uav_ids, found.lists, strict=True)
        },
        objective=float(flown.value.sum()),
        completion_s={TaskId(entry.go): entry.end_s for entry in work},
        sequence=tuple(problem.uav_ids[uav] for uav in found.sequence),
        optimum=None,
        evaluations=found.evaluations,
        elapsed_s=0.0,
        seed=0,
        schedule=schedule,
        left_out=left_out(problem, FieldState.at_start(problem), done),
        required_left_out=int(problem.required.sum() - problem.required[done].sum()),
    )


def _worth_each(
    problem: FieldProblem, lists: Sequence[Sequence[int]], flown: FlownLists
) -> FloatArray:
    """(n_task,) p·m·(until − end) of what is on the lists, at least 0 [value·s]."""
    worth = np.zeros(problem.n_task)
    row = 0
    for uav, items in enumerate(lists):
        for item in items:
            if item >= 0:
                task = item >> 1
                left_s = problem.until_s[task] - flown.times_s[row, 3]
                worth[task] = max(0.0, float(problem.weight[uav, task] * left_s))
            row += 1
    return worth
