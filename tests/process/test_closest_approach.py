"""What a run says of its closest approach is what anybody reads from the places it recorded."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from swarm.model import Mission, Task, TaskId, Uav, UavId
from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.process.test_secure_run import swarm, written
from tests.support.recorded_approach import closest_approach

pytestmark = [pytest.mark.process]


def crossing() -> Mission:
    """Four UAVs, each of which is able to do the one task that lies beyond all others' starts."""
    starts = ((-60.0, 0.0), (60.0, 0.0), (0.0, -60.0), (0.0, 60.0))
    return Mission(
        name="crossing",
        horizon_s=300.0,
        uavs=tuple(
            Uav(
                UavId(f"uav{number}"),
                (*start, 0.0),
                8.0,
                success={f"t{number}": 1.0},
                acceleration_m_s2=2.5,
            )
            for number, start in enumerate(starts)
        ),
        tasks=tuple(
            Task(TaskId(f"t{number}"), (-1.5 * east_m, -1.5 * north_m, 0.0), 5.0, service_s=2.0)
            for number, (east_m, north_m) in enumerate(starts)
        ),
        success_default=0.0,
        schema=2,
    )


def test_a_reader_of_its_recording_finds_the_same(tmp_path: Path) -> None:
    folder, file = tmp_path / "run", tmp_path / "run.mcap"
    folder.mkdir()
    words = [written(crossing(), tmp_path), "--speedup", f"{pace(4.0):g}", "--record", str(file)]
    with SwarmRun([*words, "--method", "greedy"], folder) as run:
        status, told = run.result()

    assert status == 0, run.story()
    read = closest_approach(file)
    assert read is not None
    distance_m, uavs, at_s = read
    assert told["closest_approach_m"] == pytest.approx(distance_m, abs=1e-6)
    near = told["closest_approach"]
    assert near["distance_m"] == told["closest_approach_m"]
    assert (tuple(near["uavs"]), near["at_s"]) == (uavs, pytest.approx(at_s, abs=1e-6))
    assert 0.0 < near["error_m"] < 20.0
    replayed = swarm("replay", str(file), "--final", "--json")
    assert replayed.returncode == 0, replayed.stderr
    assert json.loads(replayed.stdout)["closest_approach"] == near
