"""Four UAVs that cross each other's ways through one point, kept apart in three layers."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.process.mission import SwarmRun
from tests.process.pace import pace

pytestmark = [pytest.mark.process]

_MISSION = """
schema = 2
name = "star"

[mission]
horizon_s = 600.0
separation_m = 10.0
band_m = [15.0, 40.0]
success_default = 0.0
"""
_UAV = """
[[uav]]
id = "uav{number}"
position_m = [{east_m:.1f}, {north_m:.1f}]
speed_m_s = 8.0
acceleration_m_s2 = 2.5

[uav.success]
t{number} = 1.0

[[task]]
id = "t{number}"
position_m = [{to_east_m:.1f}, {to_north_m:.1f}]
value = 1.0
service_s = 2.0
"""


def test_who_crosses_keeps_the_separation(tmp_path: Path) -> None:
    folder, scenario = tmp_path / "run", tmp_path / "star.toml"
    folder.mkdir()
    told = [_MISSION]
    for number in range(1, 5):
        east_m, north_m = math.cos(number * math.pi / 2.0), math.sin(number * math.pi / 2.0)
        told.append(
            _UAV.format(
                number=number,
                east_m=60.0 * east_m,
                north_m=60.0 * north_m,
                to_east_m=-50.0 * east_m,
                to_north_m=-50.0 * north_m,
            )
        )
    scenario.write_text("".join(told), encoding="utf-8")
    words = [str(scenario), "--method", "greedy", "--speedup", f"{pace(8.0):g}"]
    with SwarmRun(words, folder) as run:
        status, report = run.result()

    assert status == 0, run.story()
    assert report["open"] == report["failed"] == report["lost_uavs"] == []
    nearest = report["closest_approach"]
    assert report["separation_m"] == 10.0
    assert nearest["distance_m"] >= 10.0 - nearest["error_m"] - 1.0  # how well it knows its place
