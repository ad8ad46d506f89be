"""Plans of several methods side by side: same missions, same time, one after another.

Every list is scored here by eq. 1, whoever made it. Ratios are within this one run.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sim.bench.field_score import score_in_field
from sim.bench.machine import MachineInfo, this_machine
from sim.bench.results import Progress, unheard
from sim.bench.solvers import (
    MissionSource,
    PlanningJob,
    PlanningRun,
    TracePoint,
    any_problem_of,
    methods_for,
    run_in_subprocess,
)
from swarm.allocation import evaluate
from swarm.allocation.field import FieldProblem
from swarm.allocation.problem import Problem
from swarm.runtime.errors import SwarmError

LONG_RUN = "guided-long"
"""Name of the long run of ``guided`` that others may be compared with."""


@dataclass(frozen=True, slots=True)
class PlanMeasurement:
    """One method on one mission with one limit."""

    case: str
    """Size or scenario."""
    seed: int
    method: str
    limit_s: float
    objective: float | None = None
    """J [value·s]; None if there are no lists."""
    ratio: float | None = None
    """J over that of the best plan of all methods on this mission in this run, long run apart; in
    the field it may be above 1 where more is left out."""
    ratio_long: float | None = None
    """J over that of the long run; None without one."""
    unassigned: int = 0
    """Tasks on no list though some UAV is capable of them."""
    late: int = 0
    """Tasks completed after D, whose terms are negative."""
    left_out: int = 0
    """In the field: tasks without due_s that are not done. Fewer of them go before J."""
    broken: int = 0
    """In the field: tasks on its lists that could not be done there, and were dropped or moved."""
    elapsed_s: float = 0.0
    cpu_s: float = 0.0
    peak_bytes: int = 0
    base_bytes: int = 0
    trace: tuple[TracePoint, ...] = ()
    note: str = ""
    """What to know of it, or why there are no lists."""


@dataclass(frozen=True, slots=True)
class PlanBench:
    """Everything measured in one run."""

    machine: MachineInfo
    measured: tuple[PlanMeasurement, ...]
    field: bool = False
    """Whether the missions have the field's constraints; then all have."""


@dataclass(frozen=True, slots=True)
class MethodSummary:
    """One method over all seeds of a case and limit."""

    case: str
    limit_s: float
    method: str
    runs: int
    """Seeds with lists."""
    ratio: float | None
    """Mean over the seeds; None without lists."""
    worst_ratio: float | None
    ratio_long: float | None
    elapsed_s: float
    """Mean."""
    cpu_s: float
    """Mean."""
    peak_bytes: int
    """Largest."""
    unassigned: int
    """Largest."""
    late: int
    """Largest."""
    left_out: float
    """Mean."""
    broken: int
    """Largest."""
    note: str
    """Of the first seed."""


Runner = Callable[[PlanningJob], PlanningRun]


def measure_plans(
    sources: Sequence[tuple[str, MissionSource]],
    methods: Sequence[str],
    limits_s: Sequence[float],
    seeds: Sequence[int],
    *,
    long_run_s: float | None = None,
    run: Runner = run_in_subprocess,
    tell: Progress = unheard,
) -> PlanBench:
    """Run everything, one job at a time.

    Random missions are drawn anew for every seed. ``guided`` runs on every mission once more for
    ``long_run_s``, if there is one.
    """
    machine = this_machine()
    rows: list[PlanMeasurement] = []
    for case, source in sources:
        for seed in seeds:
            drawn = source if source.scenario is not None else replace(source, seed=seed)
            problem = any_problem_of(drawn)
            if not drawn.field:  # so that it need not be found out again
                drawn = replace(drawn, horizon_s=problem.horizon_s)
            here: list[PlanMeasurement] = []
            for limit_s in limits_s:
                for name in methods:
                    tell(f"{case}, seed {seed}: {name} for up to {limit_s:g} s")
                    job = PlanningJob(drawn, name, limit_s, seed)
                    here.append(_measured(case, problem, job, name, run))
            if long_run_s is not None:
                tell(f"{case}, seed {seed}: guided for {long_run_s:g} s")
                job = PlanningJob(drawn, "guided", long_run_s, seed)
                here.append(_measured(case, problem, job, LONG_RUN, run))
            rows += _with_ratios(here)
    return PlanBench(machine, tuple(rows), any(source.field for _, source in sources))


