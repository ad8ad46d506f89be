"""Ways in other layers than a UAV's own: built, and seen from the own layer again.

A UAV knows itself in one layer, that of the brief; in another one all is as much higher or lower.
It goes there straight up or down from where it hovers, and at a task with a height of its own
straight to that height at the end.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import ClaimedWay
from swarm.separation.straight_pieces import is_same_path, not_flown, off_piece_m

_ON_LINE_M = 0.1
"""A way that is wished leads through where one ends that passes that by no more [m]."""
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


def hovering(way: ClaimedWay) -> ClaimedWay:
    """Staying where ``way`` begins, or where it ends if it is flown."""
    if way.flies:
        return replace(way, path_enu_m=way.path_enu_m[-1:])
    if way.grounded:
        return replace(way, path_enu_m=(), shift_m=0.0)
    here = way.path_enu_m[:1]
    shift_m = hover_shift_m(way)
    return replace(way, path_enu_m=here, flies=bool(here), grounded=not here, shift_m=shift_m)


def landed(way: ClaimedWay) -> ClaimedWay:
    """Standing on the ground after ``way``, which takes no air."""
    return replace(way, path_enu_m=(), flies=False, grounded=True)


def lifted(way: ClaimedWay, hovers_enu_m: tuple[Point, ...]) -> ClaimedWay:
    """In the air after all that ``way`` says, somewhere on it, or where it hovers first [m]."""
    if not way.grounded:
        return way
    path = way.path_enu_m or hovers_enu_m
    return replace(way, path_enu_m=path, flies=bool(path), grounded=False)


def left_of_way(
    way: ClaimedWay, place_enu_m: Point, corners_enu_m: Sequence[Point], end_enu_m: Point | None
) -> ClaimedWay | None:
    """What is left of a way that is flown, if that is just what is wished now; None if not.

    Args:
        way: on which the UAV is.
        place_enu_m: where.
        corners_enu_m: of the way that is wished, in its own layer.
        end_enu_m: where that ends if it keeps its height; None: higher as all the rest.
    """
    left = not_flown(way.path_enu_m, place_enu_m)
    path = shifted_path(place_enu_m, corners_enu_m, way.shift_m, end_enu_m)
    return replace(way, path_enu_m=left) if is_same_path(left, path) else None


def continued(
    way: ClaimedWay, place_enu_m: Point, corners_enu_m: Sequence[Point]
) -> tuple[Point, ...] | None:
    """What a way that is wished adds to one that is flown, if it begins with that; None if not.

    Args:
        way: on which the UAV is, in its layer to the end.
        place_enu_m: where.
        corners_enu_m: of the way that is wished, in its own layer, from there on.
    """
    left = not_flown(way.path_enu_m, place_enu_m)
    path = shifted_path(place_enu_m, corners_enu_m, way.shift_m)
    n_same = len(left) - 1
    if n_same < 1 or len(path) <= n_same or not is_same_path(left[:-1], path[:n_same]):
        return None
    if off_piece_m(left[-1], path[n_same - 1], path[n_same]) > _ON_LINE_M:
        return None
    further = [point for point in path[n_same:] if math.dist(point, left[-1]) > _NEAR_M]
    return tuple((east, north, up - way.shift_m) for east, north, up in (left[-1], *further))


def _above(one_enu_m: Point, other_enu_m: Point) -> bool:
    return math.dist(one_enu_m[:2], other_enu_m[:2]) <= _NEAR_M
