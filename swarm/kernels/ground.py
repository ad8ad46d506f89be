"""Heights of the ground, and paths over it; see `swarm.kernels.ground.cpp`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.arrays import converted

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

FEWER_CORNERS_M = 1.0
"""How much higher than the shortest a path may be, to have few corners [m]."""


def ground_up_m(up_m: FloatArray, frame_m: FloatArray, place_m: FloatArray) -> FloatArray:
    """(n,) heights of the ground at (n, 2) places [m].

    Args:
        up_m: (rows, columns) heights, from south to north and from west to east [m].
        frame_m: (4,) west and south of the first height, steps to the east and to the north [m].
        place_m: (n, 2) east and north [m]; beyond the edges what counts is the nearest edge.
    """
    return _kernels.ground_up_m(
        converted("up_m", up_m, np.float64, 2),
        converted("frame_m", frame_m, np.float64, 1),
        converted("place_m", place_m, np.float64, 2),
    )


def drape_paths(
    up_m: FloatArray,
    frame_m: FloatArray,
    place_m: FloatArray,
    first: IntArray,
    ends_up_m: FloatArray,
    room_m: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Shortest paths over the ground along k horizontal ones.

    The height of a path over the distance along it is the hull from above of its ends and of the
    ground with its room; corners of that hull are fewer where it then is `FEWER_CORNERS_M` higher
    at most. Ends stay where they are: one that is too low is left straight up.

    Args:
        up_m: (rows, columns) heights as for `ground_up_m`.
        frame_m: (4,) as there.
        place_m: (n, 2) corners of all paths [m; east, north].
        first: (k + 1,) where in ``place_m`` each begins, and n; two corners or more each.
        ends_up_m: (k, 2) heights of their ends [m].
        room_m: (k, 2) what they keep above the ground at their ends, in between evenly changing
            over the distance [m].

    Returns:
        (m, 3) corners of all paths, those of the horizontal ones included, and (k + 1,) where each
        begins.
    """
    return _kernels.drape_paths(
        converted("up_m", up_m, np.float64, 2),
        converted("frame_m", frame_m, np.float64, 1),
        converted("place_m", place_m, np.float64, 2),
        converted("first", first, np.int64, 1),
        converted("ends_up_m", ends_up_m, np.float64, 2),
        converted("room_m", room_m, np.float64, 2),
    )
