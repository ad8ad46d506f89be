"""How a UAV may move in the next seconds: driven along its path for a while, then braked to rest.

Sampled motions of a point that speeds up and brakes evenly, climbs no faster than it may, and stops
at the end of its path. Leaves out: wind, and how a real autopilot bends corners.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarm.kernels.motions import FloatArray, meetings, sampled_motion

Place = tuple[float, float, float]
"""[m; mission origin, height included]."""

STEP_S = 0.25
"""Between two samples of a motion [s]."""
_LONGEST_S = 25_000.0
"""As long as the motion of a UAV is looked at that hardly brakes at all [s]."""
COLUMN_STEP_M = 1.0
"""Between two places of a column."""
GRID_M = 0.3
"""What samples of two motions may miss of their least distance."""
_BESIDE_M = 1.0
"""Whoever is that near in the view from above is not flown round: it is above or below."""


@dataclass(frozen=True, slots=True)
class Agility:
    """How the UAVs of a fleet speed up, brake and climb; as slow as the slowest of them.

    Raises:
        ValueError: a number is not positive.
    """

    acceleration_m_s2: float = 1.5
    """To speed up and to brake with: PX4 brakes at 1.6, ArduCopter at 2.5 [m/s²]."""
    climb_m_s: float = 1.5
    """Up and down, whatever the cruise speed [m/s]."""

    def __post_init__(self) -> None:
        for name in ("acceleration_m_s2", "climb_m_s"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} must be > 0, not {getattr(self, name)}")

    def stop_m(self, speed_m_s: float) -> float:
        """Braking distance from that speed [m]."""
        return speed_m_s**2 / (2.0 * self.acceleration_m_s2)


def motion_m(
    position_m: Place,
    velocity_m_s: Place,
    path_m: Sequence[Place],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
    span_s: float,
) -> FloatArray:
    """Places of a UAV at 0, `STEP_S`, … until ``span_s``.

    Args:
        position_m: where it is.
        velocity_m_s: how it moves.
        path_m: corners to fly through, the last to stop at; empty: it brakes at once.
        speed_m_s: cruise speed.
        agility: how it speeds up, brakes and climbs.
        drive_s: after that it brakes, wherever it is.
        span_s: until when, if that is no longer than hours.

    Returns:
        Shape (samples, 3) [m].
    """
    steps = math.ceil(min(span_s, _LONGEST_S) / STEP_S)
    fast_m_s2, climb_m_s = agility.acceleration_m_s2, agility.climb_m_s
    flown = position_m, velocity_m_s, path_m, speed_m_s
    return sampled_motion(*flown, fast_m_s2, climb_m_s, drive_s, STEP_S, steps)


def stopping_m(
    position_m: Place,
    velocity_m_s: Place,
    path_m: Sequence[Place],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
) -> FloatArray:
    """Places as of `motion_m` of a UAV that brakes after ``drive_s``, until it stands."""
    fast_m_s = max(speed_m_s, math.hypot(*velocity_m_s))
    span_s = drive_s + fast_m_s / agility.acceleration_m_s2 + STEP_S
    return motion_m(position_m, velocity_m_s, path_m, speed_m_s, agility, drive_s, span_s)


def stop_place_m(
    position_m: Place, velocity_m_s: Place, reaction_s: float, agility: Agility
) -> Place:
    """Where a UAV that moves so would stand if it were told to brake [m]."""
    far_s = reaction_s + math.hypot(*velocity_m_s) / (2.0 * agility.acceleration_m_s2)
    (px, py, pz), (vx, vy, vz) = position_m, velocity_m_s
    return px + far_s * vx, py + far_s * vy, pz + far_s * vz


def round_m(from_m: Place, past_m: FloatArray, aside_m: float) -> list[tuple[Place, Place]]:
    """Corners right and left past a place, level: so far aside, and then on until beside it.

    Args:
        from_m: where the way begins [m].
        past_m: (3,) what is flown round [m].
        aside_m: how far to a side.
    """
    (east_m, north_m, up_m), (to_east_m, to_north_m, _) = from_m, past_m.tolist()
    length_m = math.hypot(to_east_m - east_m, to_north_m - north_m)
    if length_m < _BESIDE_M:
        return []
    right_m = aside_m * (to_north_m - north_m) / length_m, aside_m * (east_m - to_east_m) / length_m
    return [
        (
            (east_m + side * right_m[0], north_m + side * right_m[1], up_m),
            (to_east_m + side * right_m[0], to_north_m + side * right_m[1], up_m),
        )
        for side in (1.0, -1.0)
    ]


def column_m(place_m: Place, end_up_m: float) -> FloatArray:
    """Places straight above or below one, as far as that height; shape (samples, 3)."""
    samples = 2 + math.ceil(abs(end_up_m - place_m[2]) / COLUMN_STEP_M)
    return np.linspace(place_m, (place_m[0], place_m[1], end_up_m), samples)


def stray_m(age_s: float, speed_m_s: float, agility: Agility) -> tuple[float, float]:
    """How far from its told way a UAV may stop at most, that long after it told it.

    It may have turned, sped up or braked at once, with all its acceleration, and is stopped by the
    same acceleration when it notices. Up and down it stops by itself, however fast it flies.

    Returns:
        Beside and along its way, and above and below it [m].
    """
    change_m_s = agility.acceleration_m_s2 * age_s
    flown_m = 0.5 * agility.acceleration_m_s2 * age_s**2
    # A change of speed across the flight moves where it stops by the time that stopping takes.
    flat_m = flown_m + change_m_s * (speed_m_s + change_m_s) / (2.0 * agility.acceleration_m_s2)
    rise_m_s = min(change_m_s, agility.climb_m_s)
    upright_m = min(flown_m, rise_m_s * age_s) + agility.stop_m(rise_m_s)
    return flat_m, upright_m


def least_meeting_m(some_m: FloatArray, others_m: FloatArray) -> float:
    """Between places of the same moment [m]; both of shape (samples, 3)."""
    return float(meetings(some_m[None], others_m[None])[0][0])
