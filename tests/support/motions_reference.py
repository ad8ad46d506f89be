"""Definitions of `swarm.kernels.motions`, sample by sample and with NumPy."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from swarm.kernels.motions import FloatArray
from swarm.separation.tactical_motion import STEP_S, Agility, Place

_REACHED_M = 0.5


def motion_m(
    position_m: Place,
    velocity_m_s: Place,
    path_m: Sequence[Place],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
    span_s: float,
) -> FloatArray:
    """See the kernel."""
    (px, py, pz), (vx, vy, vz) = position_m, velocity_m_s
    change_m_s = agility.acceleration_m_s2 * STEP_S
    corner, last = 0, len(path_m) - 1
    places = [(px, py, pz)]
    for step in range(math.ceil(span_s / STEP_S)):
        wx = wy = wz = 0.0
        if step * STEP_S < drive_s and path_m:
            tx, ty, tz = path_m[corner]
            away_m = math.sqrt((tx - px) ** 2 + (ty - py) ** 2 + (tz - pz) ** 2)
            near_m = max(_REACHED_M, STEP_S * math.sqrt(vx * vx + vy * vy + vz * vz))
            while corner < last and away_m <= near_m:
                corner += 1
                tx, ty, tz = path_m[corner]
                away_m = math.sqrt((tx - px) ** 2 + (ty - py) ** 2 + (tz - pz) ** 2)
            if away_m > 1e-6:
                pace_m_s = speed_m_s
                if corner == last:
                    slowing_m_s = math.sqrt(2.0 * agility.acceleration_m_s2 * away_m)
                    pace_m_s = min(pace_m_s, slowing_m_s, away_m / STEP_S)
                if (steep_m := abs(tz - pz)) > 1e-6:
                    pace_m_s = min(pace_m_s, agility.climb_m_s * away_m / steep_m)
                share = pace_m_s / away_m
                wx, wy, wz = share * (tx - px), share * (ty - py), share * (tz - pz)
        ax, ay, az = wx - vx, wy - vy, wz - vz
        wanted_m_s = math.sqrt(ax * ax + ay * ay + az * az)
        if wanted_m_s > change_m_s:
            share = change_m_s / wanted_m_s
            ax, ay, az = share * ax, share * ay, share * az
        # The mean of the speeds before and after, as it changes evenly.
        px += STEP_S * (vx + 0.5 * ax)
        py += STEP_S * (vy + 0.5 * ay)
        pz += STEP_S * (vz + 0.5 * az)
        vx, vy, vz = vx + ax, vy + ay, vz + az
        places.append((px, py, pz))
    return np.array(places)


def least_distance_m(
    some_m: FloatArray, others_m: FloatArray, stray_m: tuple[float, float] = (0.0, 0.0)
) -> float:
    """See the kernel."""
    apart_m = some_m[:, None, :] - others_m[None, :, :]
    flat_m = np.hypot(apart_m[..., 0], apart_m[..., 1])
    upright_m = np.abs(apart_m[..., 2])
    if any(stray_m):
        flat_m = np.maximum(0.0, flat_m - stray_m[0])
        upright_m = np.maximum(0.0, upright_m - stray_m[1])
    return float(np.min(np.hypot(flat_m, upright_m)))


def meetings(some_m: FloatArray, others_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """See the kernel."""
    apart_m = some_m - others_m
    steps_m = np.diff(apart_m, axis=1)
    length2 = np.maximum(np.einsum("nij,nij->ni", steps_m, steps_m), 1e-12)
    share = np.clip(-np.einsum("nij,nij->ni", apart_m[:, :-1], steps_m) / length2, 0.0, 1.0)
    nearest_m = apart_m[:, :-1] + share[..., None] * steps_m
    square = np.einsum("nij,nij->ni", nearest_m, nearest_m)
    step = square.argmin(axis=1)
    rows = np.arange(len(square))
    return np.sqrt(square[rows, step]), step + share[rows, step]