def summaries(bench: PlanBench) -> list[MethodSummary]:
    """Per case, limit and method, in the order measured; the long run comes last of its case."""
    groups: dict[tuple[str, float, str], list[PlanMeasurement]] = {}
    for row in bench.measured:
        groups.setdefault((row.case, row.limit_s, row.method), []).append(row)
    return [_summary(rows) for rows in groups.values()]


def _measured(
    case: str, problem: Problem | FieldProblem, job: PlanningJob, name: str, run: Runner
) -> PlanMeasurement:
    refusal = methods_for(job.source)[job.method].refusal
    refused = None if refusal is None else refusal(problem, job.limit_s)
    blank = PlanMeasurement(case, job.seed, name, job.limit_s, note=refused or "")
    if refused is not None:
        return blank
    try:
        answer = run(job)
    except SwarmError as error:
        return replace(blank, note=str(error))
    wanted = problem.capable.any(axis=0)
    if not any(answer.routes) and wanted.any():
        return replace(blank, elapsed_s=answer.elapsed_s, note="no lists in time")
    row = blank
    if isinstance(problem, FieldProblem):
        done = score_in_field(problem, answer.routes)
        objective, completion_s = done.objective, done.end_s
        row = replace(row, left_out=done.left_out, broken=done.broken)
    else:
        objective, completion_s = evaluate(problem, answer.routes)
    return replace(
        row,
        objective=objective,
        unassigned=int((wanted & np.isnan(completion_s)).sum()),
        late=int((completion_s > problem.horizon_s).sum()),
        elapsed_s=answer.elapsed_s,
        cpu_s=answer.cpu_s,
        peak_bytes=answer.peak_bytes,
        base_bytes=answer.base_bytes,
        trace=tuple(answer.trace),
        note=answer.note,
    )


def _with_ratios(rows: Sequence[PlanMeasurement]) -> list[PlanMeasurement]:
    """The rows of one mission, compared with each other."""
    worths = [
        (-r.left_out, r.objective) for r in rows if r.objective is not None and r.method != LONG_RUN
    ]
    long_runs = [r.objective for r in rows if r.method == LONG_RUN]
    best = max(worths)[1] if worths else None
    long_run = long_runs[0] if long_runs else None
    return [
        replace(row, ratio=_ratio(row.objective, best), ratio_long=_ratio(row.objective, long_run))
        for row in rows
    ]


def _ratio(worth: float | None, best: float | None) -> float | None:
    """Share of the best; None where the best is not positive and a share says nothing."""
    if worth is None or best is None or best <= 0.0:
        return None
    return worth / best


def _summary(rows: Sequence[PlanMeasurement]) -> MethodSummary:
    done = [row for row in rows if row.objective is not None]
    ratios = [row.ratio for row in done if row.ratio is not None]
    long_ratios = [row.ratio_long for row in done if row.ratio_long is not None]
    first = rows[0]
    return MethodSummary(
        case=first.case,
        limit_s=first.limit_s,
        method=first.method,
        runs=len(done),
        ratio=_mean(ratios),
        worst_ratio=min(ratios, default=None),
        ratio_long=_mean(long_ratios),
        elapsed_s=_mean([row.elapsed_s for row in done]) or 0.0,
        cpu_s=_mean([row.cpu_s for row in done]) or 0.0,
        peak_bytes=max((row.peak_bytes for row in done), default=0),
        unassigned=max((row.unassigned for row in rows), default=0),
        late=max((row.late for row in rows), default=0),
        left_out=_mean([row.left_out for row in done]) or 0.0,
        broken=max((row.broken for row in rows), default=0),
        note=next((row.note for row in rows if row.objective is None), first.note),
    )


def _mean(numbers: Sequence[float]) -> float | None:
    return sum(numbers) / len(numbers) if numbers else None
