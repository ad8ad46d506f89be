"""Items of a MAVLink mission, as ground stations store them, and the tasks they become.

A waypoint is where a vehicle flies; a task is what it flies over. So a task lies
as far below its waypoint as the lowest height layer lies above tasks: the first
UAV then flies at the height planned, and every other one a layer higher.

Waypoints between which the camera is triggered by distance are one line, flown at the height
planned, whoever flies it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum

from swarm.model import Origin
from swarm.runtime.errors import Fault
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.task_file import FileEntry, too_many_points

ABOVE_GROUND_REMEDY = (
    "give heights above launch or above mean sea level, or name the ground: --terrain DEM, or "
    "[terrain] in the scenario"
)
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
    SET_ROI_LOCATION = 195
    SET_ROI_NONE = 197
    SET_CAM_TRIGG_DIST = 206
    FENCE_RETURN_POINT = 5000
    FENCE_POLYGON_VERTEX_INCLUSION = 5001
    FENCE_POLYGON_VERTEX_EXCLUSION = 5002
    FENCE_CIRCLE_INCLUSION = 5003
    FENCE_CIRCLE_EXCLUSION = 5004
    RALLY_POINT = 5100


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


@dataclass(frozen=True, slots=True)
class Heights:
    """What heights of waypoints count from, and how tasks lie below them."""

    home: Origin | None
    below_m: float
    """How far a task lies below its waypoint [m]."""
    homeless: Fault
    """What is wrong where a height is counted from ``home`` and that is None."""
    has_terrain: bool = False
    """Whether heights above the ground can be meant."""


@dataclass(frozen=True, slots=True)
class _Spot:
    """Where a waypoint is."""

    point_deg: tuple[float, float]
    alt_m: float | None
    """Above mean sea level [m]; None where only that above the ground is known."""
    ground_m: float | None
    """Above the ground there [m]."""
    hold_s: float
    place: str


def whole_of(value: object) -> int | None:
    """``value`` as a whole number, also where it is written 16.0; None if it is none."""
    number = number_of(value)
    return int(number) if number is not None and number.is_integer() else None


def tasks_of(
    items: Sequence[WaypointItem], heights: Heights, *, visits_alone: bool = False
) -> list[FileEntry | Fault]:
    """The tasks that ``items`` become; items that are not flown to become none.

    With ``visits_alone`` also lines become visits of their points.
    """
    stops = [item for item in items if item.command in _STOPS]
    if heights.home is None and any(item.frame in _ABOVE_HOME for item in stops):
        return [heights.homeless]
    found: list[FileEntry | Fault] = []
    for group, trigger_m in _groups(items, visits_alone=visits_alone):
        spots = [_spot(item, heights) for item in group]
        faults = [spot for spot in spots if isinstance(spot, Fault)]
        sound = [spot for spot in spots if isinstance(spot, _Spot)]
        if faults:
            found += faults
        elif trigger_m is None:
            found += [_visit(spot, heights) for spot in sound]
        else:
            found.append(_line(sound, trigger_m, heights))
    return found


def left_out_of(items: Sequence[WaypointItem], *, visits_alone: bool = False) -> Counter[str]:
    """What in ``items`` becomes no task, by name."""
    heeded = _STOPS if visits_alone else {*_STOPS, MavCommand.SET_CAM_TRIGG_DIST}
    return Counter(_name(item.command) for item in items if item.command not in heeded)


def _name(command: int) -> str:
    if command not in set(MavCommand):
        return f"command {command}"
    return MavCommand(command).name.lower().replace("_", " ")


def _groups(
    items: Sequence[WaypointItem], *, visits_alone: bool
) -> Iterator[tuple[list[WaypointItem], float | None]]:
    """Waypoints that are one line, with the distance between its pictures [m], and single ones.

    A vehicle does what follows a waypoint when it is there: the line begins at the waypoint before
    the camera is switched on, and ends at the one before it is switched off.
    """
    group: list[WaypointItem] = []
    trigger_m: float | None = None
    for item in items:
        if item.command in _STOPS:
            if trigger_m is None and group:
                yield group, None
                group = []
            group.append(item)
        elif item.command == MavCommand.SET_CAM_TRIGG_DIST and not visits_alone:
            asked_m = number_of(item.params[0]) or None
            if asked_m == trigger_m:
                continue
            if trigger_m is not None and group:
                yield group, trigger_m if group[1:] else None
                # A line that goes on with other pictures begins where this one ends.
                group = [] if asked_m is None else group[-1:]
            trigger_m = asked_m
    if group:
        yield group, trigger_m if group[1:] else None


def _spot(item: WaypointItem, heights: Heights) -> _Spot | Fault:
    source = heights.homeless.source
    hold, *_, lat, lon, height = item.params
    lat_deg, lon_deg, height_m = number_of(lat), number_of(lon), number_of(height)
    if lat_deg is None or lon_deg is None or lat_deg == lon_deg == 0.0:
        problem = f"{_shown(lat)}, {_shown(lon)} is no place"
        return Fault(source, item.place, problem, "give the waypoint a latitude and a longitude")
    alt_m, ground_m = None, None
    if item.frame in _ABOVE_SEA:
        alt_m = height_m
    elif item.frame in _ABOVE_HOME:
        home_alt_m = 0.0 if heights.home is None else heights.home.alt_m
        alt_m = None if height_m is None else home_alt_m + height_m
    elif item.frame in _ABOVE_GROUND:
        alt_m = item.alt_m
        ground_m = height_m if heights.has_terrain else None
        if alt_m is None and ground_m is None:
            return above_ground(source, item.place)
    else:
        remedy = "give frame 0 (above mean sea level) or 3 (above home)"
        return Fault(source, item.place, f"frame {item.frame} is not known", remedy)
    if alt_m is None and ground_m is None:
        problem = f"{_shown(height)} is no height"
        return Fault(source, item.place, problem, "give the waypoint a height [m]")
    hold_s = number_of(hold) if item.command in _WITH_HOLD else None
    return _Spot((lat_deg, lon_deg), alt_m, ground_m, hold_s or 0.0, item.place)


def above_ground(source: str, place: str) -> Fault:
    """The fault of a height above the ground, where nobody knows how high that is."""
    problem = "its height is above the ground there, which the file does not know"
    return Fault(source, place, problem, ABOVE_GROUND_REMEDY)


def _visit(spot: _Spot, heights: Heights) -> FileEntry:
    lat_deg, lon_deg = spot.point_deg
    table: dict[str, object] = {"lat_deg": lat_deg, "lon_deg": lon_deg}
    if spot.ground_m is not None:
        table["height_m"] = spot.ground_m
    elif spot.alt_m is not None:
        table["alt_m"] = spot.alt_m - heights.below_m
    if spot.hold_s:
        table["service_s"] = spot.hold_s
    return FileEntry(table, spot.place)


def _line(spots: Sequence[_Spot], trigger_m: float, heights: Heights) -> FileEntry | Fault:
    place = spots[0].place
    if (fault := too_many_points(spots, heights.homeless.source, place)) is not None:
        return fault
    table = path_table([(spot.point_deg, spot.alt_m, spot.ground_m) for spot in spots], heights) | {
        "trigger_m": trigger_m
    }
    if spots[-1].hold_s:
        table["service_s"] = spots[-1].hold_s
    return FileEntry(table, place)


def path_table(
    points: Sequence[tuple[tuple[float, float], float | None, float | None]], heights: Heights
) -> dict[str, object]:
    """The keys of a path through points of a height above sea or above the ground [m].

    Where all are as high that is the height of the line, whoever flies it. Else each point lies
    below its waypoint like all tasks.
    """
    path = [list(point) for point, _, _ in points]
    above_ground_m = {ground_m for _, _, ground_m in points}
    alts_m = {alt_m for _, alt_m, _ in points}
    if len(above_ground_m) == 1 and (ground_m := above_ground_m.pop()) is not None:
        return {"path": path, "height_m": ground_m}
    if len(alts_m) == 1 and heights.home is not None and (alt_m := alts_m.pop()) is not None:
        return {"path": path, "height_m": alt_m - heights.home.alt_m}
    return {
        "path": [
            [*point, (alt_m or ground_m or 0.0) - heights.below_m]
            for point, alt_m, ground_m in points
        ]
    }


def _shown(value: object) -> str:
    return "nothing" if value is None else shown(value)
