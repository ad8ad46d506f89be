"""How far vehicles in virtual time are from where they believe to be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sim.world.engine import stream
from sim.world.motion import Point


def position_errors(seed: int, uav: str, most_m: float) -> Iterator[Point]:
    """From where a UAV believes to be to where it is, one after the other [m; east, north, up].

    Each is uniform within the ball of radius ``most_m``, and follows from the seed and the name.
    """
    rng = stream(seed, "position", uav)
    while True:
        way = rng.standard_normal(3)
        off_m = most_m * rng.random() ** (1.0 / 3.0) * way / np.linalg.norm(way)
        yield float(off_m[0]), float(off_m[1]), float(off_m[2])
