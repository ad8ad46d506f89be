"""`swarm bench legs` flies a scenario by itself, and judges what was flown."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.process.pace import pace

pytestmark = [pytest.mark.process]


def test_a_scenario_is_flown_and_its_legs_are_set_beside_the_model() -> None:
    words = ["bench", "legs", "meadow", "--autopilot", "sim-px4", "--command", "mission,reposition"]
    done = subprocess.run(
        [sys.executable, "-m", "swarm", *words, "--speedup", f"{pace(10.0):g}", "--json"],
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)

    assert found["scenario"] == "meadow"
    flights = found["flights"]
    assert [flight["command"] for flight in flights] == ["mission", "reposition"]
    for flight in flights:
        assert (flight["limits"]["done"], flight["limits"]["tasks"]) == (6, 6)
        assert len(flight["legs"]) == 6
        assert flight["times"]["flown_frac"] > 0.9
        assert 0.5 < flight["clock_frac"] < 1.5
        assert flight["makespan_frac"] > 0.9
