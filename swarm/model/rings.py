"""Rings on the map that enclose something: borders and holes of zones and of areas."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import shapely

Corner = tuple[float, float]
"""East and north [m; mission origin]."""
Ring = tuple[Corner, ...]
"""Corners of a simple ring, the first not repeated."""

_LEAST_CORNERS = 3
_FAULTS = (
    ("Hole lies outside shell", "a hole lies outside the polygon"),
    ("Nested holes", "a hole lies in another"),
    ("Holes are nested", "a hole lies in another"),
    ("Duplicate Rings", "a hole is there twice"),
    ("Interior is disconnected", "holes cut the polygon into pieces: give each by itself"),
    ("Self-intersection", "a hole crosses the polygon's border or another hole"),
)
"""GEOS's beginnings of reasons, and ours."""


def sound_rings(
    polygon: Sequence[Sequence[float]], holes: Sequence[Sequence[Sequence[float]]], what: str
) -> tuple[Ring, tuple[Ring, ...]]:
    """Border and holes of ``what`` as simple rings, a last corner that repeats the first dropped.

    Raises:
        ValueError: says which ring is wrong, where and why, or that holes do not lie inside.
    """
    border = _ring(polygon, f"polygon of {what}")
    rings = tuple(
        _ring(hole, f"hole {number} of {what}") for number, hole in enumerate(holes, start=1)
    )
    if rings:
        _require_holes_inside(enclosed(border, rings), what)
    return border, rings


def enclosed(polygon: Ring, holes: Sequence[Ring]) -> shapely.Polygon:
    """What the rings enclose."""
    import shapely  # only where there are rings: it takes longer than all of swarm.model

    return shapely.Polygon(polygon, holes)


def _require_holes_inside(shape: shapely.Polygon, what: str) -> None:
    import shapely

    reason = shapely.is_valid_reason(shape)
    if reason == "Valid Geometry":
        return
    fault, _, place = reason.partition("[")
    words = next((ours for theirs, ours in _FAULTS if fault.startswith(theirs)), fault)
    near = f" near ({', '.join(place.rstrip(']').split())})" if place else ""
    raise ValueError(f"holes of {what}: {words}{near}")


def _ring(corners: Sequence[Sequence[float]], what: str) -> Ring:
    """``corners`` as a simple ring, the first not repeated, or a ``ValueError`` about ``what``."""
    ring: list[Corner] = []
    for number, corner in enumerate(corners, start=1):
        if len(corner) != 2 or not all(math.isfinite(number) for number in corner):
            raise ValueError(
                f"{what}: corner {number} must be two finite numbers [m], not {tuple(corner)}"
            )
        ring.append((float(corner[0]), float(corner[1])))
    if len(ring) > 1 and ring[0] == ring[-1]:
        ring.pop()
    if len(ring) < _LEAST_CORNERS:
        raise ValueError(f"{what} must have at least three corners, not {len(ring)}")
    for number, (before, corner) in enumerate(pairwise(ring), start=2):
        if before == corner:
            raise ValueError(f"{what}: corner {number} repeats the one before it, {corner}")
    _require_simple(ring, what)
    return tuple(ring)


def _require_simple(ring: list[Corner], what: str) -> None:
    import shapely

    if shapely.Polygon(ring).area == 0.0:
        raise ValueError(f"{what} encloses nothing: {ring}")
    if not shapely.LinearRing(ring).is_simple:
        reason = shapely.is_valid_reason(shapely.Polygon(ring))
        place = reason.partition("[")[2].rstrip("]").split()
        near = f" near ({', '.join(place)})" if place else ""
        raise ValueError(f"{what} crosses or touches itself{near}")
