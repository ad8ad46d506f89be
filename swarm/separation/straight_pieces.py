"""Paths of straight pieces, in two or three dimensions: how far away, and what is left of one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeVar

from swarm.protocol.fields import Point

_P = TypeVar("_P", bound=Sequence[float])
_ON_PATH_M = 1.0
"""Who is no farther from a piece may be on it [m]."""
_SAME_M = 0.1
"""Corners that are no farther apart are the same for one who is on its way [m]."""
_THINNED_M = 1e-3
"""Corners that are no farther beside a straight piece are left out of a path [m]."""


def off_piece_m(
    place_m: Sequence[float], begin_m: Sequence[float], end_m: Sequence[float]
) -> float:
    """Distance of a place from a straight piece [m]; all of one dimension."""
    return math.dist(place_m, _nearest_on(place_m, begin_m, end_m))


def _nearest_on(
    place_m: Sequence[float], begin_m: Sequence[float], end_m: Sequence[float]
) -> list[float]:
    """The place on a straight piece that is nearest to a place [m]."""
    along = [b - a for a, b in zip(begin_m, end_m, strict=True)]
    away = [p - a for a, p in zip(begin_m, place_m, strict=True)]
    length2 = sum(each * each for each in along)
    share = sum(a * b for a, b in zip(along, away, strict=True)) / length2 if length2 > 0.0 else 0.0
    share = min(1.0, max(0.0, share))
    return [a + share * d for a, d in zip(begin_m, along, strict=True)]


def still_ahead(path_m: Sequence[_P], place_m: _P) -> tuple[_P, ...]:
    """What is left of a path for one at ``place_m``, with that: corners behind it are left out."""
    if len(path_m) < 2:
        return (place_m, *path_m[-1:])
    off_m = [off_piece_m(place_m, *piece) for piece in pairwise(path_m)]
    nearest = min(range(len(off_m)), key=off_m.__getitem__)
    return (place_m, *path_m[nearest + 1 :])


def not_flown(path_m: Sequence[Point], place_m: Point) -> tuple[Point, ...]:
    """What one may still be on, or come to, of a path that it flies, and that it was at there [m].

    A part of the path, to the end of it: from the first piece on that it may be on, as it may come
    by the same place again later. The whole path of one that is beside all of it.
    """
    for number, (begin_m, end_m) in enumerate(pairwise(path_m)):
        if off_piece_m(place_m, begin_m, end_m) <= _ON_PATH_M:
            east_m, north_m, up_m = _nearest_on(place_m, begin_m, end_m)
            return ((east_m, north_m, up_m), *path_m[number + 1 :])
    return tuple(path_m)


def thinned(path_m: Sequence[Point], most: int) -> tuple[Point, ...]:
    """A path of ``most`` corners at most that leaves out those nearly on straight pieces.

    Round a zone with a margin a way has dozens of corners at each of the zone's. It comes a
    millimetre nearer by this; by more only where that is not enough.

    Args:
        path_m: its corners [m].
        most: > 1.
    """
    off_m = _THINNED_M
    while True:
        kept, first = list(path_m[:1]), 0
        for last in range(2, len(path_m)):
            begin_m, end_m = path_m[first], path_m[last]
            between = path_m[first + 1 : last]
            if any(off_piece_m(each, begin_m, end_m) > off_m for each in between):
                first = last - 1
                kept.append(path_m[first])
        kept += path_m[-1:] if len(path_m) > 1 else []
        if len(kept) <= most:
            return tuple(kept)
        off_m *= 2.0


def is_same_path(one_m: Sequence[Point], other_m: Sequence[Point]) -> bool:
    """Whether two paths have the same corners, but for where they begin by chance."""
    same = len(one_m) == len(other_m)
    return same and all(
        math.dist(one, other) <= (_SAME_M if number else _ON_PATH_M)
        for number, (one, other) in enumerate(zip(one_m, other_m, strict=True))
    )
