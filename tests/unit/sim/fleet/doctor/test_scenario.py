"""What the doctor says of a scenario."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from sim.fleet.doctor.finding import CheckState
from sim.fleet.doctor.inputs import check_scenario
from swarm.model import Mission, Origin, Uav, UavId
from swarm.scenario.write import format_scenario
from tests.support.builders import mission, task


def written(folder: Path, flown: Mission) -> Path:
    file = folder / "scenario.toml"
    file.write_text(format_scenario(flown), encoding="utf-8")
    return file


def test_a_sound_scenario_and_one_without_an_origin(tmp_path: Path) -> None:
    flown = mission([Uav(UavId("u0"), (0.0, 0.0, 0.0), 10.0)], [task("t0", 5.0)])
    placed = replace(flown, origin=Origin(46.8, 9.7, 1100.0))

    assert [each.state for each in check_scenario(written(tmp_path, placed))[1]] == [CheckState.OK]
    assert [each.state for each in check_scenario(written(tmp_path, flown))[1]] == [
        CheckState.WARNING
    ]


def test_a_fleet_whose_height_layers_reach_too_high(tmp_path: Path) -> None:
    uavs = [Uav(UavId(f"u{n}"), (10.0 * n, 0.0, 0.0), 10.0) for n in range(38)]

    found = check_scenario(written(tmp_path, mission(uavs, [task("t0", 5.0)], horizon_s=1e4)))[1]

    height = next(each for each in found if each.check == "height")
    assert height.state is CheckState.WARNING
    assert height.text.startswith("the highest of 38 height layers is 121 m up, and 1 UAV flies")
    assert height.remedy.startswith("fly fewer UAVs")
