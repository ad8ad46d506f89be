"""A square kilometre photographed by real processes, one UAV of which is lost on the way."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from swarm.scenario.files import resolve_scenario
from tests.process.mission import SwarmRun
from tests.process.pace import pace

pytestmark = [pytest.mark.process]


def test_who_is_lost_leaves_nothing_of_an_area_uncovered(tmp_path: Path) -> None:
    folder, scenario = tmp_path / "run", tmp_path / "hayfield.toml"
    folder.mkdir()
    text = resolve_scenario("hayfield").read_text(encoding="utf-8")
    # With less overlap half the lines do, and half the time.
    scenario.write_text(text.replace("sidelap_frac = 0.7", "sidelap_frac = 0.4"), encoding="utf-8")
    words = [str(scenario), "--method", "greedy", "--speedup", f"{pace(15.0):g}"]
    with SwarmRun(words, folder) as run:
        run.wait_for_line(": done", timeout_s=120.0, count=5)
        os.kill(run.child("agent", "uav3"), signal.SIGKILL)
        status, told = run.result()

    assert status == 0, run.story()
    assert told["lost_uavs"] == ["uav3"]
    assert told["open"] == told["failed"] == []
    area = told["areas"]["hay"]
    assert area["coverage_planned"] >= 0.995
    assert area["coverage_flown"] >= 0.995
    assert area["lines_flown"] == area["lines"] == len(told["done"])
    assert told["nearest_zone_m"] > 5.0  # of 10, as far as statuses tell at this speed
