"""Paths of straight pieces, in two or three dimensions: how far away, and what is left of one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TypeVar

_P = TypeVar("_P", bound=Sequence[float])


def off_piece_m(
    place_m: Sequence[float], begin_m: Sequence[float], end_m: Sequence[float]
) -> float:
    """Distance of a place from a straight piece [m]; all of one dimension."""
    along = [b - a for a, b in zip(begin_m, end_m, strict=True)]
    away = [p - a for a, p in zip(begin_m, place_m, strict=True)]
    length2 = sum(each * each for each in along)
    if length2 <= 0.0:
        return math.dist(place_m, begin_m)
    share = sum(a * b for a, b in zip(along, away, strict=True)) / length2
    share = min(1.0, max(0.0, share))
    return math.dist(place_m, [a + share * d for a, d in zip(begin_m, along, strict=True)])


def still_ahead(path_m: Sequence[_P], place_m: _P) -> tuple[_P, ...]:
    """What is left of a path for one at ``place_m``, with that: corners behind it are left out."""
    if len(path_m) < 2:
        return (place_m, *path_m[-1:])
    off_m = [off_piece_m(place_m, *piece) for piece in pairwise(path_m)]
    nearest = min(range(len(off_m)), key=off_m.__getitem__)
    return (place_m, *path_m[nearest + 1 :])
