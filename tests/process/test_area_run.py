"""A field photographed by real processes with batteries, one UAV of which is lost on the way."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from tests.process.mission import SwarmRun
from tests.process.pace import pace

pytestmark = [pytest.mark.process]

_UAV = """
[[uav]]
id = "uav{number}"
position_m = [{east_m}, -20.0]
speed_m_s = 10.0
acceleration_m_s2 = 2.5
endurance_s = 220.0
"""
_FIELD = """
schema = 2
name = "field"

[mission]
horizon_s = 600.0
zone_margin_m = 5.0

[[base]]
id = "barn"
position_m = [60.0, -40.0]
swap_s = 10.0

[[zone]]
id = "pond"
polygon_m = [[60.0, 90.0], [90.0, 90.0], [90.0, 120.0], [60.0, 120.0]]

[[area]]
id = "hay"
polygon_m = [[0.0, 0.0], [220.0, 10.0], [200.0, 200.0], [10.0, 190.0]]
holes_m = [[[150.0, 60.0], [190.0, 60.0], [170.0, 110.0]]]
value = 10.0
spacing_m = 24.0
heading_deg = 0.0
"""


def test_who_is_lost_leaves_nothing_of_an_area_uncovered(tmp_path: Path) -> None:
    folder, scenario = tmp_path / "run", tmp_path / "field.toml"
    folder.mkdir()
    uavs = (_UAV.format(number=n, east_m=20.0 * n) for n in (1, 2, 3))
    scenario.write_text("".join([_FIELD, *uavs]), encoding="utf-8")
    words = [str(scenario), "--method", "greedy", "--speedup", f"{pace(5.0):g}"]
    with SwarmRun(words, folder) as run:
        run.wait_for_line(": done", timeout_s=120.0, count=3)
        os.kill(run.child("agent", "uav3"), signal.SIGKILL)
        status, told = run.result()

    assert status == 0, run.story()
    assert told["lost_uavs"] == ["uav3"]
    assert told["open"] == told["failed"] == []
    area = told["areas"]["hay"]
    assert area["coverage_planned"] >= 0.995
    assert area["coverage_flown"] >= 0.995
    assert area["lines_flown"] == area["lines"] == len(told["done"])
    assert told["nearest_zone_m"] > 2.0  # of 5, as far as statuses tell at this speed
