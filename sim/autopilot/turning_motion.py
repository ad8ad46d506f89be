"""How a simulated vehicle turns on its way where its mission is one of paths round corners.

A vehicle that is told to go elsewhere has a velocity along the way to its new target and one across
it. Each is dealt with by itself and with all of the acceleration, as fast as that allows: across it
brakes and comes back to the straight line, along it speeds up, cruises and brakes to rest. So
recorded ArduCopters do it in GUIDED: told to turn by 90 degrees 8 m before a corner, at 6.3 m/s,
one passed it by 1.1 m. `sim.world.motion.SmoothMotion` shares the acceleration out instead, and
goes on much farther. Leaves out jerk, and that the sum of both may exceed the acceleration by 41 %.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.world.motion import Point, finite_acceleration_m_s2, minus, plus

_AT_REST: Point = (0.0, 0.0, 0.0)
_STILL_M_S = 1e-9
_NO_WAY_M = 1e-9
"""A way as short has no direction that could be told."""


def _scaled(vector: Point, by: float) -> Point:
    return vector[0] * by, vector[1] * by, vector[2] * by


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@dataclass(frozen=True, slots=True)
class _AxisWay:
    """From a speed at 0 to rest at a distance on one axis, as fast as limits allow."""

    first_m_s: float
    cruise_m_s: float
    change_s: float
    cruise_s: float
    limit_m_s2: float

    @classmethod
    def over(
        cls, length_m: float, first_m_s: float, most_m_s: float, limit_m_s2: float
    ) -> _AxisWay:
        """To a place ahead or, with a negative length, behind."""
        stop_m = 0.5 * first_m_s * abs(first_m_s) / limit_m_s2
        sign = 1.0 if length_m >= stop_m else -1.0
        ahead_m, speed_m_s = sign * length_m, sign * first_m_s
        peak_m_s = math.sqrt(max(0.0, limit_m_s2 * ahead_m + 0.5 * speed_m_s**2))
        cruise_m_s = min(most_m_s, peak_m_s)
        change_m = (cruise_m_s**2 - speed_m_s**2) / (2.0 * limit_m_s2)
        if cruise_m_s < speed_m_s:
            change_m = -change_m
        rest_m = ahead_m - change_m - cruise_m_s**2 / (2.0 * limit_m_s2)
        cruise_s = max(0.0, rest_m) / cruise_m_s if cruise_m_s > _STILL_M_S else 0.0
        change_s = abs(cruise_m_s - speed_m_s) / limit_m_s2
        return cls(first_m_s, sign * cruise_m_s, change_s, cruise_s, limit_m_s2)

    @property
    def duration_s(self) -> float:
        return self.change_s + self.cruise_s + abs(self.cruise_m_s) / self.limit_m_s2

    def at(self, time_s: float) -> tuple[float, float]:
        """Way [m] and speed [m/s] after a time."""
        changing_s = min(time_s, self.change_s)
        slope_m_s2 = math.copysign(self.limit_m_s2, self.cruise_m_s - self.first_m_s)
        speed_m_s = self.first_m_s + slope_m_s2 * changing_s
        way_m = changing_s * 0.5 * (self.first_m_s + speed_m_s)
        after_s = time_s - self.change_s
        if after_s <= 0.0:
            return way_m, speed_m_s
        way_m += self.cruise_m_s * min(after_s, self.cruise_s)
        braking_s = min(max(0.0, after_s - self.cruise_s), abs(self.cruise_m_s) / self.limit_m_s2)
        brake_m_s2 = math.copysign(self.limit_m_s2, self.cruise_m_s)
        speed_m_s = self.cruise_m_s - brake_m_s2 * braking_s
        return way_m + 0.5 * (self.cruise_m_s + speed_m_s) * braking_s, speed_m_s


@dataclass(frozen=True, slots=True)
class _OrderedWay:
    """All that was ordered, from one instant on: the sum of its ways along directions."""

    start_enu_m: Point
    target_enu_m: Point
    leaves_s: float
    ways: tuple[tuple[Point, _AxisWay], ...] = ()

    @property
    def arrives_s(self) -> float:
        return self.leaves_s + max((way.duration_s for _, way in self.ways), default=0.0)

    def at(self, now_s: float) -> tuple[Point, Point]:
        """Place and velocity at an instant."""
        if now_s >= self.arrives_s:
            return self.target_enu_m, _AT_REST
        place, velocity = self.start_enu_m, _AT_REST
        for direction, way in self.ways:
            way_m, speed_m_s = way.at(max(0.0, now_s - self.leaves_s))
            place = plus(place, _scaled(direction, way_m))
            velocity = plus(velocity, _scaled(direction, speed_m_s))
        return place, velocity


class TurningMotion:
    """Straight to the target from rest; on the way to another one, soon back on the straight line.

    Raises:
        ValueError: the acceleration is not positive and finite.
    """

    def __init__(self, start_enu_m: Point, acceleration_m_s2: float) -> None:
        self.limit(acceleration_m_s2)
        self._leg = _OrderedWay(start_enu_m, start_enu_m, 0.0)
        self._ordered = False

    @property
    def target_enu_m(self) -> Point:
        """Where the vehicle is going to stop [m]; after `stop`, the end of its braking."""
        return self._leg.target_enu_m

    @property
    def arrives_s(self) -> float | None:
        """When the last ordered target is reached [s], also if that is past."""
        return self._leg.arrives_s if self._ordered else None

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        return self._leg.at(now_s)[0]

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        return self._leg.at(now_s)[1]

    def fly_to(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Turn towards ``target_enu_m`` at once.

        Raises:
            ValueError: the speed is not positive and finite.
        """
        if not 0.0 < speed_m_s < math.inf:
            raise ValueError(f"speed must be positive and finite, not {speed_m_s} m/s")
        here, velocity = self._leg.at(now_s)
        whole, moves_m_s = minus(target_enu_m, here), math.hypot(*velocity)
        length_m = math.hypot(*whole)
        if length_m > _NO_WAY_M:
            along = _scaled(whole, 1.0 / length_m)
        else:
            along = _scaled(velocity, 1.0 / moves_m_s) if moves_m_s > _STILL_M_S else _AT_REST
        first_m_s = _dot(velocity, along)
        ways = [(along, _AxisWay.over(length_m, first_m_s, speed_m_s, self._limit_m_s2))]
        across = minus(velocity, _scaled(along, first_m_s))
        across_m_s = math.hypot(*across)
        if across_m_s > _STILL_M_S:
            way = _AxisWay.over(0.0, across_m_s, math.inf, self._limit_m_s2)
            ways.append((_scaled(across, 1.0 / across_m_s), way))
        self._leg = _OrderedWay(here, target_enu_m, now_s, tuple(ways))
        self._ordered = True

    def stop(self, now_s: float) -> None:
        """Brake, and stay where that ends."""
        here, velocity = self._leg.at(now_s)
        speed_m_s = math.hypot(*velocity)
        self._ordered = False
        if speed_m_s <= _STILL_M_S:
            self._leg = _OrderedWay(here, here, now_s)
            return
        way_m = 0.5 * speed_m_s**2 / self._limit_m_s2
        direction = _scaled(velocity, 1.0 / speed_m_s)
        way = _AxisWay.over(way_m, speed_m_s, speed_m_s, self._limit_m_s2)
        self._leg = _OrderedWay(
            here, plus(here, _scaled(direction, way_m)), now_s, ((direction, way),)
        )

    def limit(self, acceleration_m_s2: float) -> None:
        """From the next order on, speeds change with that acceleration.

        Raises:
            ValueError: it is not positive and finite.
        """
        self._limit_m_s2 = finite_acceleration_m_s2(acceleration_m_s2)
