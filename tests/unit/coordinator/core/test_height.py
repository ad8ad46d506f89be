"""Fleets so large that their height layers reach above what is allowed in many places."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from coordinator.core.heights import height_warning
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


@pytest.fixture
def scenario(tmp_path: Path) -> str:
    file = tmp_path / "large.toml"
    file.write_text(format_scenario(fleet(38)), encoding="utf-8")
    return str(file)


def test_the_thirty_eighth_uav_flies_too_high() -> None:
    assert height_warning(fleet(37), FlightLayers()) is None
    assert height_warning(fleet(38), FlightLayers()) == WARNING
    assert height_warning(fleet(50), FlightLayers(20.0, 2.0)) is None
    many = height_warning(fleet(60), FlightLayers(20.0, 2.0))
    assert many is not None
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
