"""A plan as QGroundControl plans (``.plan``), one for every UAV that has tasks.

Take-off into the UAV's height layer, cruise speed, one waypoint per task with its service as hold
time, return to launch. Heights are above the UAV's start, which is the home of its plan.
There are no geofences and no rally points.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from enum import Enum
from pathlib import Path

from swarm.model import Mission, Origin, Plan, Task, Uav
from swarm.model.frames import wgs84_from_enu
from swarm.model.layers import FlightLayers
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.task_files.mission_items import MavCommand, MavFrame
from swarm.scenario.task_files.plan_file import LAYER_KEY

_QUADROTOR = 2
_RELATIVE = 1
_GROUND_SPEED = 1
_THROTTLE_AS_IT_IS = -1


class ExportFirmware(Enum):
    """Firmware that a plan is made for; QGroundControl warns of a plan for another."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


_AUTOPILOT = {ExportFirmware.ARDUPILOT: 3, ExportFirmware.PX4: 12}
"""MAV_AUTOPILOT."""


def require_origin(mission: Mission, source: str) -> Origin:
    """The origin of ``mission``.

    Raises:
        InputError: the scenario names none, so nobody knows where on Earth its places are.
    """
    if mission.origin is None:
        remedy = "add a table [origin] with lat_deg, lon_deg and alt_m"
        raise InputError(Fault(source, "origin", "is missing, and --export needs it", remedy))
    return mission.origin


def write_plans(folder: Path, mission: Mission, plan: Plan, firmware: ExportFirmware) -> list[Path]:
    """Write ``<mission>.<uav>.plan`` into ``folder`` for every UAV that has tasks.

    A UAV without tasks gets none, and loses the one of an earlier plan.

    Raises:
        InputError: the mission has no origin.
        OSError: a file cannot be written.
    """
    origin = require_origin(mission, mission.name)
    folder.mkdir(parents=True, exist_ok=True)
    layers = FlightLayers()
    tasks = {task.id: task for task in mission.tasks}
    written = []
    for index, uav in enumerate(mission.uavs):
        path = folder / f"{mission.name}.{uav.id}.plan"
        route = [tasks[task] for task in plan.routes[uav.id]]
        if not route:
            path.unlink(missing_ok=True)
            continue
        document = uav_plan(uav, route, origin, layers.layer_m(index), firmware)
        path.write_text(json.dumps(document, indent=4, allow_nan=False) + "\n", encoding="utf-8")
        written.append(path)
    return written


def uav_plan(
    uav: Uav, route: Sequence[Task], origin: Origin, layer_m: float, firmware: ExportFirmware
) -> dict[str, object]:
    """The plan of one UAV, ready for `json.dumps`; ``layer_m`` above the places it visits [m]."""
    home_alt_m = origin.alt_m + uav.position_enu_m[2]
    return {
        "fileType": "Plan",
        "geoFence": {"circles": [], "polygons": [], "version": 2},
        "groundStation": "Peckorder",
        "mission": {
            "cruiseSpeed": uav.speed_m_s,
            "firmwareType": _AUTOPILOT[firmware],
            "globalPlanAltitudeMode": _RELATIVE,
            "hoverSpeed": uav.speed_m_s,
            "items": [
                {**item, "autoContinue": True, "doJumpId": number, "type": "SimpleItem"}
                for number, item in enumerate(_items(uav, route, origin, layer_m), start=1)
            ],
            "plannedHomePosition": [*_lat_lon_deg(origin, uav.position_enu_m), home_alt_m],
            "vehicleType": _QUADROTOR,
            "version": 2,
        },
        LAYER_KEY: {"layer_m": layer_m},
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }


def _lat_lon_deg(origin: Origin, point_enu_m: tuple[float, float, float]) -> tuple[float, float]:
    lat_deg, lon_deg, _ = wgs84_from_enu(origin, point_enu_m)
    if abs(lon_deg) > 180.0:  # beyond the date line
        lon_deg -= math.copysign(360.0, lon_deg)
    return lat_deg, lon_deg


def _items(
    uav: Uav, route: Sequence[Task], origin: Origin, layer_m: float
) -> Iterator[dict[str, object]]:
    def place(point_enu_m: tuple[float, float, float]) -> tuple[float, float, float]:
        """Latitude, longitude [deg] and height above the UAV's start [m], in its layer."""
        height_m = point_enu_m[2] - uav.position_enu_m[2] + layer_m
        return *_lat_lon_deg(origin, point_enu_m), height_m

    yield _at(MavCommand.TAKEOFF, 0.0, place(uav.position_enu_m))
    speed = [_GROUND_SPEED, uav.speed_m_s, _THROTTLE_AS_IT_IS, 0, 0, 0, 0]
    yield {"command": int(MavCommand.CHANGE_SPEED), "frame": int(MavFrame.MISSION), "params": speed}
    for task in route:
        yield _at(MavCommand.WAYPOINT, task.service_s, place(task.position_enu_m))
    home = {"command": int(MavCommand.RETURN_TO_LAUNCH), "frame": int(MavFrame.MISSION)}
    yield {**home, "params": [0] * 7}


def _at(command: MavCommand, first: float, place: tuple[float, float, float]) -> dict[str, object]:
    """An item at a place; no heading, so the vehicle keeps to its own setting."""
    return {
        "AMSLAltAboveTerrain": None,
        "Altitude": place[2],
        "AltitudeMode": _RELATIVE,
        "command": int(command),
        "frame": int(MavFrame.GLOBAL_RELATIVE),
        "params": [first, 0, 0, None, *place],
    }
