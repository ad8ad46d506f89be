"""Geofences of ground stations as zones: polygons and circles, to stay in or to keep out of.

A circle becomes a regular polygon that leaves as little as can be: round a circle to keep out of,
inside of one to stay in.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from swarm.model import Origin
from swarm.model.frames import wgs84_from_enu
from swarm.runtime.errors import Fault
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.mission_items import MavCommand, WaypointItem, whole_of
from swarm.scenario.task_files.task_file import Array, FileEntry, too_many_points

_CORNERS = 36
"""Of the polygon that a circle becomes; within 0.4 % of its radius."""
_PREFIX = "fence"
_POLYGONS = {
    MavCommand.FENCE_POLYGON_VERTEX_INCLUSION: True,
    MavCommand.FENCE_POLYGON_VERTEX_EXCLUSION: False,
}
"""Commands of corners, and whether one is to stay inside."""
_CIRCLES = {
    MavCommand.FENCE_CIRCLE_INCLUSION: True,
    MavCommand.FENCE_CIRCLE_EXCLUSION: False,
}
COMMANDS = frozenset({*_POLYGONS, *_CIRCLES})
"""Commands of items that are part of a fence."""
_LARGEST_RADIUS_M = 1e6


def polygon_zone(
    corners: Sequence[object], source: str, place: str, *, inclusive: bool
) -> FileEntry | Fault:
    """The zone of a polygon with corners [latitude, longitude]."""
    if (fault := too_many_points(corners, source, place)) is not None:
        return fault
    ring = [
        [number_of(each) for each in corner[:2]] if isinstance(corner, list) else []
        for corner in corners
    ]
    for number, corner in enumerate(ring, start=1):
        if len(corner) != 2 or None in corner:
            problem = f"corner {number} is no place"
            return Fault(source, place, problem, "give corners [latitude, longitude]")
    return _zone({"polygon": ring}, place, inclusive=inclusive)


def circle_zone(
    center: object, radius: object, source: str, place: str, *, inclusive: bool
) -> FileEntry | Fault:
    """The zone of a circle round [latitude, longitude]."""
    numbers = [number_of(each) for each in center] if isinstance(center, list) else []
    radius_m = number_of(radius)
    if radius_m is None or not 0.0 < radius_m <= _LARGEST_RADIUS_M:
        problem = f"{shown(radius)} is no radius of a circle"
        return Fault(source, place, problem, "give a radius within 0..1e6 [m]")
    match numbers:
        case [float(lat_deg), float(lon_deg), *_] if abs(lat_deg) <= 89.0 and abs(lon_deg) <= 180.0:
            middle = Origin(lat_deg, lon_deg, 0.0)
        case _:
            return Fault(source, place, "has no center", "give [latitude, longitude]")
    half_rad = math.pi / _CORNERS
    corner_m = radius_m if inclusive else radius_m / math.cos(half_rad)
    angles_rad = [2.0 * half_rad * number for number in range(_CORNERS)]
    ring = [
        list(
            wgs84_from_enu(middle, (corner_m * math.sin(angle), corner_m * math.cos(angle), 0.0))[
                :2
            ]
        )
        for angle in angles_rad
    ]
    return _zone({"polygon": ring}, place, inclusive=inclusive)


def zones_of_items(items: Sequence[WaypointItem], source: str) -> list[FileEntry | Fault]:
    """The zones of a fence that is stored as items of a mission; others are passed over.

    Every corner says of how many its polygon has.
    """
    found: list[FileEntry | Fault] = []
    at = 0
    while at < len(items):
        item = items[at]
        inside = _POLYGONS.get(MavCommand(item.command)) if item.command in COMMANDS else None
        if inside is not None:
            count = whole_of(item.params[0]) or 0
            corners = items[at : at + max(count, 1)]
            if (
                count < 1
                or any(each.command != item.command for each in corners)
                or (len(corners) < count)
            ):
                problem = f"says {shown(item.params[0])} corners, which do not follow"
                found.append(Fault(source, item.place, problem, "save the fence again"))
                at += 1
                while at < len(items) and items[at].command == item.command:
                    at += 1
                continue
            ring = [[*each.params[4:6]] for each in corners]
            found.append(polygon_zone(ring, source, item.place, inclusive=inside))
            at += count
            continue
        if item.command in COMMANDS:
            found.append(
                circle_zone(
                    [*item.params[4:6]],
                    item.params[0],
                    source,
                    item.place,
                    inclusive=_CIRCLES[MavCommand(item.command)],
                )
            )
        at += 1
    return found


def _zone(table: dict[str, object], place: str, *, inclusive: bool) -> FileEntry:
    if inclusive:
        table["inclusive"] = True
    return FileEntry(table, place, Array.ZONE, _PREFIX)
