"""Four UAVs that cross each other's ways through one point, kept apart in three layers.

What the run says of their closest approach is what anybody reads from the places it recorded.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.process.test_secure_run import swarm
from tests.support.recorded_approach import closest_approach

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


def test_who_crosses_keeps_the_separation_as_its_recording_shows(tmp_path: Path) -> None:
    folder, scenario, file = tmp_path / "run", tmp_path / "star.toml", tmp_path / "run.mcap"
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
    words += ["--record", str(file)]
    with SwarmRun(words, folder) as run:
        status, report = run.result()

    assert status == 0, run.story()
    assert report["open"] == report["failed"] == report["lost_uavs"] == []
    nearest = report["closest_approach"]
    assert report["separation_m"] == 10.0
    assert nearest["distance_m"] >= 10.0 - nearest["error_m"] - 1.0  # how well it knows its place

    read = closest_approach(file)
    assert read is not None
    distance_m, uavs, at_s = read
    assert report["closest_approach_m"] == pytest.approx(distance_m, abs=1e-6)
    assert nearest["distance_m"] == report["closest_approach_m"]
    assert (tuple(nearest["uavs"]), nearest["at_s"]) == (uavs, pytest.approx(at_s, abs=1e-6))
    assert 0.0 < nearest["error_m"] < 20.0
    replayed = swarm("replay", str(file), "--final", "--json")
    assert replayed.returncode == 0, replayed.stderr
    assert json.loads(replayed.stdout)["closest_approach"] == nearest
