"""Definition of `swarm.kernels.paths`, piece by piece and with NumPy."""

from __future__ import annotations

import math

import numpy as np

from swarm.separation.slabs import FloatArray, Path, Slabs, planned_apart_m

_ROUNDED_M = 1e-6
_MANY = 2


def apart(
    slabs: Slabs, one_enu_m: Path, other_enu_m: Path, within: frozenset[int] | None = None
) -> bool:
    """See `swarm.separation.slabs.apart`."""
    common = slabs.touched(one_enu_m) & slabs.touched(other_enu_m)
    asked_m = planned_apart_m(slabs.separation_m) - _ROUNDED_M
    if len(common) > _MANY:
        ones, others = (
            _flat_pieces(path, -math.inf, math.inf) for path in (one_enu_m, other_enu_m)
        )
        if least_flat_m(ones, others) >= asked_m:
            return True
    for slab in common if within is None else common & within:
        low_m, high_m = slabs.reach_m(slab)
        mine, its = _flat_pieces(one_enu_m, low_m, high_m), _flat_pieces(other_enu_m, low_m, high_m)
        if len(mine) and len(its) and least_flat_m(mine, its) < asked_m:
            return False
    return True


def least_flat_m(ones_m: FloatArray, others_m: FloatArray) -> float:
    """Least distance of any of some straight pieces from any of others, seen from above [m].

    Two pieces that do not cross are nearest at one of their four ends.

    Args:
        ones_m: (n, 2, 2) their beginnings and ends [m; east, north]; n > 0.
        others_m: (m, 2, 2) alike; m > 0.
    """
    if _cross(ones_m, others_m):
        return 0.0
    near_m = [
        _ends_from(ones_m, others_m),
        _ends_from(others_m, ones_m),
    ]
    return float(min(near_m))


def _flat_pieces(path_enu_m: Path, low_m: float, high_m: float) -> FloatArray:
    """(n, 2, 2) what of a path is between two heights, seen from above [m]."""
    begin, end = (
        (path_enu_m, path_enu_m) if len(path_enu_m) == 1 else (path_enu_m[:-1], path_enu_m[1:])
    )
    rise_m = end[:, 2] - begin[:, 2]
    level = np.abs(rise_m) < 1e-9
    per_m = np.where(level, 0.0, 1.0 / np.where(level, 1.0, rise_m))
    with np.errstate(invalid="ignore"):
        at_low, at_high = (low_m - begin[:, 2]) * per_m, (high_m - begin[:, 2]) * per_m
    at_low, at_high = np.where(level, -math.inf, at_low), np.where(level, math.inf, at_high)
    first = np.clip(np.minimum(at_low, at_high), 0.0, 1.0)
    last = np.clip(np.maximum(at_low, at_high), 0.0, 1.0)
    inside = np.where(
        level,
        (begin[:, 2] > low_m) & (begin[:, 2] < high_m),
        (np.minimum(begin[:, 2], end[:, 2]) < high_m)
        & (np.maximum(begin[:, 2], end[:, 2]) > low_m),
    )
    way = end[:, :2] - begin[:, :2]
    pieces = np.stack(
        [begin[:, :2] + first[:, None] * way, begin[:, :2] + last[:, None] * way], axis=1
    )
    return pieces[inside]


def _ends_from(ones_m: FloatArray, others_m: FloatArray) -> float:
    """Least distance of any end of some pieces from others [m]."""
    ends_m = ones_m.reshape(-1, 1, 2)
    begin, way = others_m[:, 0], others_m[:, 1] - others_m[:, 0]
    length2 = (way * way).sum(axis=1)
    along = ((ends_m - begin) * way).sum(axis=2) / np.where(length2 > 0.0, length2, 1.0)
    nearest = begin + np.clip(along, 0.0, 1.0)[:, :, None] * way
    return float(np.sqrt(((ends_m - nearest) ** 2).sum(axis=2).min()))


def _cross(ones_m: FloatArray, others_m: FloatArray) -> bool:
    """Whether any of some pieces crosses any of others, both truly."""
    a, b = ones_m[:, None, 0], ones_m[:, None, 1]
    c, d = others_m[None, :, 0], others_m[None, :, 1]
    over = _side(a, b, c) * _side(a, b, d) < 0.0
    under = _side(c, d, a) * _side(c, d, b) < 0.0
    return bool((over & under).any())


def _side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """On which side of the lines from ``a`` to ``b`` points are."""
    turned: FloatArray = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (
        b[..., 1] - a[..., 1]
    ) * (c[..., 0] - a[..., 0])
    return turned
