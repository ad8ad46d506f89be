"""A plan as QGroundControl plans (``.plan``), one for every sortie of every UAV that has tasks.

Take-off into the UAV's height layer, cruise speed, its tasks, and the way back: return to launch,
over hills a landing there, or one at the base where a battery is changed, from which its next plan
takes off. Zones are
the geofence as far as they lie in the way at every height that it flies at. Heights are above the
place of take-off, which is the home of the plan. There are no rally points.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from coordinator.sorties import SortieItems, sorties_of
from swarm.model import Mission, Origin, Plan, Zone, ZoneId
from swarm.model.fence_rings import blocks_all_heights, fence_rings
from swarm.model.frames import wgs84_from_enu
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.task_files.plan_file import LAYER_KEY
from swarm.separation.fleet_layers import fleet_layers_m

_QUADROTOR = 2
_RELATIVE = 1
_HEEDED = frozenset(
    {
        "acceleration_m_s2",
        "airspeed_m_s",
        "endurance_s",
        "due_s",
        "opens_s",
        "closes_s",
        "path_m",
        "trigger_m",
        "height_m",
        "wind_m_s",
        "base",
        "zone",
        "band_m",
        "terrain",
        "separation_m",
    }
)
"""What a mission may ask for, by the keys of a scenario."""


class ExportFirmware(Enum):
    """Firmware that a plan is made for; QGroundControl warns of a plan for another."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


_AUTOPILOT = {ExportFirmware.ARDUPILOT: 3, ExportFirmware.PX4: 12}
"""MAV_AUTOPILOT."""


@dataclass(frozen=True, slots=True)
class Exported:
    """What has been written."""

    files: Sequence[Path]
    unfenced: Sequence[ZoneId]
    """Zones that are part of no geofence: a vehicle may fly above or below them."""


def require_origin(mission: Mission, source: str) -> Origin:
    """The origin of ``mission``.

    Raises:
        InputError: the scenario names none, so nobody knows where on Earth its places are.
    """
    if mission.origin is None:
        remedy = "add a table [origin] with lat_deg, lon_deg and alt_m"
        raise InputError(Fault(source, "origin", "is missing, and --export needs it", remedy))
    return mission.origin


def require_exportable(mission: Mission, source: str) -> None:
    """Refuse a mission that asks for more than a plan of QGroundControl is given.

    Raises:
        InputError: with what that is.
    """
    if asked := [key for key in mission.constraints if key not in _HEEDED]:
        problem = f"asks for {', '.join(asked)}, which exported plans do not heed"
        raise InputError(Fault(source, "", problem, "plan without --export"))


def write_plans(folder: Path, mission: Mission, plan: Plan, firmware: ExportFirmware) -> Exported:
    """Write ``<mission>.<uav>.plan`` into ``folder`` for every UAV that has tasks.

    Its sorties from the second on are in ``<mission>.<uav>.sortie2.plan`` and so on. Files of
    earlier plans that are not written again go.

    Raises:
        InputError: the mission has no origin.
        OSError: a file cannot be written.
    """
    origin = require_origin(mission, mission.name)
    folder.mkdir(parents=True, exist_ok=True)
    layers_m = fleet_layers_m(mission)
    written: list[Path] = []
    unfenced: dict[ZoneId, None] = {}
    for index, uav in enumerate(mission.uavs):
        sorties = sorties_of(mission, plan, uav)
        for number, sortie in enumerate(sorties, start=1):
            items = SortieItems(sortie, uav, layers_m[index], origin, mission.terrain)
            zones = [zone for zone in mission.zones if not _blocks(zone, items)]
            unfenced |= dict.fromkeys(zone.id for zone in zones)
            document = sortie_plan(items, mission.zones, firmware)
            path = folder / _name(mission, uav.id, number)
            text = json.dumps(document, indent=4, allow_nan=False) + "\n"
            path.write_text(text, encoding="utf-8")
            written.append(path)
        number = len(sorties) + 1
        while (stale := folder / _name(mission, uav.id, number)).exists() or number == 1:
            stale.unlink(missing_ok=True)
            number += 1
    return Exported(written, tuple(unfenced))


def _name(mission: Mission, uav: str, number: int) -> str:
    sortie = "" if number == 1 else f".sortie{number}"
    return f"{mission.name}.{uav}{sortie}.plan"


def sortie_plan(
    items: SortieItems, zones: Sequence[Zone], firmware: ExportFirmware
) -> dict[str, object]:
    """The plan of one sortie, ready for `json.dumps`."""
    uav, origin = items.uav, items.origin
    listed, tasks = items.listed()
    home_alt_m = origin.alt_m + items.sortie.start_enu_m[2]
    remembered: dict[str, object] = {"layer_m": items.layer_m}
    if items.terrain is None:  # else heights of items are not those that tasks ask for
        remembered["tasks"] = [task.as_json() for task in tasks]
    return {
        "fileType": "Plan",
        "geoFence": {
            "circles": [],
            "polygons": list(_polygons([each for each in zones if _blocks(each, items)], origin)),
            "version": 2,
        },
        "groundStation": "Peckorder",
        "mission": {
            "cruiseSpeed": uav.speed_m_s,
            "firmwareType": _AUTOPILOT[firmware],
            "globalPlanAltitudeMode": _RELATIVE,
            "hoverSpeed": uav.speed_m_s,
            "items": [
                {**item, "autoContinue": True, "doJumpId": number, "type": "SimpleItem"}
                for number, item in enumerate(listed, start=1)
            ],
            "plannedHomePosition": [*items.lat_lon_deg(items.sortie.start_enu_m), home_alt_m],
            "vehicleType": _QUADROTOR,
            "version": 2,
        },
        LAYER_KEY: remembered,
        "rallyPoints": {"points": [], "version": 2},
        "version": 1,
    }


def _blocks(zone: Zone, items: SortieItems) -> bool:
    """Whether a zone may be part of the geofence of who flies these items, take-off included."""
    return blocks_all_heights(zone, *items.height_range_m())


def _polygons(zones: Sequence[Zone], origin: Origin) -> Iterator[dict[str, object]]:
    for zone in zones:
        for ring in fence_rings(zone):
            corners = [_corner_deg(origin, corner) for corner in ring.corners_enu_m]
            yield {"inclusion": ring.inclusive, "polygon": corners, "version": 1}


def _corner_deg(origin: Origin, corner_enu_m: tuple[float, float]) -> list[float]:
    lat_deg, lon_deg, _ = wgs84_from_enu(origin, (*corner_enu_m, 0.0))
    if abs(lon_deg) > 180.0:  # beyond the date line
        lon_deg -= math.copysign(360.0, lon_deg)
    return [lat_deg, lon_deg]
