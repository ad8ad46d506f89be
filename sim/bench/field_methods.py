"""The planning methods that are compared under the field's constraints, and their missions.

What `sim.bench.solvers` is for the paper's missions; a method's lists hold items.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module

import numpy as np

from sim.bench.solvers import PlanningMethod, PlanningResult, SolverOf, Trace
from sim.study.baselines import ortools_field
from sim.study.field_generator import FieldShape, field_span_s, random_field_mission
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.field.rules import FIELD_INDEX_RULES, FIELD_RULES
from swarm.kernels.field import run_rule
from swarm.runtime.clock import Clock
from swarm.runtime.errors import Fault, InputError

BENCH_SHAPE = FieldShape(endurance_frac=0.4, bases=2, slots=0, zones=4, windows_frac=0.5)
"""As the shipped study field.toml, but without a limit of slots."""
_HORIZON_FRAC = 1.2

FieldSolver = SolverOf[FieldProblem]


def bench_problem(
    n_uav: int, n_task: int, seed: int, shape: FieldShape = BENCH_SHAPE
) -> FieldProblem:
    """The random mission of ``shape``, where every UAV succeeds for certain.

    Then J can be stated by solvers that know no p for every UAV. D is 1.2 times what the mission
    takes by value per time.
    """
    drawn = random_field_mission(n_uav, n_task, seed, shape, f"{n_uav}x{n_task}-{seed}")
    mission = replace(drawn, uavs=tuple(replace(uav, success={}) for uav in drawn.uavs))
    horizon_s = _HORIZON_FRAC * field_span_s(mission)
    if not horizon_s > 0.0:
        problem = f"nobody can do anything in the mission of seed {seed}"
        raise InputError(Fault("--sizes", f"{n_uav}x{n_task}", problem, "ask for more tasks"))
    return FieldProblem.from_mission(replace(mission, horizon_s=horizon_s))


def _load_guided(*, threads: int | None) -> FieldSolver:
    from coordinator.planner.field_guided import field_guided_plan
    from coordinator.planner.options import after_time

    def solve(problem: FieldProblem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        trace, stop = Trace(clock, limit_s), after_time(clock, limit_s)
        plan = field_guided_plan(problem, seed=seed, stop=stop, progress=trace, threads=threads)
        return PlanningResult(plan.lists, f"{plan.iterations} iterations", tuple(trace.points))

    return solve


def _load_greedy() -> FieldSolver:
    from coordinator.planner.field_sequence import search_field_sequence
    from coordinator.planner.options import after_time

    def solve(problem: FieldProblem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        trace, stop = Trace(clock, limit_s), after_time(clock, limit_s)
        rng, rule = np.random.default_rng(seed), FIELD_RULES["greedy"]
        found = search_field_sequence(problem, rule, rng, stop, limited=True, progress=trace)
        note = f"best of {found.evaluations} sequences"
        return PlanningResult(found.lists, note, tuple(trace.points))

    return solve


def index_lists(problem: FieldProblem, name: str) -> list[list[int]]:
    """Items per UAV by an index rule, decided one by one."""
    runs = run_rule(problem.kernel, FieldState.at_start(problem), FIELD_INDEX_RULES[name])
    return runs.lists(problem.n_uav)


def _load_index(name: str) -> FieldSolver:
    def solve(problem: FieldProblem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del limit_s, seed, clock
        return PlanningResult(index_lists(problem, name))

    return solve


def _load_cbba() -> FieldSolver:
    from sim.study.baselines.field_cbba import field_cbba
    from swarm.kernels.field_search import optimise_lists

    def solve(problem: FieldProblem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del limit_s, seed, clock
        state = FieldState.at_start(problem)
        result = field_cbba(problem, state)
        orders: Sequence[Sequence[int]] = [[2 * task for task in path] for path in result.routes]
        placed = optimise_lists(problem.kernel, state, iterations=0, lists=orders, threads=1)
        note = f"{'converged' if result.converged else 'stopped'} after {result.rounds} rounds"
        return PlanningResult(placed.lists, note)

    return solve


def _load_ortools(*, warm: bool) -> FieldSolver:
    import_module("ortools.constraint_solver.pywrapcp")  # so that its time is not counted

    def solve(problem: FieldProblem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del seed, clock
        start = index_lists(problem, "value-per-time") if warm else None
        return PlanningResult(ortools_field.field_lists(problem, limit_s, start))

    return solve


def _ortools_refusal(problem: FieldProblem, limit_s: float) -> str | None:
    del limit_s
    return ortools_field.refusal(problem)


FIELD_METHODS: dict[str, PlanningMethod[FieldProblem]] = {
    method.name: method
    for method in (
        PlanningMethod(
            "guided",
            "lists searched as plans are, on every core",
            partial(_load_guided, threads=None),
        ),
        PlanningMethod("guided-1-thread", "the same on one core", partial(_load_guided, threads=1)),
        PlanningMethod("greedy", "the paper's greedy, best sequence found", _load_greedy),
        PlanningMethod(
            "value-per-time", "index rule, one pass", partial(_load_index, "value-per-time")
        ),
        PlanningMethod(
            "nearest", "what can begin soonest first, one pass", partial(_load_index, "nearest")
        ),
        PlanningMethod("cbba", "consensus-based bundle algorithm, no limit", _load_cbba),
        PlanningMethod(
            "ortools",
            "OR-Tools routing on one core, from its own start",
            partial(_load_ortools, warm=False),
            _ortools_refusal,
        ),
        PlanningMethod(
            "ortools-warm",
            "OR-Tools routing on one core, from value-per-time's lists",
            partial(_load_ortools, warm=True),
            _ortools_refusal,
        ),
    )
}
"""By name, in the order of tables."""
