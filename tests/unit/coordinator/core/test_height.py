"""What is said of heights: layers above what is allowed in many places, tasks that share one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from coordinator.core.heights import height_warnings
from swarm.cli import main
from swarm.model import Mission, Uav, UavId
from swarm.model.layers import FlightLayers
from swarm.scenario.write import format_scenario
from tests.support.builders import mission, task

WARNING = (
    "the highest of 38 height layers is 121 m up, and 1 UAV flies above 120 m, which many "
    "countries forbid: fly fewer UAVs, or let swarm coordinator lower --layer-spacing-m or "
    "--lowest-layer-m"
)


def fleet(n_uav: int) -> Mission:
    uavs = [Uav(UavId(f"u{n}"), (10.0 * n, 0.0, 0.0), 10.0) for n in range(n_uav)]
    return replace(mission(uavs, [task("t0", 5.0)], horizon_s=1e4), name="large")


def lines(*heights_m: float | None, n_uav: int = 2, separation_m: float | None = None) -> Mission:
    tasks = [replace(task(f"t{n}", 5.0), height_m=up_m) for n, up_m in enumerate(heights_m)]
    return replace(fleet(n_uav), tasks=tuple(tasks), separation_m=separation_m)


SHARED = (
    "2 tasks have a height_m of their own, such as 60 m, where no layers keep UAVs apart: "
    "give [mission] separation_m"
)


def test_tasks_that_share_a_height_of_their_own_let_uavs_meet() -> None:
    assert height_warnings(lines(60.0, None, 58.0), FlightLayers()) == (SHARED,)
    assert height_warnings(lines(60.0, 60.0), FlightLayers(spacing_m=0.0)) == (SHARED,)


@pytest.mark.parametrize(
    "flown",
    [
        lines(60.0, None),
        lines(60.0, 70.0),
        lines(60.0, 60.0, n_uav=1),
        lines(60.0, 60.0, separation_m=5.0),
    ],
)
def test_tasks_at_heights_apart_of_one_uav_or_with_a_separation_do_not(flown: Mission) -> None:
    assert height_warnings(flown, FlightLayers()) == ()


def test_a_simulation_says_so_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "lines.toml"
    file.write_text(format_scenario(replace(lines(60.0, 60.0), name="lines")), encoding="utf-8")
    assert main(["simulate", str(file), "--json"]) == 0

    assert capsys.readouterr().err.splitlines() == [f"warning: {SHARED}"]


@pytest.fixture
def scenario(tmp_path: Path) -> str:
    file = tmp_path / "large.toml"
    file.write_text(format_scenario(fleet(38)), encoding="utf-8")
    return str(file)


def test_the_thirty_eighth_uav_flies_too_high() -> None:
    assert height_warnings(fleet(37), FlightLayers()) == ()
    assert height_warnings(fleet(38), FlightLayers()) == (WARNING,)
    assert height_warnings(fleet(50), FlightLayers(20.0, 2.0)) == ()
    (many,) = height_warnings(fleet(60), FlightLayers(20.0, 2.0))
    assert many.startswith(
        "the highest of 60 height layers is 138 m up, and 9 UAVs fly above 120 m"
    )


def test_a_plan_says_so_in_one_line(scenario: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", scenario, "--method", "greedy", "--time-limit-s", "0", "--json"]) == 0

    out, err = capsys.readouterr()
    assert json.loads(out)["scenario"] == "large"
    assert err.splitlines() == [f"warning: {WARNING}"]


def test_a_coordinator_says_so_in_its_log(
    scenario: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["coordinator", scenario, "--check", "--log-format", "json"]) == 0

    (line,) = [json.loads(line) for line in capsys.readouterr().err.splitlines() if "{" in line]
    assert (line["level"], line["event"]) == ("warning", WARNING)
