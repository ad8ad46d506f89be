"""Zones that are drawn and taken away in flight, with the vehicles' own fence behind them.

One is drawn across the way that is being flown, with a task inside, one over a UAV that flies, and
both are taken away again: then the task in the midst of what is a zone no more is flown. Real
firmware flies where SWARM_SITL_ARDUCOPTER or SWARM_SITL_PX4 says where it is, else the simulated
autopilot in that flavour.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from agent.vehicle.config import CommandStyle
from sim.fleet.firmware import FirmwareKind
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from tests.process.mission import SwarmRun, wait_until
from tests.process.pace import pace
from tests.process.test_secure_run import swarm, written
from tests.sitl.whole_run import autopilot_of, by_day

pytestmark = [pytest.mark.sitl, pytest.mark.process]

MISSION = "lake"
SPEEDUP = 4.0
LAKE = ((80.0, -50.0), (115.0, -50.0), (115.0, 60.0), (80.0, 60.0))
PLACES = {"far": (220.0, 0.0), "lake": (97.0, 5.0), "west": (-180.0, 20.0), "north": (0.0, 180.0)}
LATER_S = {"lake": 90.0, "north": 120.0}
OVER_M = 20.0
"""Half the side of the zone that is drawn over a UAV."""
FLIGHTS = by_day(FirmwareKind.PX4, CommandStyle.MISSION)


def meadow_with_a_lake() -> Mission:
    """Two UAVs and four tasks; two of them can be done later only.

    One is in the lake, and another one keeps the mission from ending while that one is left out.
    """
    uavs = [
        Uav(UavId(f"uav{number + 1}"), (-20.0 * number, 0.0, 0.0), 8.0, acceleration_m_s2=2.5)
        for number in range(2)
    ]
    tasks = [
        Task(
            TaskId(name),
            (*place, 0.0),
            5.0,
            service_s=15.0,
            opens_s=LATER_S.get(name, 0.0),
        )
        for name, place in PLACES.items()
    ]
    return Mission(
        name=MISSION,
        horizon_s=900.0,
        uavs=tuple(uavs),
        tasks=tuple(tasks),
        origin=Origin(46.8, 9.7, 1100.0),
        zone_margin_m=5.0,
    )


def status() -> dict[str, Any]:
    said = swarm("status", "--mission", MISSION, "--json")
    return dict(json.loads(said.stdout)) if said.returncode == 0 else {}


def flying_to(run: SwarmRun, task: str) -> tuple[dict[str, Any], list[str]]:
    """What is told of the UAV that claims a task, once it is on its way there, and of zones."""
    starts = {uav.id: uav.position_enu_m for uav in meadow_with_a_lake().uavs}
    found: list[tuple[dict[str, Any], list[str]]] = []

    def on_its_way() -> bool:
        told = status()
        for uav in told.get("uavs", ()):
            place = uav["position_enu_m"]
            if uav["task"] == task and place and math.dist(place[:2], starts[uav["id"]][:2]) > 20.0:
                found.append((uav, told["zones"]))
        return bool(found)

    wait_until(on_its_way, 60.0, f"a UAV flies to {task}\n{run.story()}")
    return found[0]


def obeyed(*words: str) -> bool:
    done = swarm("zone", *words, "--mission", MISSION, "--json")
    assert done.returncode == 0, done.stderr
    return bool(json.loads(done.stdout)["obeyed"])


@pytest.mark.parametrize(("kind", "style"), FLIGHTS)
def test_zones_are_heeded_while_they_are_there_and_flown_through_afterwards(
    tmp_path: Path,
    kind: FirmwareKind,
    style: CommandStyle,
    record_property: Callable[[str, object], None],
) -> None:
    autopilot, mission = autopilot_of(kind), meadow_with_a_lake()
    record_property("flown", f"{autopilot.option}, {'real' if autopilot.real else 'simulated'}")
    speedup = 1.0 if autopilot.real else pace(SPEEDUP)
    words = [written(mission, tmp_path), "--autopilot", autopilot.option, "--command", style]
    words += ["--speedup", f"{speedup:g}"]
    folder = tmp_path / "run"
    folder.mkdir()
    with SwarmRun(words, folder) as run:
        run.wait_for_line("epoch 1", timeout_s=150.0)
        flying_to(run, "far")
        assert obeyed("add", "lake", "--polygon", *(f"{x:g},{y:g}" for x, y in LAKE))
        uav, zones = flying_to(run, "west")
        assert zones == ["lake"]
        east_m, north_m, _ = uav["position_enu_m"]
        over = [
            f"{east_m + east * OVER_M:g},{north_m + north * OVER_M:g}"
            for east, north in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        assert obeyed("add", "over", "--polygon", *over)
        run.wait_for_line("ended far", timeout_s=150.0)
        assert obeyed("remove", "over")
        assert obeyed("remove", "lake")
        ended, told = run.result(timeout_s=400.0)
        run.assert_nothing_left()

    assert ended == 0, run.story()
    assert sorted(told["done"]) == sorted(PLACES), run.story()
    assert told["failed"] == told["open"] == [], run.story()
    assert told["lost_uavs"] == [], run.story()
    assert told["processes"] == [], run.story()
    assert "handed" not in run.story(), run.story()
