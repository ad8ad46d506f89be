from __future__ import annotations

from dataclasses import replace

import pytest

from sim.bench.plans import LONG_RUN, PlanBench, measure_plans, summaries
from sim.bench.solvers import METHODS, MissionSource, PlanningJob, PlanningRun, problem_of, run_job
from swarm.allocation import evaluate
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import SwarmError

SMALL = ("3×8", MissionSource(n_uav=3, n_task=8))


def in_process(job: PlanningJob) -> PlanningRun:
    return run_job(job, SystemClock())


def small_bench(long_run_s: float | None = None) -> PlanBench:
    names = ["guided", "nearest", "exact"]
    return measure_plans([SMALL], names, [0.05, 0.1], [0, 1], long_run_s=long_run_s, run=in_process)


def test_every_method_meets_every_mission_and_limit() -> None:
    told: list[str] = []
    bench = measure_plans(
        [SMALL], ["nearest", "cbba"], [0.1, 0.2], [0, 5], run=in_process, tell=told.append
    )
    keys = [(row.case, row.seed, row.method, row.limit_s) for row in bench.measured]
    assert len(keys) == len(set(keys)) == 8
    assert told[0] == "3×8, seed 0: nearest for up to 0.1 s"
    assert len(told) == 8


def test_ratios_are_to_the_best_on_the_same_mission() -> None:
    bench = small_bench()
    for seed in (0, 1):
        rows = [row for row in bench.measured if row.seed == seed]
        worths = [row.objective for row in rows if row.objective is not None]
        assert len(worths) == len(rows) == 6
        for row in rows:
            assert row.objective is not None
            assert row.ratio == pytest.approx(row.objective / max(worths))
            assert row.ratio_long is None
        problem = problem_of(MissionSource(n_uav=3, n_task=8, seed=seed))
        job = PlanningJob(MissionSource(n_uav=3, n_task=8, seed=seed), "nearest", 1.0, seed)
        nearest, _ = evaluate(problem, in_process(job).routes)
        assert {row.objective for row in rows if row.method == "nearest"} == {nearest}


def test_a_long_run_is_a_yardstick_of_its_own() -> None:
    bench = small_bench(long_run_s=0.1)
    long_runs = [row for row in bench.measured if row.method == LONG_RUN]
    assert [row.seed for row in long_runs] == [0, 1]
    assert all(row.ratio_long == 1.0 for row in long_runs)
    assert all(row.ratio_long is not None for row in bench.measured)


def test_a_method_that_does_not_fit_or_fails_says_so() -> None:
    def run(job: PlanningJob) -> PlanningRun:
        if job.method == "cbba":
            raise SwarmError("method cbba failed: of something")
        answer = in_process(job)
        return replace(answer, routes=[[], [], []]) if job.seed else answer

    source = ("3×30", MissionSource(n_uav=3, n_task=30))
    bench = measure_plans([source], ["exact", "cbba", "nearest"], [0.1], [0, 1], run=run)
    notes = {(row.method, row.seed): row.note for row in bench.measured}
    assert notes["exact", 0] == "too large to prove"
    assert notes["cbba", 0] == "method cbba failed: of something"
    assert notes["nearest", 1] == "no lists in time"
    assert [row.objective is None for row in bench.measured] == [True, True, False] + [True] * 3
    by_method = {summary.method: summary for summary in summaries(bench)}
    assert by_method["exact"].runs == 0
    assert by_method["exact"].ratio is None
    assert by_method["nearest"].runs == 1
    assert by_method["nearest"].note == "no lists in time"


def test_tasks_left_out_and_late_ones_are_counted() -> None:
    def run(job: PlanningJob) -> PlanningRun:
        answer = in_process(job)
        return replace(answer, routes=[answer.routes[0], [], []])

    tight = MissionSource(n_uav=3, n_task=8, horizon_s=1.0)
    row = measure_plans([("3×8", tight)], ["nearest"], [0.1], [0], run=run).measured[0]
    assert row.unassigned + row.late == 8
    assert row.unassigned > 0
    assert row.late > 0
    assert row.ratio is None  # of something negative


def test_summaries_are_over_seeds() -> None:
    bench = small_bench()
    found = summaries(bench)
    assert [(s.limit_s, s.method) for s in found] == [
        (limit_s, name) for limit_s in (0.05, 0.1) for name in ("guided", "nearest", "exact")
    ]
    for summary in found:
        rows = [
            row
            for row in bench.measured
            if (row.method, row.limit_s) == (summary.method, summary.limit_s)
        ]
        ratios = [row.ratio or 0.0 for row in rows]
        assert summary.ratio == pytest.approx(sum(ratios) / 2)
        assert summary.worst_ratio == min(ratios)
        assert summary.peak_bytes == max(row.peak_bytes for row in rows)
    assert {name for name in METHODS if METHODS[name].refusal is None} >= {"guided", "cbba"}
