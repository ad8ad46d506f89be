"""How close to the best lists guided ones are proven to be, and how soon.

Random missions of `sim.study.generator`, planned by guided; then D is set to 1.5 × the makespan of
that plan, so that a gap in J is not hidden by a long horizon, and lists are searched once more for
that D. Whatever time the search takes is its own; the bound begins with its lists.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from rich.console import RenderableType

from coordinator.planner.bound import meets, upper_bound
from coordinator.planner.options import after_time
from coordinator.planner.plan import better_lists, guided_plan
from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, Progress, size_name, table_of, unheard
from sim.study.generator import random_mission
from swarm.allocation import evaluate
from swarm.allocation.problem import Problem
from swarm.runtime.clock import Clock
from swarm.runtime.table import Column

HORIZON_MAKESPANS = 1.5


@dataclass(frozen=True, slots=True)
class BoundPoint:
    """When which bound was known."""

    seconds: float
    bound: float
    """[value·s]."""


@dataclass(frozen=True, slots=True)
class BoundMeasurement:
    """One mission."""

    size: str
    seed: int
    horizon_s: float
    objective: float
    """J of guided, or of better lists that were met while it was proven [value·s]."""
    bound: float
    """No lists have a larger J [value·s]."""
    gap: float
    """(bound - J) / J; 0 where the plan is proven optimal."""
    proven: bool
    """The bound meets the plan."""
    improved: float
    """By how much J of lists met during the proof is larger, as a share; they are then the plan."""
    seconds: float
    """Of the bound."""
    rounds: int
    trace: tuple[BoundPoint, ...]
    """Each lower bound when it was found."""


@dataclass(frozen=True, slots=True)
class BoundBench(BenchResult):
    """Everything measured in one run."""

    search_s: float
    """Time for guided, twice [s]."""
    limit_s: float
    """Time for the bound [s]."""
    bounds: tuple[BoundMeasurement, ...]

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield (
            f"D = {HORIZON_MAKESPANS:g} × the makespan of guided in {self.search_s:g} s; "
            f"{self.limit_s:g} s for each bound:"
        )
        yield table_of(
            self.bounds,
            Column("size", words=True, key="size"),
            Column("seed", key="seed"),
            Column("J [value·s]", ".1f", key="objective"),
            Column("bound", ".1f", key="bound"),
            Column("gap", lambda gap: f"{gap:.3%}", key="gap"),
            Column("proven", lambda proven: "optimal" if proven else "", words=True, key="proven"),
            Column("time [s]", ".2f", key="seconds"),
            Column("rounds", key="rounds"),
        )


def measure_bounds(
    sizes: Sequence[tuple[int, int]],
    seeds: Sequence[int],
    clock: Clock,
    *,
    search_s: float,
    limit_s: float,
    tell: Progress = unheard,
) -> BoundBench:
    """Plan and bound every mission, one after another."""
    machine = this_machine()
    bounds = []
    for n_uav, n_task in sizes:
        for seed in seeds:
            which = f"{size_name(n_uav, n_task)}, seed {seed}"
            tell(f"{which}: guided")
            problem, lists = _planned(n_uav, n_task, seed, clock, search_s)
            tell(f"{which}: bound")
            bounds.append(_bounded(problem, seed, lists, clock, limit_s))
    return BoundBench(machine, search_s, limit_s, tuple(bounds))


def _planned(
    n_uav: int, n_task: int, seed: int, clock: Clock, search_s: float
) -> tuple[Problem, Sequence[Sequence[int]]]:
    problem = random_mission(n_uav, n_task, seed)
    plan = guided_plan(problem, seed=seed, stop=after_time(clock, search_s))
    completion_s = evaluate(problem, plan.routes)[1]
    makespan_s = max(float(completion_s[task]) for route in plan.routes for task in route)
    problem = replace(problem, horizon_s=HORIZON_MAKESPANS * makespan_s)
    stop = after_time(clock, search_s)
    return problem, guided_plan(problem, seed=seed, stop=stop, lists=plan.routes).routes


def _bounded(
    problem: Problem, seed: int, lists: Sequence[Sequence[int]], clock: Clock, limit_s: float
) -> BoundMeasurement:
    objective = found = evaluate(problem, lists)[0]
    begin_s = clock.now_s()
    trace: list[BoundPoint] = []

    def note(bound: float) -> None:
        trace.append(BoundPoint(clock.now_s() - begin_s, bound))

    bound = upper_bound(problem, lists, after_time(clock, limit_s), progress=note)
    seconds = clock.now_s() - begin_s
    if bound.lists is not None:
        found = evaluate(problem, better_lists(problem, lists, bound.lists))[0]
    proven = meets(bound.objective, found)
    return BoundMeasurement(
        size=size_name(problem.n_uav, problem.n_task),
        seed=seed,
        horizon_s=problem.horizon_s,
        objective=found,
        bound=bound.objective,
        gap=0.0 if proven else bound.objective / found - 1.0,
        proven=proven,
        improved=found / objective - 1.0,
        seconds=seconds,
        rounds=bound.rounds,
        trace=tuple(trace),
    )
