"""From a mission to a plan: choose the method, bound the work, prove what can be proven.

Plans of the method `guided` are made here: optimised lists and the sequence published with them.
Pop-ups (tasks with ``appears_s > 0``) are unknown to a plan.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from coordinator.planner.bound import meets, upper_bound
from coordinator.planner.exact import Optimum, estimated_s, optimum_before
from coordinator.planner.options import (
    Limit,
    ShouldStop,
    after_evaluations,
    after_time,
    first_of,
    never,
    part_of,
)
from coordinator.planner.sequence_search import (
    EXHAUSTIVE_UAVS,
    Progress,
    SearchLimits,
    search_sequence,
)
from swarm.allocation import RULE_NAMES, Rule, TeamState, evaluate, rank_of, rule_by_name, run
from swarm.allocation.problem import FloatArray, Problem
from swarm.allocation.rules import GuidedRule, team_arrays, team_at_start
from swarm.kernels.lower_level import EXACT_TASKS
from swarm.kernels.routes import TeamArrays, optimise_routes
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.runtime.clock import Clock
from swarm.runtime.errors import Fault, InputError, remedy_for_name

if TYPE_CHECKING:
    from swarm.protocol.calibration import FlightRates

ONLINE_METHODS = (*RULE_NAMES, GuidedRule.name)
"""Those whose rule agents can follow by themselves."""
METHODS = (*ONLINE_METHODS, "exact")


_ITERATIONS_PER_TASK, _FEWEST_ITERATIONS, _MOST_ITERATIONS = 400, 4_000, 300_000


@dataclass(frozen=True, slots=True)
class GuidedPlan:
    """What is published."""

    routes: tuple[tuple[int, ...], ...]
    """Task indices per UAV in order of execution."""
    sequence: tuple[int, ...]
    """UAV indices: who completes its first task earlier comes first, who has none last."""
    objective: float
    """Σ of eq. 1 over the lists, from the state on [value·s]."""
    iterations: int
    """Removals and re-insertions tried."""


def guided_plan(
    problem: Problem,
    *,
    seed: int = 0,
    stop: ShouldStop | None = None,
    progress: Progress | None = None,
    state: TeamState | None = None,
    lists: Sequence[Sequence[int]] | None = None,
    threads: int | None = None,
) -> GuidedPlan:
    """Optimise lists until stopped.

    With the same seed the same plan comes out, unless a limit in time decides how many iterations
    are made.

    Args:
        problem: the mission.
        seed: >= 0.
        stop: asked every few milliseconds with the iterations so far. The annealing cools along a
            `Limit`; under any other function, or none, it ends after a few seconds' worth of
            iterations.
        progress: told after each slice of work.
        state: where the team stands; at its start when None.
        lists: to begin with, such as those now published.
        threads: as many as there are processors when None; does not change the result.
    """
    state = TeamState.at_start(problem) if state is None else state
    finite = state.free_s[state.active & np.isfinite(state.free_s)]
    now_s = float(finite.min()) if len(finite) else 0.0
    team = team_arrays(problem, state, state.active, now_s)
    spent = 0

    def count(iterations: int, worth: float) -> None:
        nonlocal spent
        spent = iterations
        if progress is not None:
            progress(iterations, worth)

    routes, objective = optimise_routes(
        team,
        seed=seed,
        spent_frac=_spent_frac(problem.n_task, stop),
        lists=lists,
        progress=count,
        threads=threads,
    )
    return GuidedPlan(
        routes=tuple(tuple(route) for route in routes),
        sequence=_sequence(problem, team, routes),
        objective=objective,
        iterations=spent,
    )


def _spent_frac(n_task: int, stop: ShouldStop | None) -> Callable[[int], float]:
    if isinstance(stop, Limit):
        return stop.spent_frac
    most = min(_MOST_ITERATIONS, max(_FEWEST_ITERATIONS, _ITERATIONS_PER_TASK * n_task))

    def spent_frac(iterations: int) -> float:
        return 1.0 if stop is not None and stop(iterations) else iterations / most

    return spent_frac


def _sequence(
    problem: Problem, team: TeamArrays, routes: Sequence[Sequence[int]]
) -> tuple[int, ...]:
    free_s, place_enu_m, _, _ = team.arguments()
    first_s = np.full(problem.n_uav, np.inf)
    for uav, route in enumerate(routes):
        if route:
            travel_s = problem.travel_s(uav, place_enu_m[uav])[route[0]]
            first_s[uav] = free_s[uav] + travel_s + problem.service_s[route[0]]
    return tuple(int(uav) for uav in np.argsort(first_s, kind="stable"))


_PROOF_S = 1.0
"""The optimum is proven beside any method when that is estimated to take at most this long."""
_PROOF_FRAC = 0.5
"""Of what a limit leaves, the most that such a proof takes."""
_INSTEAD_OF_PROOF = 4_000
"""Iterations of ``guided`` where the proof of ``exact`` was stopped: some 20 ms."""
_EXHAUSTIVE_DECISIONS = 3_000_000
"""Decisions all first rounds together may take to be tried one by one: some seconds."""
_LOCAL_DECISIONS = 600_000
"""The same for the local search: a second or two."""
_MODEST_ROUNDS = 60
"""First rounds of some UAVs that modest planning holds at once: those of small fleets."""
_MODEST_EVALUATIONS = 200
"""Evaluations of a modest local search."""
_LONG_LOOKAHEAD_WORK = 60_000
"""Evaluations × tasks² of lookahead where its tours are long: a few seconds."""


def make_plan(
    mission: Mission,
    method: str | Rule,
    *,
    clock: Clock,
    seed: int = 0,
    stop: ShouldStop | None = None,
    progress: Progress | None = None,
    bound_s: float | None = None,
    bound_frac: float = 0.0,
    threads: int | None = None,
    modest: bool = False,
    rates: Mapping[str, FlightRates] | None = None,
    bound_progress: Callable[[float], None] | None = None,
) -> Plan:
    """Plan a mission.

    With the same seed and without a limit in time the same plan comes out every time.

    Args:
        mission: what to plan; its pop-ups are left out.
        method: one of `METHODS`, or a rule by which UAVs decide in the mission's order.
        clock: measures the elapsed time; nothing is decided by it.
        seed: of ``guided`` and of the local search, which only large fleets need.
        stop: ends planning with the best so far; None: after a few seconds' worth of work.
        progress: told the evaluations or iterations and the best J so far, again and again.
        bound_s: bound J for about this long where the optimum is not proven [s]; not when None.
        bound_frac: share of a limit that is kept for that bound, within 0..1.
        threads: at most this many, of processors if None; changes nothing but speed.
        modest: search little for a sequence; costs 0.1 % of J at 10 × 50, saves most of the time.
        rates: how UAVs fly, where that is known to be otherwise than the mission says.
        bound_progress: told each lower bound when it is found [value·s].

    Returns:
        The plan; ``exact`` has no sequence. Where the limit came before the end of the first
        evaluation, it has 0 evaluations and the last decisions are greedy.

    Raises:
        ValueError: there is no such method.
        ProblemTooLargeError: method ``exact`` on a mission too large for it.
        InputError: the method does not heed what the mission asks for in the field.
    """
    if isinstance(method, str) and method not in METHODS:
        raise ValueError(f"method must be one of {', '.join(METHODS)}, not {method!r}")
    if not mission.is_flat:
        # Here: all that the field needs would let plans of plain missions begin later.
        from coordinator.planner.field_plan import FieldRequest, make_field_plan

        asked = (stop, progress, bound_s, bound_frac, threads, modest, rates or {}, bound_progress)
        return make_field_plan(FieldRequest(mission, method, clock, seed, *asked))
    begin_s = clock.now_s()
    problem = _problem_of(mission.known_at_start(), rates)
    ends = never if stop is None else stop
    search = _PlanRequest(problem, method, seed, stop, progress, threads, modest, bound_progress)
    keeps = bound_s is not None and bound_frac > 0.0
    search_ends = part_of(ends, 1.0 - bound_frac) if keeps else ends
    proven = search.proven(search_ends if method == "exact" else ends)
    routes, sequence, evaluations = search.lists(proven, search_ends if proven is None else ends)
    best = None if proven is None else evaluate(problem, proven.routes)[0]
    bound = None
    if proven is None and bound_s is not None:
        bound_ends = first_of(after_time(clock, bound_s), ends)
        found, best, bound = search.bounded(routes, bound_ends)
        if method == GuidedRule.name and found is not routes:
            routes, sequence = found, _sequence(problem, team_at_start(problem), found)
    objective, completion_s = evaluate(problem, routes)
    plan = replace(
        search.described(mission.name, routes, sequence, completion_s),
        objective=objective,
        # The same lists summed in another order may be 1e-15 off.
        optimum=None if best is None else max(best, objective),
        bound=bound,
        evaluations=evaluations,
        elapsed_s=clock.now_s() - begin_s,
    )
    if mission.schema == 1:
        return plan
    from coordinator.planner.field_schedule import with_straight_schedule

    return with_straight_schedule(plan, problem)


def _problem_of(mission: Mission, rates: Mapping[str, FlightRates] | None) -> Problem:
    """With the accelerations and speeds that vehicles have told."""
    if rates:
        from swarm.protocol.calibration import fleet_as_told  # no registers on the desk

        mission = fleet_as_told(mission, rates)
    return Problem.from_mission(mission)


@dataclass(frozen=True, slots=True)
class _PlanRequest:
    """What `make_plan` is asked for, but for a bound."""

    problem: Problem
    method: str | Rule
    seed: int
    stop: ShouldStop | None
    progress: Progress | None
    threads: int | None
    modest: bool
    bound_progress: Callable[[float], None] | None

    def proven(self, ends: ShouldStop) -> Optimum | None:
        """The optimum where it is asked for or quickly proven; None otherwise, or if stopped."""
        if self.method != "exact":
            if estimated_s(self.problem) > _PROOF_S:
                return None
            ends = part_of(ends, _PROOF_FRAC)
        return optimum_before(self.problem, lambda: ends(0.0), threads=self.threads)

    def bounded(
        self, routes: Sequence[Sequence[int]], ends: ShouldStop
    ) -> tuple[Sequence[Sequence[int]], float | None, float | None]:
        """The best lists of the same tasks known in the end, and the optimum or a bound on J."""
        found = upper_bound(
            self.problem, routes, ends, threads=self.threads, progress=self.bound_progress
        )
        best = routes if found.lists is None else better_lists(self.problem, routes, found.lists)
        objective = evaluate(self.problem, best)[0]
        if meets(found.objective, objective):
            return best, objective, None
        return best, None, found.objective

    def described(
        self,
        name: str,
        routes: Sequence[Sequence[int]],
        sequence: tuple[int, ...] | None,
        completion_s: FloatArray,
    ) -> Plan:
        """The plan of these lists, but for what it is worth and what it took."""
        problem, method = self.problem, self.method
        return Plan(
            scenario=name,
            method=method if isinstance(method, str) else method.name,
            routes=_by_id(problem, routes),
            objective=0.0,
            completion_s={
                problem.task_ids[task]: float(completion_s[task])
                for route in routes
                for task in route
            },
            sequence=None if sequence is None else tuple(problem.uav_ids[uav] for uav in sequence),
            optimum=None,
            evaluations=0,
            elapsed_s=0.0,
            seed=self.seed,
        )

    def lists(
        self, proven: Optimum | None, ends: ShouldStop
    ) -> tuple[Sequence[Sequence[int]], tuple[int, ...] | None, int]:
        """Lists, the sequence that leads to them if there is one, and the work spent."""
        problem, method, seed, threads = self.problem, self.method, self.seed, self.threads
        if not isinstance(method, str):
            order = tuple(range(problem.n_uav))
            start = TeamState.at_start(problem)
            return run(problem, start, rank_of(order), method, lambda: ends(0.0))[0], order, 1
        if method == "exact" and proven is not None:
            return proven.routes, None, 0
        if method in ("exact", GuidedRule.name):
            stop, progress = None if self.stop is None else ends, self.progress
            if method == "exact":
                stop = after_evaluations(_INSTEAD_OF_PROOF)
            elif proven is not None and isinstance(stop, Limit):
                reached = _Reached(evaluate(problem, proven.routes)[0], progress)
                stop, progress = first_of(stop, reached.stops), reached.note
            guided = guided_plan(problem, seed=seed, stop=stop, progress=progress, threads=threads)
            sequence = guided.sequence if method == GuidedRule.name else None
            return guided.routes, sequence, guided.iterations
        stopped = isinstance(self.stop, Limit)
        search = search_sequence(
            problem,
            rule_by_name(method),
            np.random.default_rng(seed),
            ends,
            limits=_limits(problem, method, stopped=stopped, modest=self.modest),
            progress=self.progress,
            threads=threads,
        )
        return search.routes, search.sequence, search.evaluations


@dataclass(slots=True)
class _Reached:
    """Ends a search that has found what is proven to be the best: it cannot find more."""

    objective: float
    tell: Progress | None
    reached: bool = False

    def note(self, iterations: int, worth: float) -> None:
        """Look at the best J so far, and pass it on."""
        self.reached = worth >= self.objective
        if self.tell is not None:
            self.tell(iterations, worth)

    def stops(self, iterations: float) -> bool:
        """Whether it is found."""
        del iterations
        return self.reached


def better_lists(
    problem: Problem, lists: Sequence[Sequence[int]], others: Sequence[Sequence[int]]
) -> Sequence[Sequence[int]]:
    """Those with the larger J; the first if the others do not hold the same tasks."""
    same = sorted(task for one in lists for task in one) == sorted(t for one in others for t in one)
    return others if same and evaluate(problem, others)[0] > evaluate(problem, lists)[0] else lists


def _by_id(problem: Problem, routes: Sequence[Sequence[int]]) -> dict[UavId, tuple[TaskId, ...]]:
    return {
        uav: tuple(problem.task_ids[task] for task in route)
        for uav, route in zip(problem.uav_ids, routes, strict=True)
    }


def check_online_method(method: str) -> None:
    """Refuse a method whose rule agents cannot follow by themselves.

    Raises:
        InputError: `exact`, which has no rule, or no method at all.
    """
    if method not in ONLINE_METHODS:
        problem = "has no decision rule to fly by" if method in METHODS else "no such method"
        remedy = remedy_for_name(method, ONLINE_METHODS)
        raise InputError(Fault("--method", method, problem, remedy))


def _limits(problem: Problem, method: str, *, stopped: bool, modest: bool) -> SearchLimits:
    """What is cheap here; with ``stopped`` the caller's limit alone ends the local search."""
    if modest:
        usual = _limits(problem, method, stopped=False, modest=False).local_evaluations
        return SearchLimits(
            partial_rounds=_MODEST_ROUNDS,
            local_evaluations=min(_MODEST_EVALUATIONS, usual or _MODEST_EVALUATIONS),
        )
    n_task = max(1, problem.n_task)
    if method == "lookahead" and n_task > EXACT_TASKS:
        few = max(2, min(300, _LONG_LOOKAHEAD_WORK // n_task**2))
        return SearchLimits(
            first_rounds=few,
            first_rounds_large_fleet=few,
            decisions=2 * few,
            local_evaluations=None if stopped else few,
        )
    local = max(100, _LOCAL_DECISIONS // n_task)
    return SearchLimits(
        first_rounds=max(local, _EXHAUSTIVE_DECISIONS // n_task),
        first_rounds_large_fleet=local,
        partial_rounds=60_000 if problem.n_uav <= EXHAUSTIVE_UAVS else 4_000,
        local_evaluations=None if stopped else local,
    )
