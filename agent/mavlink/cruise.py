"""Whether a vehicle flies as fast as it was told.

A speed beyond what the vehicle's limits of tilt and thrust allow is acknowledged, and then not
flown; nothing but the flight tells. Leaves out: legs too short to reach any speed, on which
nothing is said.
"""

from __future__ import annotations

import math

__all__ = ["CruiseWatch"]

_STEADY_S = 3.0
"""A speed kept for that long is the one that is flown."""
_STEADY_FRAC = 0.03
"""How much a steady speed may change meanwhile."""
_SHORT_FRAC = 0.9
"""Of the speed told, below which it is not reached."""
_LEAST_FRAC = 0.3
"""Of the speed told, below which the vehicle is doing something else than cruising."""
_STEEPEST = 0.3
"""Climb per way flown, beyond which the climb sets the speed."""


class CruiseWatch:
    """Compares steady ground speeds with the one told, and says once when they fall short."""

    def __init__(self) -> None:
        self._since_s = math.inf
        self._first_m_s = 0.0
        self._told = False

    def judge(
        self, velocity_enu_m_s: tuple[float, float, float], told_m_s: float, now_s: float
    ) -> str | None:
        """Take a velocity on the way to a target; what to tell people, or None.

        Args:
            velocity_enu_m_s: over ground [m/s].
            told_m_s: cruise speed that was asked for [m/s].
            now_s: now.
        """
        east_m_s, north_m_s, up_m_s = velocity_enu_m_s
        speed_m_s = math.hypot(east_m_s, north_m_s)
        cruising = speed_m_s >= _LEAST_FRAC * told_m_s and abs(up_m_s) <= _STEEPEST * speed_m_s
        steady = abs(speed_m_s - self._first_m_s) <= _STEADY_FRAC * self._first_m_s
        if self._told or not cruising or not steady or speed_m_s >= _SHORT_FRAC * told_m_s:
            self._since_s, self._first_m_s = now_s, speed_m_s
            return None
        if now_s - self._since_s < _STEADY_S:
            return None
        self._told = True
        return (
            f"it flies at {speed_m_s:.1f} m/s, asked for {told_m_s:g}: its own limits forbid more"
        )
