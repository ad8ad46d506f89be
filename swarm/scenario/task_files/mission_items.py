"""Items of a MAVLink mission, as ground stations store them, and the tasks they become.

A waypoint is where a vehicle flies; a task is what it flies over. So a task lies
as far below its waypoint as the lowest height layer lies above tasks: the first
UAV then flies at the height planned, and every other one a layer higher.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from swarm.model import Origin
from swarm.runtime.errors import Fault
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.task_file import FileTask

BELOW_M = 10.0
"""How far a task lies below its waypoint [m]: the coordinator's lowest layer unless told."""


class MavCommand(IntEnum):
    """MAV_CMD, as far as it matters here."""

    WAYPOINT = 16
    LOITER_UNLIMITED = 17
    LOITER_TURNS = 18
    LOITER_TIME = 19
    RETURN_TO_LAUNCH = 20
    LAND = 21
    TAKEOFF = 22
    LOITER_TO_ALTITUDE = 31
    SPLINE_WAYPOINT = 82
    CHANGE_SPEED = 178


class MavFrame(IntEnum):
    """MAV_FRAME, as far as it matters here."""

    GLOBAL = 0
    """Height above mean sea level."""
    MISSION = 2
    """No place at all."""
    GLOBAL_RELATIVE = 3
    """Height above home."""
    GLOBAL_INT = 5
    GLOBAL_RELATIVE_INT = 6
    GLOBAL_TERRAIN = 10
    """Height above the ground below."""
    GLOBAL_TERRAIN_INT = 11


_STOPS = {
    MavCommand.WAYPOINT,
    MavCommand.LOITER_UNLIMITED,
    MavCommand.LOITER_TURNS,
    MavCommand.LOITER_TIME,
    MavCommand.LOITER_TO_ALTITUDE,
    MavCommand.SPLINE_WAYPOINT,
}
_WITH_HOLD = {MavCommand.WAYPOINT, MavCommand.LOITER_TIME, MavCommand.SPLINE_WAYPOINT}
"""Commands whose first parameter is a time on the spot [s]."""
_ABOVE_SEA = {MavFrame.GLOBAL, MavFrame.GLOBAL_INT}
_ABOVE_HOME = {MavFrame.GLOBAL_RELATIVE, MavFrame.GLOBAL_RELATIVE_INT}
_ABOVE_GROUND = {MavFrame.GLOBAL_TERRAIN, MavFrame.GLOBAL_TERRAIN_INT}


@dataclass(frozen=True, slots=True)
class WaypointItem:
    """One item of a mission."""

    command: int
    frame: int
    params: Sequence[object]
    """Seven; the last three are latitude [deg], longitude [deg] and height [m]."""
    place: str
    """Where it stands in its file."""
    alt_m: float | None = None
    """Height above mean sea level, where the file gives it beside the height of the frame [m]."""


def whole_of(value: object) -> int | None:
    """``value`` as a whole number, also where it is written 16.0; None if it is none."""
    number = number_of(value)
    return int(number) if number is not None and number.is_integer() else None


def stops_of(
    items: Sequence[WaypointItem], home: Origin | None, below_m: float, homeless: Fault
) -> list[FileTask | Fault]:
    """The tasks that ``items`` become; items that are not flown to become none.

    They lie ``below_m`` below their waypoints. ``homeless`` is the fault where a height is counted
    from ``home`` and that is None.
    """
    stops = [item for item in items if item.command in _STOPS]
    if home is None and any(item.frame in _ABOVE_HOME for item in stops):
        return [homeless]
    home_alt_m = 0.0 if home is None else home.alt_m
    return [_stop(item, homeless.source, home_alt_m, below_m) for item in stops]


def left_out_of(items: Sequence[WaypointItem]) -> Counter[str]:
    """What in ``items`` becomes no task, by name."""
    return Counter(_name(item.command) for item in items if item.command not in _STOPS)


def _name(command: int) -> str:
    if command not in set(MavCommand):
        return f"command {command}"
    return MavCommand(command).name.lower().replace("_", " ")


def _stop(item: WaypointItem, source: str, home_alt_m: float, below_m: float) -> FileTask | Fault:
    hold, *_, lat, lon, height = item.params
    lat_deg, lon_deg = number_of(lat), number_of(lon)
    if lat_deg is None or lon_deg is None or lat_deg == lon_deg == 0.0:
        problem = f"{_shown(lat)}, {_shown(lon)} is no place"
        return Fault(source, item.place, problem, "give the waypoint a latitude and a longitude")
    alt_m = _alt_m(item, home_alt_m)
    if alt_m is None and item.frame in _ABOVE_GROUND:
        problem = "its height is above the ground there, which the file does not know"
        remedy = "give heights above launch or above mean sea level"
        return Fault(source, item.place, problem, remedy)
    if alt_m is None and item.frame in _ABOVE_SEA | _ABOVE_HOME:
        problem = f"{_shown(height)} is no height"
        return Fault(source, item.place, problem, "give the waypoint a height [m]")
    if alt_m is None:
        remedy = "give frame 0 (above mean sea level) or 3 (above home)"
        return Fault(source, item.place, f"frame {item.frame} is not known", remedy)
    table: dict[str, object] = {"lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m - below_m}
    if item.command in _WITH_HOLD and number_of(hold):
        table["service_s"] = number_of(hold)
    return FileTask(table, item.place)


def _alt_m(item: WaypointItem, home_alt_m: float) -> float | None:
    """Height of the waypoint above mean sea level [m]; None when it cannot be told."""
    height_m = number_of(item.params[6])
    if item.frame in _ABOVE_SEA:
        return height_m
    if item.frame in _ABOVE_HOME and height_m is not None:
        return home_alt_m + height_m
    return item.alt_m if item.frame in _ABOVE_GROUND else None


def _shown(value: object) -> str:
    return "nothing" if value is None else shown(value)
