from __future__ import annotations

import io
import json
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from rich.console import Console

from sim.bench.plan_report import (
    PlanReport,
    comparison_figure,
    comparison_grids,
    scaling_figure,
    scaling_grid,
    write_figure,
)
from sim.bench.plans import LONG_RUN, PlanBench, measure_plans
from sim.bench.solvers import MissionSource, PlanningJob, PlanningRun, run_job
from sim.study.baselines.ortools_routing import SHORTFALL
from swarm.runtime.clock import SystemClock
from swarm.runtime.table import ResultTable


def in_process(job: PlanningJob) -> PlanningRun:
    return run_job(job, SystemClock())


@pytest.fixture(scope="module")
def bench() -> PlanBench:
    sources = [(f"3×{n}", MissionSource(n_uav=3, n_task=n)) for n in (8, 20)]
    names = ["guided", "ortools", "exact"]
    return measure_plans(sources, names, [0.05, 0.1], [0, 1], long_run_s=0.1, run=in_process)


@pytest.fixture(scope="module")
def scaling() -> PlanBench:
    sources = [(f"3×{n}", MissionSource(n_uav=3, n_task=n)) for n in (8, 20)]
    return measure_plans(sources, ["guided", "greedy"], [0.1], [0], run=in_process)


def told(bench: PlanBench, grids: list[ResultTable], width: int = 80) -> str:
    stream = io.StringIO()
    Console(file=stream, width=width).print(PlanReport(bench.machine, bench, grids))
    return stream.getvalue()


def test_a_table_per_case_and_limit(bench: PlanBench) -> None:
    grids = comparison_grids(bench)
    assert [grid.title for grid in grids] == [
        "3×8, 0.05 s", "3×8, 0.1 s", "3×20, 0.05 s", "3×20, 0.1 s"
    ]  # fmt: skip
    for grid in grids:
        assert [row[0] for row in grid.rows] == ["guided", "ortools", "exact", LONG_RUN]
        assert {len(row) for row in grid.rows} == {len(grid.columns)}
    assert grids[0].cells()[2][1] == "1.0000"
    assert grids[2].cells()[2][1:-1] == ["–"] * 7
    assert grids[2].cells()[2][-1] == "too large to prove"


def test_without_a_long_run_nothing_is_compared_with_it(scaling: PlanBench) -> None:
    assert "J / long run" not in [each.name for each in comparison_grids(scaling)[0].columns]


def test_terminals_of_80_columns_show_all_figures(bench: PlanBench) -> None:
    text = told(bench, comparison_grids(bench))
    assert "…" not in text
    assert max(map(len, text.splitlines())) <= 80
    for part in ("J / long run", "time [s]", "MiB", "exact: too large to prove", "Seeds 0, 1"):
        assert part in text
    assert " ".join(SHORTFALL.split()) in " ".join(text.split())


def test_markdown_has_the_same_tables(bench: PlanBench) -> None:
    grids = comparison_grids(bench)
    text = PlanReport(bench.machine, bench, grids).as_markdown()
    assert text.count("| --- | --: |") == 4
    for grid in grids:
        assert f"**{grid.title}**" in text
        for row in grid.cells():
            assert "| " + " | ".join(row) + " |" in text
    assert SHORTFALL in text
    assert str(bench.machine) in text


def test_json_has_every_measurement(bench: PlanBench) -> None:
    said = json.loads(json.dumps(PlanReport(bench.machine, bench, ()).as_json(), allow_nan=False))
    assert len(said["measured"]) == len(bench.measured)
    assert said["machine"]["cores"] >= 1
    assert {"case", "ratio", "peak_bytes", "trace"} <= said["measured"][0].keys()
    assert SHORTFALL in said["notes"]


def test_scaling_tells_the_first_plan_and_memory(scaling: PlanBench) -> None:
    grid = scaling_grid(scaling)
    assert [row[:2] for row in grid.rows] == [
        ("3×8", "guided"), ("3×8", "greedy"), ("3×20", "guided"), ("3×20", "greedy")
    ]  # fmt: skip
    for row in grid.cells():
        assert 0.0 < float(row[3]) <= 1.0
        assert float(row[7]) > 1.0
    text = told(scaling, [grid])
    assert "…" not in text
    assert "3×8 guided: " in text
    assert SHORTFALL not in PlanReport(scaling.machine, scaling, [grid]).as_markdown()


def test_refused_sizes_stay_in_the_scaling_table() -> None:
    source = ("2×30", MissionSource(n_uav=2, n_task=30))
    grid = scaling_grid(measure_plans([source], ["exact"], [0.1], [0], run=in_process))
    assert grid.cells() == [["2×30", "exact", *["–"] * 6, "too large to prove"]]


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_plots_are_written(bench: PlanBench, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"value{suffix}"
    write_figure(comparison_figure(bench), path)
    assert path.stat().st_size > 1000


def test_value_is_drawn_against_time_limits_or_cases(bench: PlanBench, scaling: PlanBench) -> None:
    against_time = comparison_figure(bench)
    assert [axes.get_xlabel() for axes in against_time.axes] == ["time limit [s]"] * 2
    assert [axes.get_title(loc="left") for axes in against_time.axes] == ["3×8", "3×20"]
    against_size = comparison_figure(scaling).axes[0]
    assert [label.get_text() for label in against_size.get_xticklabels()] == ["3×8", "3×20"]
    assert len(against_size.get_lines()) == 2


def test_time_and_memory_are_drawn_against_size(scaling: PlanBench, tmp_path: Path) -> None:
    figure = scaling_figure(scaling)
    path = tmp_path / "scaling.png"
    write_figure(figure, path)
    assert matplotlib.image.imread(path).std() > 0.0
    for axes in figure.axes:
        assert [np.asarray(line.get_xdata()).tolist() for line in axes.get_lines()] == [[0, 1]] * 2
