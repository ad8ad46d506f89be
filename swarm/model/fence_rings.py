"""Zones as the polygons of a firmware's own fence, which have no heights and no holes.

Only a zone that reaches from the ground up to wherever a vehicle may be made to fly can become
polygons; a hole in a zone to keep out of is left out by cutting the zone into pieces beside it, and
a hole in a zone to stay in is a polygon to keep out of. Leaves out: how a fence is told to whom.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarm.model.zones import Zone

if TYPE_CHECKING:
    import shapely

_LEAST_M2 = 1e-3
"""Pieces smaller than that are none: they come of rounding where zones are cut."""


@dataclass(frozen=True, slots=True)
class FenceRing:
    """A polygon to stay in, or to keep out of."""

    inclusive: bool
    corners_enu_m: tuple[tuple[float, float], ...]
    """Corners, each once [m; east, north of the mission origin]."""


def blocks_all_heights(zone: Zone, low_m: float, high_m: float) -> bool:
    """Whether a zone lies in the way at every height from ``low_m`` to ``high_m`` [m]."""
    return zone.bottom_m <= low_m and zone.top_m >= high_m


def fence_rings(zone: Zone) -> tuple[FenceRing, ...]:
    """The polygons that a zone is, whatever its heights."""
    if zone.inclusive:
        holes = (FenceRing(inclusive=False, corners_enu_m=hole) for hole in zone.holes_enu_m)
        return (FenceRing(inclusive=True, corners_enu_m=zone.polygon_enu_m), *holes)
    if zone.holes_enu_m:
        pieces = (_corners(piece) for piece in _cut(zone.shape()))
        return tuple(FenceRing(inclusive=False, corners_enu_m=piece) for piece in pieces)
    return (FenceRing(inclusive=False, corners_enu_m=zone.polygon_enu_m),)


def _corners(shape: shapely.Polygon) -> tuple[tuple[float, float], ...]:
    return tuple((east_m, north_m) for east_m, north_m in shape.exterior.coords[:-1])


def _cut(shape: shapely.Polygon) -> Iterator[shapely.Polygon]:
    """Pieces without holes that make up a polygon: cut north to south through each hole."""
    import shapely

    if not shape.interiors:
        yield shape
        return
    west_m, south_m, east_m, north_m = shape.bounds
    middle_m = shapely.Polygon(shape.interiors[0]).representative_point().x
    for low_m, high_m in ((west_m, middle_m), (middle_m, east_m)):
        half = shape.intersection(shapely.box(low_m, south_m, high_m, north_m))
        for piece in shapely.get_parts(half):
            if piece.area > _LEAST_M2:
                yield from _cut(piece)
