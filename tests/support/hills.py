"""Rough ground for tests, and plain loops that say what flying over it means."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import numpy.typing as npt

from swarm.model.terrain import STEP_M, Terrain

FloatArray = npt.NDArray[np.float64]


def hills(seed: int, side: int = 40, rough_m: float = 3.0, clearance_m: float = 20.0) -> Terrain:
    """Waves of 40 m with some noise, 13 m by 11 m a cell, the origin in the middle."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[0:side, 0:side]
    up_m = 40.0 * np.sin(column / 6.0 + seed) * np.cos(row / 5.0) + rng.normal(
        0, rough_m, row.shape
    )
    steps = np.round((up_m - up_m.min()) / STEP_M).astype("<u2")
    return Terrain(
        clearance_m, -6.5 * side, -5.5 * side, 13.0, 11.0, side, float(up_m.min()), steps.tobytes()
    )


def plain_up_m(terrain: Terrain, east_m: float, north_m: float) -> float:
    """Height of the ground at one place, as `Terrain` has it."""
    steps = np.frombuffer(terrain.steps, dtype="<u2").reshape(terrain.rows, terrain.columns)
    u = min(max((east_m - terrain.west_m) / terrain.east_step_m, 0.0), terrain.columns - 1.0)
    v = min(max((north_m - terrain.south_m) / terrain.north_step_m, 0.0), terrain.rows - 1.0)
    left, below = min(int(u), terrain.columns - 2), min(int(v), terrain.rows - 2)
    x, y = u - left, v - below
    corners = [
        (steps[below, left], (1 - x) * (1 - y)),
        (steps[below, left + 1], x * (1 - y)),
        (steps[below + 1, left], (1 - x) * y),
        (steps[below + 1, left + 1], x * y),
    ]
    return terrain.lowest_m + STEP_M * sum(float(step) * share for step, share in corners)


def above_m(terrain: Terrain, path_m: FloatArray, count: int = 100) -> FloatArray:
    """(k,) heights above the ground at places all along a path, `count` for each of its pieces."""
    places = [
        here + share * (there - here)
        for here, there in pairwise(path_m)
        for share in np.linspace(0.0, 1.0, count)
    ]
    return np.array([up - plain_up_m(terrain, east, north) for east, north, up in places])


def plain_length_m(terrain: Terrain, begin_m: FloatArray, end_m: FloatArray, count: int) -> float:
    """Length of the shortest path straight over the ground, by the hull of that many places."""
    share = np.linspace(0.0, 1.0, count)
    along_m = share * float(np.hypot(*(end_m - begin_m)[:2]))
    flat_m = begin_m[:2] + share[:, None] * (end_m - begin_m)[:2]
    up_m = np.array([plain_up_m(terrain, east, north) for east, north in flat_m])
    up_m[0], up_m[-1] = begin_m[2], end_m[2]
    hull = [0]
    for place in range(1, count):
        hull.append(place)
        while len(hull) > 2 and _is_under(along_m, up_m, *hull[-3:]):
            del hull[-2]
    return float(np.hypot(np.diff(along_m[hull]), np.diff(up_m[hull])).sum())


def _is_under(along_m: FloatArray, up_m: FloatArray, before: int, at: int, after: int) -> bool:
    rise = (up_m[after] - up_m[before]) / (along_m[after] - along_m[before])
    return bool(up_m[at] <= up_m[before] + rise * (along_m[at] - along_m[before]))
