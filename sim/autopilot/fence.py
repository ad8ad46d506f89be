"""Fences that ground stations upload: polygons and circles to stay in or out of.

What is accepted as one, and whether a place breaks it. Sources: recordings of both firmwares,
https://mavlink.io/en/services/mission.html#geofence. Heights, and the distances from a fence at
which firmwares begin to brake, are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.mission_item import StoredMissionItem
from swarm.model.frames import Origin, enu_from_wgs84

_INSIDE = int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION)
_OUTSIDE = int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION)
_INSIDE_CIRCLE = int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION)
_OUTSIDE_CIRCLE = int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
_POLYGONS = frozenset({_INSIDE, _OUTSIDE})
FENCE_COMMANDS = frozenset({*_POLYGONS, _INSIDE_CIRCLE, _OUTSIDE_CIRCLE})

_LEAST_CORNERS = 3

Place = tuple[float, float]
"""East and north [m]."""


@dataclass(frozen=True, slots=True)
class _Area:
    """A polygon, or a circle if it has a radius."""

    inclusive: bool
    corners_m: tuple[Place, ...]
    radius_m: float = 0.0

    def holds(self, place_m: Place) -> bool:
        if self.radius_m > 0.0:
            return math.dist(place_m, self.corners_m[0]) <= self.radius_m
        east_m, north_m = place_m
        inside = False
        before_m = self.corners_m[-1]
        for corner_m in self.corners_m:
            (east_a_m, north_a_m), (east_b_m, north_b_m) = before_m, corner_m
            if (north_a_m > north_m) is not (north_b_m > north_m):
                share = (north_m - north_a_m) / (north_b_m - north_a_m)
                inside ^= east_m < east_a_m + share * (east_b_m - east_a_m)
            before_m = corner_m
        return inside


@dataclass(frozen=True, slots=True)
class UploadedFence:
    """All areas of one upload; none: no fence."""

    areas: tuple[_Area, ...] = ()

    def allows(self, place_m: Place, *, any_inclusion: bool) -> bool:
        """Whether a vehicle may be there, inside of all areas to stay in or of one of them."""
        kept_in = [area.holds(place_m) for area in self.areas if area.inclusive]
        if kept_in and not (any(kept_in) if any_inclusion else all(kept_in)):
            return False
        return not any(area.holds(place_m) for area in self.areas if not area.inclusive)


class FenceError(ValueError):
    """The items make no fence; the text says why, as ArduCopter does."""


def fence_of(items: tuple[StoredMissionItem, ...], origin: Origin) -> UploadedFence:
    """The fence that uploaded items describe.

    Raises:
        FenceError: a polygon has too few corners, or fewer than it says.
    """
    areas: list[_Area] = []
    place = 0
    while place < len(items):
        item = items[place]
        number = item.params[0]
        if item.command not in _POLYGONS:
            if not number > 0.0:
                raise FenceError(f"Invalid circle radius ({number:g})")
            inclusive = item.command == _INSIDE_CIRCLE
            areas.append(_Area(inclusive, (_place_m(item, origin),), number))
            place += 1
            continue
        corners = items[place : place + int(number)]
        alike = all((each.command, each.params[0]) == (item.command, number) for each in corners)
        if number < _LEAST_CORNERS or len(corners) < number or not alike:
            raise FenceError(f"Invalid vertex count ({number:g})")
        corners_m = tuple(_place_m(each, origin) for each in corners)
        areas.append(_Area(item.command == _INSIDE, corners_m))
        place += len(corners)
    return UploadedFence(tuple(areas))


def has_too_few_corners(item: StoredMissionItem | int) -> bool:
    """Whether a corner says that its polygon is none."""
    if not isinstance(item, StoredMissionItem) or item.command not in _POLYGONS:
        return False
    return item.params[0] < _LEAST_CORNERS


def _place_m(item: StoredMissionItem, origin: Origin) -> Place:
    place_enu_m = enu_from_wgs84(origin, item.lat_e7 / 1e7, item.lon_e7 / 1e7, origin.alt_m)
    return place_enu_m[:2]


class FenceStore:
    """The fence as it stands on the vehicle; it outlasts a reboot."""

    def __init__(self, origin: Origin) -> None:
        self.items: tuple[StoredMissionItem, ...] = ()
        """As uploaded."""
        self.fence = UploadedFence()
        self._origin = origin

    def replace(self, items: tuple[StoredMissionItem, ...]) -> None:
        """Have another fence.

        Raises:
            FenceError: it is none; the old one stays.
        """
        self.fence = fence_of(items, self._origin)
        self.items = items
