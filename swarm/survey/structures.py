"""What a camera looks at along a line that leads round something, as structure scans do.

The one word that a line may carry says so, its kind. Leaves out: who points the camera there
(coordinator.sorties, agent.vehicle.camera_control).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

STRUCTURE_KIND = "structure"
"""Kind of the lines round a structure."""
_LEAST_RING = 4
"""Points of a closed line round anything, its beginning told twice."""
_CLOSED_M = 0.1
_Flat = tuple[float, float]
_FLAT = 1e-6
"""Of the square of its length, the area of a line that leads round nothing."""


def structure_middle_m(
    kind: str | None, points_enu_m: Sequence[tuple[float, float, float]]
) -> tuple[float, float] | None:
    """The middle of what a closed line of that kind leads round, level with the line.

    The centroid of the polygon (P. Bourke, "Calculating the area and centroid of a polygon",
    1988), or of the line where it encloses nothing to speak of, or crosses itself.

    Args:
        kind: of the task.
        points_enu_m: of the line in order [m; ENU].

    Returns:
        East and north [m]; None: the camera is not pointed anywhere.
    """
    closed = len(points_enu_m) >= _LEAST_RING
    closed = closed and math.dist(points_enu_m[0], points_enu_m[-1]) <= _CLOSED_M
    if kind != STRUCTURE_KIND or not closed:
        return None
    # From its first point, so that nothing is lost far from the origin.
    east0_m, north0_m, _ = points_enu_m[0]
    ring = [(east_m - east0_m, north_m - north0_m) for east_m, north_m, _ in points_enu_m]
    ring.append(ring[0])
    middle_m = _middle_of_area(ring) or _middle_of_line(ring)
    return east0_m + middle_m[0], north0_m + middle_m[1]


def _middle_of_area(ring: Sequence[_Flat]) -> _Flat | None:
    """Centroid of a polygon; None where that is not among its points, or it has no area."""
    doubled = [a[0] * b[1] - b[0] * a[1] for a, b in pairwise(ring)]
    area_m2, length_m = sum(doubled) / 2.0, sum(math.dist(*piece) for piece in pairwise(ring))
    if abs(area_m2) <= _FLAT * length_m**2:
        return None
    pieces = list(zip(pairwise(ring), doubled, strict=True))
    east_m, north_m = (
        sum((a[axis] + b[axis]) * cross for (a, b), cross in pieces) / (6.0 * area_m2)
        for axis in (0, 1)
    )
    eastings, northings = zip(*ring, strict=True)
    inside = min(eastings) <= east_m <= max(eastings) and min(northings) <= north_m <= max(
        northings
    )
    return (east_m, north_m) if inside else None


def _middle_of_line(ring: Sequence[_Flat]) -> _Flat:
    """Centroid of a line; its beginning where it has no length."""
    length_m = sum(math.dist(*piece) for piece in pairwise(ring))
    if length_m <= 0.0:
        return ring[0]
    east_m, north_m = (
        sum((a[axis] + b[axis]) * math.dist(a, b) for a, b in pairwise(ring)) / (2.0 * length_m)
        for axis in (0, 1)
    )
    return east_m, north_m
