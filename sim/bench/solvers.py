"""The planning methods that are compared, each behind one face and in a process of its own.

``python -m sim.bench.solvers`` reads one job as JSON from standard input and writes one result to
standard output, so that time and memory are the method's own. A method is loaded (its imports done)
before its time begins.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

from sim.bench.machine import peak_memory_bytes
from sim.study.baselines import ortools_routing
from sim.study.baselines.index_rules import makespan_s, nearest_first, value_per_time
from sim.study.generator import random_mission
from swarm.allocation.problem import Problem
from swarm.runtime.clock import Clock, SystemClock
from swarm.runtime.errors import SwarmError
from swarm.scenario import load_scenario

if TYPE_CHECKING:
    from swarm.allocation.field import FieldProblem

TracePoint = tuple[float, float]
"""Seconds since the start, and the best J found by then [value·s]."""


_GIB = 2.0**30
_MOST_MATRIX_GIB = 2.0
_SUCCESS_IN_ARCS_TASKS = 300
_SUCCESS_SHARE = 0.5


@dataclass(frozen=True, slots=True)
class PlanningResult:
    """What a method gave back."""

    routes: Sequence[Sequence[int]]
    note: str = ""
    """What a reader of its figures should know."""
    trace: tuple[TracePoint, ...] = ()
    """How its best J grew, for methods that can be stopped at any time."""


P = TypeVar("P")
SolverOf = Callable[[P, float, int, Clock], PlanningResult]
"""Of (problem, time limit [s], seed, clock)."""
Solver = SolverOf[Problem]


@dataclass(frozen=True, slots=True)
class PlanningMethod(Generic[P]):
    """One way to plan problems of a kind."""

    name: str
    what: str
    """In a few words, for people."""
    load: Callable[[], SolverOf[P]]
    refusal: Callable[[P, float], str | None] | None = None
    """Why it cannot do this problem within this limit [s], or None if it can; None if it always
    can."""


class Trace:
    """Collects how the best J grows; at most a point every hundredth of the limit."""

    def __init__(self, clock: Clock, limit_s: float) -> None:
        self._clock = clock
        self._begin_s = clock.now_s()
        self._apart_s = limit_s / 100.0
        self.points: list[TracePoint] = []

    def __call__(self, spent: int, worth: float) -> None:
        """As a search tells its progress."""
        del spent
        time_s = self._clock.now_s() - self._begin_s
        if not self.points or time_s - self.points[-1][0] >= self._apart_s:
            self.points.append((time_s, worth))


def _at_once(routes: Callable[[Problem], Sequence[Sequence[int]]]) -> Solver:
    """A solver that needs neither limit nor seed."""

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del limit_s, seed, clock
        return PlanningResult(routes(problem))

    return solve


def _load_guided() -> Solver:
    from coordinator.planner.options import after_time
    from coordinator.planner.plan import guided_plan

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        trace = Trace(clock, limit_s)
        stop = after_time(clock, limit_s)
        plan = guided_plan(problem, seed=seed, stop=stop, progress=trace)
        return PlanningResult(plan.routes, f"{plan.iterations} iterations", tuple(trace.points))

    return solve


def _load_greedy() -> Solver:
    from coordinator.planner.options import after_time
    from coordinator.planner.sequence_search import best_sequence
    from swarm.allocation import TeamState, rank_of, run
    from swarm.allocation.rules import kernel_rule

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        rule = kernel_rule("greedy")
        trace = Trace(clock, limit_s)
        stop = after_time(clock, limit_s)
        rng = np.random.default_rng(seed)
        search = best_sequence(problem, rule, rng, stop, progress=trace)
        state = TeamState.at_start(problem)
        routes, _ = run(problem, state, rank_of(search.sequence), rule)
        what = "all first rounds" if search.exhaustive else "best"
        return PlanningResult(
            routes, f"{what} of {search.evaluations} sequences", tuple(trace.points)
        )

    return solve


def _load_cbba() -> Solver:
    from coordinator.planner.options import after_time
    from sim.study.baselines.cbba import cbba

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del seed
        result = cbba(problem, should_stop=after_time(clock, limit_s))
        note = f"{'converged' if result.converged else 'stopped'} after {result.rounds} rounds"
        if result.completed:
            note += f"; {result.completed} tasks left were handed out by value per time"
        return PlanningResult(result.routes, note)

    return solve


def _load_ortools(*, warm: bool) -> Solver:
    import_module("ortools.constraint_solver.pywrapcp")  # so that its time is not counted

    def solve(problem: Problem, limit_s: float, seed: int, clock: Clock) -> PlanningResult:
        del seed, clock
        # With more tasks it hardly gets beyond a first solution, which is worse with p in the arcs.
        in_arcs = warm or problem.n_task <= _SUCCESS_IN_ARCS_TASKS
        routes = ortools_routing.ortools_routes(
            problem,
            limit_s,
            success_share=_SUCCESS_SHARE if in_arcs else 0.0,
            start=value_per_time(problem) if warm else None,
        )
        return PlanningResult(routes, "each UAV's own p" if in_arcs else "average p only")

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


METHODS: dict[str, PlanningMethod[Problem]] = {
    method.name: method
    for method in (
        PlanningMethod("guided", "lists by the route optimiser", _load_guided),
        PlanningMethod("greedy", "the paper's greedy, best sequence found", _load_greedy),
        PlanningMethod(
            "value-per-time",
            "index p·m/(travel + service), one pass",
            lambda: _at_once(value_per_time),
        ),
        PlanningMethod("nearest", "nearest task first, one pass", lambda: _at_once(nearest_first)),
        PlanningMethod("cbba", "consensus-based bundle algorithm", _load_cbba),
        PlanningMethod(
            "ortools",
            "OR-Tools routing, from its own start",
            partial(_load_ortools, warm=False),
            _ortools_refusal,
        ),
        PlanningMethod(
            "ortools-warm",
            "OR-Tools routing, from value-per-time's lists",
            partial(_load_ortools, warm=True),
            _ortools_refusal,
        ),
        PlanningMethod("exact", "proven optimum", _load_exact, _exact_refusal),
    )
}
"""By name, in the order of tables."""


HORIZON_SHARE = 1.2
"""D of random missions over the makespan of value-per-time's lists."""
_GRACE_S = 120.0
"""A method that ignores its limit is ended this long after twice the limit."""


