"""Where one may fly, and what of an area is to be covered.

Zones cut at any height. Whoever keeps to what is left here is clear of every zone by its margin,
as swarm.allocation.legs tells it, and a centimetre more, which rounding may take.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import numpy.typing as npt

from swarm.model import Area, Zone

if TYPE_CHECKING:
    import shapely

Shapes = TypeVar("Shapes", "shapely.Geometry", npt.NDArray[np.object_])
"""One shape, or an array of them."""

_SPARE_M = 0.01
_ROUND_STEPS = 16
"""Chords per quarter of a circle round a corner; they lie inside the circle, so it is drawn larger
by as much."""


def without_zones(shapes: Shapes, zones: Sequence[Zone], margin_m: float) -> Shapes:
    """What of ``shapes`` [m; east, north] is no zone's and no nearer to one than ``margin_m``."""
    import shapely

    reach_m = (margin_m + _SPARE_M) / math.cos(math.pi / (4 * _ROUND_STEPS))
    for zone in zones:
        if zone.inclusive:
            inside = shapely.buffer(zone.shape(), -reach_m, quad_segs=_ROUND_STEPS)
            shapes = shapely.intersection(shapes, inside)
        else:
            kept_out = shapely.buffer(zone.shape(), reach_m, quad_segs=_ROUND_STEPS)
            shapes = shapely.difference(shapes, kept_out)
    return shapes


def to_cover(area: Area, zones: Sequence[Zone], margin_m: float) -> shapely.Geometry:
    """What is to be covered: the area without its holes and without zones with their margin.

    Returns:
        Polygons [m; east, north]; empty if zones leave nothing.
    """
    import shapely

    left = without_zones(area.shape(), zones, margin_m)
    polygons = [part for part in shapely.get_parts(left) if part.geom_type == "Polygon"]
    return shapely.MultiPolygon(polygons)
