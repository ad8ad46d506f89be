"""Methods side by side under the field's constraints."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sim.bench.field_methods import FIELD_METHODS, bench_problem, index_lists
from sim.bench.field_score import score_in_field
from sim.bench.plan_report import PlanReport, comparison_grids
from sim.bench.plans import PlanBench, measure_plans
from sim.bench.solvers import MissionSource, PlanningJob, PlanningRun, run_in_subprocess, run_job
from swarm.allocation.field import FieldState
from swarm.cli import main
from swarm.kernels.field import fly_lists
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import InputError
from swarm.scenario import format_scenario
from tests.support.area_missions import paddock

SMALL = ("4×16", MissionSource(n_uav=4, n_task=16, field=True))


def in_process(job: PlanningJob) -> PlanningRun:
    return run_job(job, SystemClock())


@pytest.fixture(scope="module")
def bench() -> PlanBench:
    return measure_plans([SMALL], list(FIELD_METHODS), [0.3], [0, 1], run=in_process)


def test_a_mission_in_which_nobody_can_do_anything_is_refused() -> None:
    with pytest.raises(InputError, match="--sizes: 2x2: nobody can do anything in the mission of"):
        bench_problem(2, 2, 0)


def test_every_method_makes_lists_that_our_evaluator_flies(bench: PlanBench) -> None:
    assert [row.method for row in bench.measured] == 2 * list(FIELD_METHODS)
    for row in bench.measured:
        assert row.objective is not None, row.note
        assert row.objective > 0.0
        assert row.left_out == row.unassigned < 16
        if not row.method.startswith("ortools"):
            assert row.broken == 0


def test_plans_compare_by_what_is_left_out_first(bench: PlanBench) -> None:
    for seed in (0, 1):
        rows = [row for row in bench.measured if row.seed == seed]
        best = min(rows, key=lambda row: (row.left_out, -(row.objective or 0.0)))
        assert best.ratio == 1.0
        assert best.method.startswith("guided")


def test_figures_are_of_the_missions_that_are_said(bench: PlanBench) -> None:
    problem = bench_problem(4, 16, 1)
    assert np.ptp(problem.weight, axis=0).max() == 0.0
    assert not problem.slots.any()
    lists = index_lists(problem, "value-per-time")
    flown = fly_lists(problem.kernel, FieldState.at_start(problem), lists)
    row = next(r for r in bench.measured if (r.method, r.seed) == ("value-per-time", 1))
    assert row.objective == float(flown.value.sum())


def test_lists_that_cannot_be_flown_get_other_visits_and_lose_few_tasks() -> None:
    problem = bench_problem(4, 16, 0)
    lists = index_lists(problem, "value-per-time")
    good = score_in_field(problem, lists)
    assert good.broken == 0
    without = [[item for item in items if item >= 0] for items in lists]

    found = score_in_field(problem, without)

    assert found.broken > 0
    assert found.left_out == good.left_out
    assert found.objective >= good.objective - 1e-9


def test_what_it_says_fits_a_terminal(bench: PlanBench) -> None:
    stream = io.StringIO()
    Console(file=stream, width=80).print(PlanReport(bench.machine, bench, comparison_grids(bench)))
    text = stream.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    for part in ("left out", "broken", "guided-1-thread", "Random missions in the field"):
        assert part in text


def test_a_scenario_of_the_field_is_planned_by_methods_that_heed_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = tmp_path / "paddock.toml"
    scenario.write_text(format_scenario(paddock(endurance_s=100.0, slots=1)), "utf-8")
    methods = ["guided-1-thread", "value-per-time", "ortools"]
    options = ["--methods", ",".join(methods), "--time-limit-s", "0.2", "--seeds", "0"]

    assert main(["bench", "plan", str(scenario), *options, "--json"]) == 0

    rows = json.loads(capsys.readouterr().out)["measured"]
    assert [(row["case"], row["method"]) for row in rows] == [("paddock", name) for name in methods]
    assert [row["left_out"] for row in rows[:2]] == [0, 0]
    assert rows[0]["ratio"] == 1.0
    assert "slots" in rows[2]["note"]
    assert main(["bench", "plan", str(scenario), *options]) == 0
    said = capsys.readouterr().out
    assert "In the field plans compare by" in said
    assert "Random missions" not in said


def test_a_job_in_the_field_is_done_in_a_process_of_its_own() -> None:
    job = PlanningJob(
        MissionSource(n_uav=2, n_task=6, seed=3, field=True), "value-per-time", 1.0, 3
    )
    assert run_in_subprocess(job).routes == run_job(job, SystemClock()).routes