@dataclass(frozen=True, slots=True)
class MissionSource:
    """Where a mission comes from: a scenario file, or size and seed of a random one."""

    scenario: str | None = None
    n_uav: int = 0
    n_task: int = 0
    seed: int = 0
    horizon_s: float | None = None
    """D, where it is known already [s]."""
    field: bool = False
    """Whether it has the field's constraints; a random one as `sim.bench.field_methods` has it."""


@dataclass(frozen=True, slots=True)
class PlanningJob:
    """What to run."""

    source: MissionSource
    method: str
    """One of `methods_for` its source."""
    limit_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class PlanningRun:
    """What came of it."""

    routes: list[list[int]]
    """Task indices per UAV; in the field items."""
    elapsed_s: float
    """From the problem's arrays to lists; imports are done before [s]."""
    cpu_s: float
    """Time of all processors in it [s]."""
    peak_bytes: int
    """Most memory of the whole process, interpreter and mission included."""
    base_bytes: int
    """The same before the method began."""
    note: str
    trace: list[TracePoint]
    """See `PlanningResult`."""


def methods_for(source: MissionSource) -> Mapping[str, PlanningMethod[Any]]:
    """Those that can be compared on it, by name, in the order of tables."""
    if not source.field:
        return METHODS
    from sim.bench.field_methods import FIELD_METHODS

    return FIELD_METHODS


def any_problem_of(source: MissionSource) -> Problem | FieldProblem:
    """The mission's arrays; pop-ups are unknown to a plan."""
    if not source.field:
        return problem_of(source)
    if source.scenario is not None:
        from swarm.allocation.field import FieldProblem

        return FieldProblem.from_mission(load_scenario(Path(source.scenario)).known_at_start())
    from sim.bench.field_methods import bench_problem

    return bench_problem(source.n_uav, source.n_task, source.seed)


def problem_of(source: MissionSource) -> Problem:
    """The same of a mission without the field's constraints."""
    if source.scenario is not None:
        return Problem.from_mission(load_scenario(Path(source.scenario)).known_at_start())
    if source.horizon_s is not None:
        return random_mission(source.n_uav, source.n_task, source.seed, horizon_s=source.horizon_s)
    problem = random_mission(source.n_uav, source.n_task, source.seed)
    longest_s = makespan_s(problem, value_per_time(problem))
    return replace(problem, horizon_s=HORIZON_SHARE * longest_s)


def run_job(job: PlanningJob, clock: Clock) -> PlanningRun:
    """Run a job in this process."""
    problem = any_problem_of(job.source)
    solve = methods_for(job.source)[job.method].load()
    base_bytes = peak_memory_bytes()
    begin_cpu_s, begin_s = _cpu_s(), clock.now_s()
    solved = solve(problem, job.limit_s, job.seed, clock)
    elapsed_s = clock.now_s() - begin_s
    return PlanningRun(
        routes=[[int(task) for task in route] for route in solved.routes],
        elapsed_s=elapsed_s,
        cpu_s=_cpu_s() - begin_cpu_s,
        peak_bytes=peak_memory_bytes(),
        base_bytes=base_bytes,
        note=solved.note,
        trace=list(solved.trace),
    )


def run_in_subprocess(job: PlanningJob) -> PlanningRun:
    """Run a job in a new process.

    Raises:
        SwarmError: the process failed or had to be ended.
    """
    limit_s = 2.0 * job.limit_s + _GRACE_S
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "sim.bench.solvers"],
            input=json.dumps(asdict(job)),
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise SwarmError(f"method {job.method} was ended after {limit_s:.0f} s") from error
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"]
        raise SwarmError(f"method {job.method} failed: {said[-1]}")
    fields: dict[str, Any] = json.loads(ended.stdout)
    fields["trace"] = [(time_s, worth) for time_s, worth in fields["trace"]]
    return PlanningRun(**fields)


def main(read: Callable[[], str], write: Callable[[str], object]) -> int:
    """Do the job that ``read`` gives and ``write`` the answer; its exit status."""
    fields: dict[str, Any] = json.loads(read())
    fields["source"] = MissionSource(**fields["source"])
    try:
        answer = run_job(PlanningJob(**fields), SystemClock())
    except KeyboardInterrupt:
        return 130
    write(json.dumps(asdict(answer), allow_nan=False))
    return 0


def _cpu_s() -> float:
    times = os.times()
    return times.user + times.system


if __name__ == "__main__":
    raise SystemExit(main(sys.stdin.read, sys.stdout.write))
