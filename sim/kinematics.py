"""How simulated vehicles move: straight legs at constant speed, in closed form.

Positions are functions of time, not sums of steps, so they carry no integration
error and may be asked for in any order. Leaves out: acceleration limits
(`sim.smooth_motion`) and wind (`sim.wind`), which stand behind `Motion` in `IdealMotion`'s
place, and attitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

__all__ = ["IdealMotion", "Leg", "Motion", "Point"]

Point = tuple[float, float, float]
"""East, north, up [m] of a place, or [m/s] of a velocity, in the mission's local frame."""

_AT_REST: Point = (0.0, 0.0, 0.0)


class Motion(Protocol):
    """The motion of one vehicle's centre."""

    @property
    def target_enu_m(self) -> Point:
        """Where the vehicle is going to stop [m]; its place when it is at rest."""
        ...

    @property
    def arrives_s(self) -> float | None:
        """When it stops at the target [s]; None once `stop` was called or before any order."""
        ...

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        ...

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        ...

    def fly_to(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Leave for a target at once, in place of any earlier one."""
        ...

    def stop(self, now_s: float) -> None:
        """Stay where the vehicle is."""
        ...


@dataclass(frozen=True, slots=True)
class Leg:
    """A straight line flown at constant speed, with rest before and after.

    Raises:
        ValueError: the speed is not positive and finite.
    """

    start_enu_m: Point
    target_enu_m: Point
    speed_m_s: float
    """Along the line in three dimensions [m/s]; > 0."""
    leaves_s: float
    arrives_s: float = field(init=False)
    """When the target is reached [s]."""

    def __post_init__(self) -> None:
        if not 0.0 < self.speed_m_s < math.inf:
            raise ValueError(f"speed must be positive and finite, not {self.speed_m_s} m/s")
        length_m = math.dist(self.start_enu_m, self.target_enu_m)
        object.__setattr__(self, "arrives_s", self.leaves_s + length_m / self.speed_m_s)

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]; the target exactly from the arrival on."""
        if now_s >= self.arrives_s:
            return self.target_enu_m
        if now_s <= self.leaves_s:
            return self.start_enu_m
        flown_frac = (now_s - self.leaves_s) / (self.arrives_s - self.leaves_s)
        (east_m, north_m, up_m), (to_east_m, to_north_m, to_up_m) = (
            self.start_enu_m,
            self.target_enu_m,
        )
        return (
            east_m + (to_east_m - east_m) * flown_frac,
            north_m + (to_north_m - north_m) * flown_frac,
            up_m + (to_up_m - up_m) * flown_frac,
        )

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]; zero before the start and from the arrival on."""
        if not self.leaves_s <= now_s < self.arrives_s:
            return _AT_REST
        duration_s = self.arrives_s - self.leaves_s
        (east_m, north_m, up_m), (to_east_m, to_north_m, to_up_m) = (
            self.start_enu_m,
            self.target_enu_m,
        )
        return (
            (to_east_m - east_m) / duration_s,
            (to_north_m - north_m) / duration_s,
            (to_up_m - up_m) / duration_s,
        )


class IdealMotion:
    """Straight to the target at the ordered speed, stopping and turning in no time."""

    def __init__(self, start_enu_m: Point) -> None:
        self._rest_enu_m = start_enu_m
        self._leg: Leg | None = None

    @property
    def target_enu_m(self) -> Point:
        """Where the vehicle is going to stop [m]."""
        return self._rest_enu_m if self._leg is None else self._leg.target_enu_m

    @property
    def arrives_s(self) -> float | None:
        """When the last ordered target is reached [s], also if that is past."""
        return None if self._leg is None else self._leg.arrives_s

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        return self._rest_enu_m if self._leg is None else self._leg.position_enu_m(now_s)

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        return _AT_REST if self._leg is None else self._leg.velocity_enu_m_s(now_s)

    def fly_to(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Leave for ``target_enu_m`` at once.

        Raises:
            ValueError: the speed is not positive and finite.
        """
        self._leg = Leg(self.position_enu_m(now_s), target_enu_m, speed_m_s, now_s)

    def stop(self, now_s: float) -> None:
        """Stay where the vehicle is."""
        self._rest_enu_m = self.position_enu_m(now_s)
        self._leg = None
