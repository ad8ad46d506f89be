"""Exported plans, read and uploaded by MAVSDK and flown by the simulated autopilot alone.

MAVSDK knows nothing of this project: it takes the files for QGroundControl's.
"""

from __future__ import annotations

import asyncio
import json
import math
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from mavsdk.plugins.mission_raw import MissionItem

from sim.autopilot.config import Delays
from sim.autopilot.firmware import FirmwareModelName
from swarm.cli import main
from swarm.model.frames import Origin, enu_from_wgs84
from tests.sitl.test_mavsdk import CONFIG, FLAVOURS, Pilot, connected, start_mission, until

pytestmark = pytest.mark.sitl

COMMANDS = {"plan": EntryPoint("plan", "coordinator.cli:plan", "peckorder.commands")}
ORIGIN = Origin(47.0, 8.0, 400.0)
SCENARIO = """
schema = 1
name = "fields"
[mission]
horizon_s = 600.0
success_default = 0.9
[origin]
lat_deg = 47.0
lon_deg = 8.0
alt_m = 400.0
[[uav]]
id = "u1"
position_m = [10.0, 5.0]
speed_m_s = 12.0
[[task]]
id = "near"
position_m = [50.0, 5.0]
value = 3.0
service_s = 3.0
[[task]]
id = "north"
position_m = [50.0, 65.0, 4.0]
value = 2.0
[[task]]
id = "west"
position_m = [-30.0, 65.0]
value = 1.0
"""
START_M = (10.0, 5.0, 0.0)
TASKS_M = ((50.0, 5.0, 0.0), (50.0, 65.0, 4.0), (-30.0, 65.0, 0.0))
_WAYPOINT = 16


def exported(folder: Path, flavour: FirmwareModelName) -> Path:
    """The only plan of the scenario, made by the command line."""
    (folder / "fields.toml").write_text(SCENARIO, encoding="utf-8")
    plans = folder / "plans"
    asked = ["plan", str(folder / "fields.toml"), "--no-bound", "--firmware", flavour.value]
    assert main([*asked, "--export", str(plans)], COMMANDS) == 0
    return plans / "fields.u1.plan"


async def track(pilot: Pilot, places_m: list[tuple[float, float, float]]) -> None:
    """Note every place that MAVSDK hears of."""
    async for at in pilot.telemetry.subscribe_position():
        place = (at.latitude_deg, at.longitude_deg, at.absolute_altitude_m)
        places_m.append(enu_from_wgs84(ORIGIN, *place))


async def ready(pilot: Pilot) -> None:
    await until(
        pilot.telemetry.subscribe_health(),
        lambda health: (
            health.is_armable and health.is_global_position_ok and health.is_home_position_ok
        ),
    )


async def imported(pilot: Pilot, plan: Path) -> list[MissionItem]:
    """What MAVSDK makes of the file."""
    found = await pilot.mission.import_qgroundcontrol_mission(str(plan))
    assert (found.geofence_items, found.rally_items) == ([], [])
    return list(found.mission_items)


def visits(places_m: list[tuple[float, float, float]], layer_m: float) -> list[int]:
    """The tasks in the order in which the track first comes to them, in the height layer."""
    first: dict[int, int] = {}
    for step, place_m in enumerate(places_m):
        for task, (east_m, north_m, up_m) in enumerate(TASKS_M):
            if math.dist(place_m, (east_m, north_m, up_m + layer_m)) < 3.0:
                first.setdefault(task, step)
    return sorted(first, key=lambda task: first[task])


@FLAVOURS
def test_exported_plan_is_read_by_mavsdk_flown_in_order_and_ends_at_home(
    flavour: FirmwareModelName, tmp_path: Path
) -> None:
    plan = exported(tmp_path, flavour)
    layer_m = json.loads(plan.read_text(encoding="utf-8"))["peckorder"]["layer_m"]

    async def flight() -> None:
        where = replace(CONFIG, origin=ORIGIN, start_enu_m=START_M)
        async with connected(flavour, Delays(), where) as pilot:
            await ready(pilot)
            if flavour is FirmwareModelName.PX4:
                # It waits on the ground for the mission mode, ten times as fast as this test.
                await pilot.parameters.set_param_float("COM_DISARM_PRFLT", 300.0)
            items = await imported(pilot, plan)
            assert [item.param1 for item in items if item.command == _WAYPOINT][-3:] == [3, 0, 0]
            await pilot.mission.upload_mission(items)
            places_m: list[tuple[float, float, float]] = []
            tracking = asyncio.create_task(track(pilot, places_m))
            await pilot.action.arm()
            await start_mission(pilot)
            await until(pilot.telemetry.subscribe_in_air(), bool)
            await until(pilot.telemetry.subscribe_armed(), lambda armed: not armed)
            tracking.cancel()
            assert visits(places_m, layer_m) == [0, 1, 2]
            assert math.dist(places_m[-1], START_M) < 1.0

    asyncio.run(flight())
