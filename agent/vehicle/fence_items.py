"""Zones as the items of a firmware's own fence, and items told as areas again.

Which polygons a zone is, swarm.model.fence_rings tells. They are the zones themselves, without the
margin: the agent keeps farther away, and the fence is the last line.

Protocol: https://mavlink.io/en/services/mission.html#geofence
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from agent.vehicle.messages import AltitudeFrame, MissionItem, MissionKind
from swarm.model import Zone
from swarm.model.fence_rings import fence_rings
from swarm.model.frames import Origin, wgs84_from_enu

_INCLUSION, _EXCLUSION = 5001, 5002
"""MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION and _EXCLUSION."""
_DEG_E7 = 1e7
_TOLERANCE_E7 = 2
"""Of places as told back [1e-7 deg]."""

Corner = tuple[int, int]
"""Latitude and longitude [1e-7 deg]."""


@dataclass(frozen=True, slots=True)
class FenceArea:
    """A polygon to stay in, or to keep out of."""

    command: int
    """MAV_CMD of its corners."""
    corners_e7: tuple[Corner, ...]

    def is_same(self, other: FenceArea) -> bool:
        """Whether it is that one, but for the wire's rounding."""
        return (
            self.command == other.command
            and len(self.corners_e7) == len(other.corners_e7)
            and all(
                abs(a - b) <= _TOLERANCE_E7
                for corner, told in zip(self.corners_e7, other.corners_e7, strict=True)
                for a, b in zip(corner, told, strict=True)
            )
        )


def fence_areas(zone: Zone, origin: Origin) -> tuple[FenceArea, ...]:
    """The polygons that a zone is, whatever its heights."""
    return tuple(
        FenceArea(
            _INCLUSION if ring.inclusive else _EXCLUSION,
            tuple(_corner_e7(corner_m, origin) for corner_m in ring.corners_enu_m),
        )
        for ring in fence_rings(zone)
    )


def fence_items(areas: Sequence[FenceArea]) -> tuple[MissionItem, ...]:
    """What is uploaded for these areas: every corner tells how many its polygon has."""
    corners = [(area, corner) for area in areas for corner in area.corners_e7]
    return tuple(
        MissionItem(
            seq=seq,
            command=area.command,
            frame=AltitudeFrame.MEAN_SEA_LEVEL,
            lat_deg=lat_e7 / _DEG_E7,
            lon_deg=lon_e7 / _DEG_E7,
            alt_m=0.0,
            params=(float(len(area.corners_e7)), 0.0, 0.0, 0.0),
            autocontinue=False,
            kind=MissionKind.FENCE,
        )
        for seq, (area, (lat_e7, lon_e7)) in enumerate(corners)
    )


def areas_of(items: Sequence[MissionItem]) -> tuple[FenceArea, ...] | None:
    """The areas that items describe; None if there is anything else among them."""
    areas: list[FenceArea] = []
    place = 0
    while place < len(items):
        item = items[place]
        number = item.params[0]
        if item.command not in (_INCLUSION, _EXCLUSION) or not 3.0 <= number <= len(items):
            return None
        corners = items[place : place + int(number)]
        kinds = {(each.command, each.params[0]) for each in corners}
        if len(corners) != number or len(kinds) != 1:
            return None
        areas.append(FenceArea(item.command, tuple(map(_told_e7, corners))))
        place += len(corners)
    return tuple(areas)


def _told_e7(item: MissionItem) -> Corner:
    return round(item.lat_deg * _DEG_E7), round(item.lon_deg * _DEG_E7)


def _corner_e7(place_enu_m: tuple[float, float], origin: Origin) -> Corner:
    lat_deg, lon_deg, _ = wgs84_from_enu(origin, (*place_enu_m, 0.0))
    return round(lat_deg * _DEG_E7), round(((lon_deg + 180.0) % 360.0 - 180.0) * _DEG_E7)
