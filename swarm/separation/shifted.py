"""Ways in other layers than a UAV's own: built, and seen from the own layer again.

A UAV knows itself in one layer, that of the brief; in another one all is as much higher or lower.
It goes there straight up or down from where it hovers, and at a task with a height of its own
straight to that height at the end.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import ClaimedWay

_NEAR_M = 0.01
"""Who is no farther from a place, seen from above, is above or below it [m]."""


def shifted_path(
    here_enu_m: Point,
    corners_enu_m: Sequence[Point],
    shift_m: float,
    end_enu_m: Point | None = None,
) -> tuple[Point, ...]:
    """The way in a layer that is ``shift_m`` higher than the own one [m].

    Args:
        here_enu_m: where the UAV hovers.
        corners_enu_m: of the way in its own layer, its beginning included.
        shift_m: how much higher.
        end_enu_m: where it ends if that keeps its height; None: higher as all the rest.
    """
    path = [here_enu_m]
    path += [(east_m, north_m, up_m + shift_m) for east_m, north_m, up_m in corners_enu_m]
    if end_enu_m is not None:
        path.append(end_enu_m)
    kept = path[:1]
    for point in path[1:]:
        if math.dist(point, kept[-1]) > 1e-6:
            kept.append(point)
    return tuple(kept)


def length_m(path_enu_m: Sequence[Point]) -> float:
    """Of all its pieces together [m]."""
    return sum(math.dist(a, b) for a, b in itertools.pairwise(path_enu_m))


def nominal(place_enu_m: Point, way: ClaimedWay, *, own_height: bool) -> Point:
    """Where that is in the own layer [m], for a UAV that is somewhere on its way.

    Args:
        place_enu_m: where it is.
        way: what it flies.
        own_height: the end of that keeps its height.
    """
    east_m, north_m, up_m = place_enu_m
    path, shift_m = way.path_enu_m, way.shift_m
    if len(path) > 1 and own_height and _above(place_enu_m, path[-1]):
        return east_m, north_m, path[-1][2]
    if len(path) > 1 and _above(place_enu_m, path[0]) and _above(path[0], path[1]):
        return east_m, north_m, path[1][2] - shift_m
    return east_m, north_m, up_m - shift_m


def hover_shift_m(way: ClaimedWay) -> float:
    """How much higher than its own layer a UAV is where its ``way`` begins [m]."""
    path = way.path_enu_m
    if len(path) > 1 and _above(path[0], path[1]):
        return way.shift_m + path[0][2] - path[1][2]
    return way.shift_m


def _above(one_enu_m: Point, other_enu_m: Point) -> bool:
    return math.dist(one_enu_m[:2], other_enu_m[:2]) <= _NEAR_M
