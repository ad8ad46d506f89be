"""How UAVs move in the next seconds and how near they come; see `swarm.kernels.motions.cpp`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.arrays import converted

FloatArray = npt.NDArray[np.float64]
Vector = tuple[float, float, float]


def sampled_motion(
    position_m: Vector,
    velocity_m_s: Vector,
    path_m: Sequence[Vector],
    speed_m_s: float,
    acceleration_m_s2: float,
    climb_m_s: float,
    drive_s: float,
    step_s: float,
    steps: int,
) -> FloatArray:
    """(steps + 1, 3) places of a UAV at 0, ``step_s``, … [m].

    Args:
        position_m: where it is.
        velocity_m_s: how it moves.
        path_m: corners to fly through, the last to stop at; empty: it brakes at once.
        speed_m_s: cruise speed.
        acceleration_m_s2: to speed up and to brake with.
        climb_m_s: up and down, whatever the cruise speed.
        drive_s: after that it brakes, wherever it is; may be infinite.
        step_s: between two samples.
        steps: how many.

    Raises:
        ValueError: a place or velocity is not finite, or a number makes no motion.
    """
    return _kernels.sampled_motion(
        position_m,
        velocity_m_s,
        path_m,
        speed_m_s,
        acceleration_m_s2,
        climb_m_s,
        drive_s,
        step_s,
        steps,
    )


def meetings(some_m: FloatArray, others_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """When pairs of motions are nearest, and how near.

    Between two samples both are taken to move evenly, so that nobody slips through.

    Args:
        some_m: (n, samples, 3) places at the same moments as
        others_m: (n, samples, 3); two samples or more.

    Returns:
        (n,) distances [m], and (n,) when, in samples from the first.

    Raises:
        ValueError: other shapes, or not finite.
    """
    return _kernels.meetings(
        converted("some_m", some_m, np.float64, 3), converted("others_m", others_m, np.float64, 3)
    )


def least_distance_m(
    some_m: FloatArray, others_m: FloatArray, stray_m: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Between any place of the one and any of the other [m].

    Args:
        some_m: (n, 3).
        others_m: (m, 3).
        stray_m: how far from these places the others may be, flat and upright.

    Raises:
        ValueError: other shapes, none, or not finite.
    """
    return _kernels.least_distance_m(
        converted("some_m", some_m, np.float64, 2),
        converted("others_m", others_m, np.float64, 2),
        *stray_m,
    )
