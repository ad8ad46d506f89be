"""Plans fit vehicles whose acceleration only they know: they tell it before the first plan counts.

Vehicles of both flavours are slower to speed up than anybody's default, and the scenario says
nothing of it; so what is planned can be what is flown only if it was read from them.
"""

from __future__ import annotations

import json
import signal
import subprocess
from pathlib import Path

import pytest

from agent.vehicle.config import CommandStyle
from sim.bench.flown_legs import leg_times, legs_flown, makespan_frac
from swarm.scenario import load_scenario
from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.process.programs import Swarm
from tests.sitl.whole_run import MEADOW, TASKS, UAVS

pytestmark = [pytest.mark.sitl, pytest.mark.process]


@pytest.mark.timeout(480)
@pytest.mark.parametrize(
    ("flavour", "acceleration_m_s2", "style"),
    [
        ("ardupilot", 1.0, CommandStyle.MISSION),
        pytest.param("px4", 2.0, CommandStyle.REPOSITION, marks=pytest.mark.slow),
    ],
)
def test_legs_take_as_long_as_planned_by_the_vehicles_own_acceleration(
    tmp_path: Path, flavour: str, acceleration_m_s2: float, style: CommandStyle
) -> None:
    scenario, work = tmp_path / "meadow.toml", tmp_path / "work"
    work.mkdir()
    given = MEADOW.read_text().replace("schema = 1", "schema = 2")
    scenario.write_text(given.replace("speed_m_s = 8.0", "speed_m_s = 8.0\nendurance_s = 2000.0"))
    mission = load_scenario(scenario)
    assert "endurance_s" in mission.constraints
    assert "acceleration_m_s2" not in mission.constraints

    speedup = f"{pace(2.4):g}"  # a busy machine is late by seconds of its own, not of the mission
    slow = ["--flavour", flavour, "--acceleration-m-s2", f"{acceleration_m_s2:g}"]
    vehicles = Swarm(
        ["autopilot", str(scenario), "--json", "--speedup", speedup, *slow], stdout=subprocess.PIPE
    )
    try:
        assert vehicles.stdout is not None
        said = [json.loads(vehicles.stdout.readline()) for _ in UAVS]
        places = ",".join(f"{each['uav']}={each['url']}#{each['system_id']}" for each in said)
        words = [str(scenario), "--speedup", speedup, "--autopilot", places, "--command", style]
        with SwarmRun(words, work) as run:
            status, told = run.result(timeout_s=380.0)
            run.assert_nothing_left()
            story = run.story()
    finally:
        vehicles.send_signal(signal.SIGTERM)
        vehicles.wait(20)
        if vehicles.stdout is not None:
            vehicles.stdout.close()

    assert status == 0, story
    assert sorted(told["done"]) == TASKS, story
    read = {uav: each["acceleration_m_s2"] for uav, each in told["calibration"].items()}
    assert read == dict.fromkeys(UAVS, acceleration_m_s2), story
    times = leg_times(legs_flown(mission, told, "run"), None)
    unread = leg_times(legs_flown(mission, {**told, "calibration": {}}, "run"), None)
    makespan = makespan_frac(told)
    assert times is not None
    assert unread is not None
    assert makespan is not None
    assert 0.95 <= times.flown_frac <= 1.05, story
    assert makespan <= 1.08, story  # with what deciding and telling takes on a busy machine
    assert unread.flown_frac > 1.2, "the acceleration matters"
