"""The planning methods that are compared, each behind one face.

A method is loaded (its imports done) before its time begins. Leaves out: measuring
(`sim.bench.worker`) and judging (`sim.bench.plan_bench`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module

import numpy as np

from sim.study.baselines import ortools_routing
from swarm.allocation.problem import Problem
from swarm.clock import Clock

__all__ = ["METHODS", "Method", "Solved", "Solver", "TracePoint"]

TracePoint = tuple[float, float]
"""Seconds since the start, and the best J found by then [value·s]."""

_GIB = 2.0**30
_MOST_MATRIX_GIB = 2.0
_SUCCESS_IN_ARCS_TASKS = 300
_SUCCESS_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class Solved:
    """What a method gave back."""

    routes: Sequence[Sequence[int]]
    note: str = ""
    """What a reader of its figures should know."""
    trace: tuple[TracePoint, ...] = ()
    """How its best J grew, for methods that can be stopped at any time."""


Solver = Callable[[Problem, float, int, Clock], Solved]
"""Of (problem, time limit [s], seed, clock)."""


@dataclass(frozen=True, slots=True)
class Method:
    """One way to plan."""

    name: str
    what: str
    """In a few words, for people."""
    load: Callable[[], Solver]
    refusal: Callable[[Problem, float], str | None] | None = None
    """Why it cannot do this problem within this limit [s], or None if it can; None if it always
    can."""


class _Trace:
    """Collects how the best J grows; at most a point every hundredth of the limit."""

    def __init__(self, clock: Clock, limit_s: float) -> None:
        self._clock = clock
        self._begin_s = clock.now_s()
        self._apart_s = limit_s / 100.0
        self.points: list[TracePoint] = []

    def __call__(self, spent: int, worth: float) -> None:
        del spent
        time_s = self._clock.now_s() - self._begin_s
        if not self.points or time_s - self.points[-1][0] >= self._apart_s:
            self.points.append((time_s, worth))


def _at_once(routes: Callable[[Problem], Sequence[Sequence[int]]]) -> Solver:
    """A solver that needs neither limit nor seed."""

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        del limit_s, seed, clock
        return Solved(routes(problem))

    return solve


def _load_guided() -> Solver:
    from coordinator.planner.routes import guided_plan
    from coordinator.planner.stop import after_time

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        trace = _Trace(clock, limit_s)
        stop = after_time(clock, limit_s)
        plan = guided_plan(problem, seed=seed, stop=stop, progress=trace)
        return Solved(plan.routes, f"{plan.iterations} iterations", tuple(trace.points))

    return solve


def _load_greedy() -> Solver:
    from coordinator.planner.sequence import best_sequence
    from coordinator.planner.stop import after_time
    from swarm.allocation import TeamState, rank_of, rule_by_name, run

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        rule = rule_by_name("greedy")
        trace = _Trace(clock, limit_s)
        stop = after_time(clock, limit_s)
        rng = np.random.default_rng(seed)
        search = best_sequence(problem, rule, rng, stop, progress=trace)
        state = TeamState.at_start(problem)
        routes, _ = run(problem, state, rank_of(search.sequence), rule)
        what = "all first rounds" if search.exhaustive else "best"
        return Solved(routes, f"{what} of {search.evaluations} sequences", tuple(trace.points))

    return solve


def _load_nearest() -> Solver:
    from sim.study.baselines.nearest import nearest_first

    return _at_once(nearest_first)


def _load_value_per_time() -> Solver:
    from sim.study.baselines.value_per_time import value_per_time

    return _at_once(value_per_time)


def _load_cbba() -> Solver:
    from coordinator.planner.stop import after_time
    from sim.study.baselines.cbba import cbba

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        del seed
        result = cbba(problem, should_stop=after_time(clock, limit_s))
        note = f"{'converged' if result.converged else 'stopped'} after {result.rounds} rounds"
        if result.completed:
            note += f"; {result.completed} tasks left were handed out by value per time"
        return Solved(result.routes, note)

    return solve


def _load_ortools() -> Solver:
    import_module("ortools.constraint_solver.pywrapcp")  # so that its time is not counted

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        del seed, clock
        # With more tasks it hardly gets beyond a first solution, which is worse with p in the arcs.
        share = _SUCCESS_SHARE if problem.n_task <= _SUCCESS_IN_ARCS_TASKS else 0.0
        routes = ortools_routing.ortools_routes(problem, limit_s, success_share=share)
        return Solved(routes, "each UAV's own p" if share else "average p only")

    return solve


def _load_ortools_warm() -> Solver:
    import_module("ortools.constraint_solver.pywrapcp")  # so that its time is not counted
    from sim.study.baselines.value_per_time import value_per_time

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> Solved:
        del seed, clock
        return Solved(
            ortools_routing.ortools_routes(
                problem, limit_s, success_share=_SUCCESS_SHARE, start=value_per_time(problem)
            ),
            "each UAV's own p",
        )

    return solve


def _load_exact() -> Solver:
    from coordinator.planner.exact import optimum

    return _at_once(lambda problem: optimum(problem).routes)


def _exact_refusal(problem: Problem, limit_s: float) -> str | None:
    from coordinator.planner.exact import estimated_s

    estimate_s = estimated_s(problem)
    if estimate_s <= limit_s:
        return None
    return "too large to prove" if estimate_s == float("inf") else "takes too long to prove"


def _ortools_refusal(problem: Problem, limit_s: float) -> str | None:
    del limit_s
    if not ortools_routing.is_installed():
        return "OR-Tools is not installed: pip install 'peckorder[bench]'"
    need_gib = ortools_routing.matrix_bytes(problem) / _GIB
    if need_gib > _MOST_MATRIX_GIB:
        return f"its matrices would take {need_gib:.0f} GiB"
    return None


METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method("guided", "lists by the route optimiser", _load_guided),
        Method("greedy", "the paper's greedy, best sequence found", _load_greedy),
        Method("value-per-time", "index p·m/(travel + service), one pass", _load_value_per_time),
        Method("nearest", "nearest task first, one pass", _load_nearest),
        Method("cbba", "consensus-based bundle algorithm", _load_cbba),
        Method("ortools", "OR-Tools routing, from its own start", _load_ortools, _ortools_refusal),
        Method(
            "ortools-warm",
            "OR-Tools routing, from value-per-time's lists",
            _load_ortools_warm,
            _ortools_refusal,
        ),
        Method("exact", "proven optimum", _load_exact, _exact_refusal),
    )
}
"""By name, in the order of tables."""
