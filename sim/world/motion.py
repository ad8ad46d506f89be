"""How simulated vehicles move, in closed form: at constant speed, or with limited acceleration.

Positions are functions of time, not sums of steps, so they carry no integration error, do not
depend on how often they are asked for, and may be asked for in any order.

With limited acceleration a leg from rest is a trapezoid of speed. A vehicle that already moves
towards the target begins the trapezoid at its speed. One that moves elsewhere does two things at
once: it brakes to the place where its velocity ends, and flies a trapezoid from there to the
target; of the acceleration each gets a share, by the speed it had and the speed ordered. The sum
of both is continuous in place and velocity, ends at rest at the target, never accelerates more than
allowed and is never faster than the greater of those speeds: from one to the other it changes
evenly.

Leaves out: wind (`sim.world.wind`), which stands behind `Motion` in `IdealMotion`'s place, limits
of jerk, separate limits for climbing, attitude, and the ground, which a vehicle that turns round
while descending may dip below by its braking distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from swarm.allocation.problem import rest_to_rest_s

Point = tuple[float, float, float]
"""East, north, up [m] of a place, or [m/s] of a velocity, in the mission's local frame."""

_AT_REST: Point = (0.0, 0.0, 0.0)


def finite_acceleration_m_s2(given_m_s2: float) -> float:
    """That acceleration, with which speeds change in some time.

    Raises:
        ValueError: it is not positive and finite.
    """
    if not 0.0 < given_m_s2 < math.inf:
        raise ValueError(f"acceleration must be positive and finite, not {given_m_s2} m/s²")
    return given_m_s2


def plus(a: Point, b: Point) -> Point:
    """Sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Point, b: Point) -> Point:
    """Difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def between(start: Point, stop: Point, frac: float) -> Point:
    """The place that share of the way from start to stop; exactly the stop at 1."""
    return stop if frac >= 1.0 else plus(start, _scaled(minus(stop, start), frac))


def _scaled(a: Point, by: float) -> Point:
    return a[0] * by, a[1] * by, a[2] * by


def _check_speed(speed_m_s: float) -> None:
    if not 0.0 < speed_m_s < math.inf:
        raise ValueError(f"speed must be positive and finite, not {speed_m_s} m/s")


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

    def limit(self, acceleration_m_s2: float) -> None:
        """From the next order on, speeds change with that acceleration where they take time."""
        ...


def flown_s(length_m: float, speed_m_s: float, acceleration_m_s2: float | None) -> float:
    """Time of a leg as plans have it, from rest to rest [s]; None: speed changes at once."""
    if acceleration_m_s2 is None:
        return length_m / speed_m_s
    return float(rest_to_rest_s(np.asarray(length_m), speed_m_s, acceleration_m_s2))


class IdealMotion:
    """Straight to the target at the ordered speed, stopping and turning in no time.

    With an acceleration it sets off from rest and brakes to rest, as plans have it, so that it
    arrives when they say; only where it is told to go elsewhere on its way it stops in no time.
    """

    def __init__(self, start_enu_m: Point) -> None:
        self.target_enu_m = start_enu_m
        """Where the vehicle is going to stop [m]."""
        self.arrives_s: float | None = None
        """When the last ordered target is reached [s], also if that is past."""
        self.start_enu_m = start_enu_m
        """Where it has set off [m]."""
        self.leaves_s = 0.0
        """When [s]."""
        self.ramps: Ramps | None = None
        """Of the way with acceleration."""

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]; the target exactly from the arrival on."""
        if self.arrives_s is None or now_s >= self.arrives_s:
            return self.target_enu_m
        if now_s <= self.leaves_s:
            return self.start_enu_m
        flown_frac = (now_s - self.leaves_s) / (self.arrives_s - self.leaves_s)
        if self.ramps is not None:
            duration_s = self.ramps.duration_s
            flown_frac = self.ramps.flown_m(flown_frac * duration_s) / self.ramps.length_m
        return between(self.start_enu_m, self.target_enu_m, flown_frac)

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]; zero before the start and from the arrival on."""
        if self.arrives_s is None or not self.leaves_s <= now_s < self.arrives_s:
            return _AT_REST
        duration_s = self.arrives_s - self.leaves_s
        way_m = minus(self.target_enu_m, self.start_enu_m)
        if self.ramps is not None:
            speed_m_s = self.ramps.speed_m_s(now_s - self.leaves_s)
            return _scaled(way_m, speed_m_s / self.ramps.length_m)
        east_m, north_m, up_m = way_m
        return east_m / duration_s, north_m / duration_s, up_m / duration_s

    def fly_to(
        self,
        target_enu_m: Point,
        speed_m_s: float,
        now_s: float,
        acceleration_m_s2: float | None = None,
    ) -> None:
        """Leave for ``target_enu_m`` at once; with an acceleration, from rest to rest.

        Raises:
            ValueError: the speed is not positive and finite.
        """
        _check_speed(speed_m_s)
        self.start_enu_m, self.leaves_s = self.position_enu_m(now_s), now_s
        self.target_enu_m = target_enu_m
        length_m = math.dist(self.start_enu_m, target_enu_m)
        self.arrives_s = now_s + flown_s(length_m, speed_m_s, acceleration_m_s2)
        self.ramps = None
        if acceleration_m_s2 is not None:
            ramps = ramps_over(length_m, 0.0, speed_m_s, acceleration_m_s2, acceleration_m_s2)
            self.ramps = ramps if ramps.length_m > 0.0 else None

    def stop(self, now_s: float) -> None:
        """Stay where the vehicle is."""
        self.target_enu_m = self.position_enu_m(now_s)
        self.arrives_s = None

    def limit(self, acceleration_m_s2: float) -> None:
        """Nothing: speeds change at once, or as each order says."""


_SAME_WAY = 1e-6
"""How exactly, as a share, a vehicle must move towards its target and have room to brake
to be said to do so: it may be asked anew for what it does already."""
_LEAST_SHARE = 0.01
"""Of the acceleration, for either."""


@dataclass(frozen=True, slots=True)
class Ramps:
    """Speed along a line: from one speed to a second, there for a while, then to rest."""

    first_m_s: float
    cruise_m_s: float
    change_m_s2: float
    """Acceleration to the cruise speed; negative when it is the lower one."""
    brake_m_s2: float
    change_s: float
    cruise_s: float

    @property
    def braking_s(self) -> float:
        """When the last ramp begins [s]."""
        return self.change_s + self.cruise_s

    @property
    def duration_s(self) -> float:
        """When the vehicle is at rest [s]."""
        return self.braking_s + self.cruise_m_s / self.brake_m_s2

    @property
    def length_m(self) -> float:
        """Way flown in all [m]."""
        return self.flown_m(self.duration_s)

    def speed_m_s(self, at_s: float) -> float:
        """Speed after a time [m/s]."""
        if at_s <= self.change_s:
            return self.first_m_s + self.change_m_s2 * at_s
        return self.cruise_m_s - self.brake_m_s2 * max(0.0, at_s - self.braking_s)

    def reached_s(self, way_m: float) -> float:
        """When so much of the way is flown [s]; the inverse of `flown_m`."""
        change_m, length_m = self.flown_m(self.change_s), self.length_m
        if way_m >= length_m:
            return self.duration_s
        if way_m <= change_m:
            root_m_s = math.sqrt(max(0.0, self.first_m_s**2 + 2.0 * self.change_m_s2 * way_m))
            both_m_s = self.first_m_s + root_m_s
            return 2.0 * way_m / both_m_s if both_m_s > 0.0 else 0.0
        if way_m <= self.flown_m(self.braking_s):
            return self.change_s + (way_m - change_m) / self.cruise_m_s
        return self.duration_s - math.sqrt(2.0 * (length_m - way_m) / self.brake_m_s2)

    def flown_m(self, at_s: float) -> float:
        """Way flown after a time [m]."""
        changing_s = min(at_s, self.change_s)
        braking_s = max(0.0, at_s - self.braking_s)
        return (
            changing_s * (self.first_m_s + 0.5 * self.change_m_s2 * changing_s)
            + max(0.0, at_s - changing_s) * self.cruise_m_s
            - 0.5 * self.brake_m_s2 * braking_s**2
        )


def ramps_over(
    length_m: float, first_m_s: float, speed_m_s: float, change_m_s2: float, brake_m_s2: float
) -> Ramps:
    """The fastest way over a length that leaves room to brake from the first speed."""
    if first_m_s > speed_m_s:
        cruise_m_s, change_m_s2 = speed_m_s, -brake_m_s2
    else:
        both_m_s2 = change_m_s2 + brake_m_s2
        # Written with ratios, so that a very great acceleration does not overflow.
        peak_m_s = math.sqrt(
            2.0 * length_m * change_m_s2 * (brake_m_s2 / both_m_s2)
            + first_m_s**2 * (brake_m_s2 / both_m_s2)
        )
        cruise_m_s = max(first_m_s, min(speed_m_s, peak_m_s))
    change_s = (cruise_m_s - first_m_s) / change_m_s2
    ramped_m = 0.5 * (first_m_s + cruise_m_s) * change_s + 0.5 * cruise_m_s**2 / brake_m_s2
    cruise_s = max(0.0, length_m - ramped_m) / cruise_m_s if cruise_m_s > 0.0 else 0.0
    return Ramps(first_m_s, cruise_m_s, change_m_s2, brake_m_s2, change_s, cruise_s)


@dataclass(frozen=True, slots=True)
class _Part:
    """A straight way flown by ramps; a path is the sum of its parts."""

    way: Point
    """Direction, of length 1."""
    ramps: Ramps
    end_m: Point
    """Displacement in the end, exactly."""

    def displacement_m(self, at_s: float) -> Point:
        if at_s >= self.ramps.duration_s:
            return self.end_m
        return _scaled(self.way, self.ramps.flown_m(at_s))

    def velocity_m_s(self, at_s: float) -> Point:
        if at_s >= self.ramps.duration_s:
            return _AT_REST
        return _scaled(self.way, self.ramps.speed_m_s(at_s))


@dataclass(frozen=True, slots=True)
class _Path:
    """All that was ordered, from one instant on."""

    start_enu_m: Point
    target_enu_m: Point
    leaves_s: float
    parts: tuple[_Part, ...] = ()

    @property
    def arrives_s(self) -> float:
        return self.leaves_s + max((part.ramps.duration_s for part in self.parts), default=0.0)

    def position_enu_m(self, now_s: float) -> Point:
        if now_s >= self.arrives_s:
            return self.target_enu_m
        at_s = max(0.0, now_s - self.leaves_s)
        place = self.start_enu_m
        for part in self.parts:
            place = plus(place, part.displacement_m(at_s))
        return place

    def velocity_enu_m_s(self, now_s: float) -> Point:
        if now_s >= self.arrives_s:
            return _AT_REST
        at_s = max(0.0, now_s - self.leaves_s)
        velocity = _AT_REST
        for part in self.parts:
            velocity = plus(velocity, part.velocity_m_s(at_s))
        return velocity


class SmoothMotion:
    """Straight to the target where that is possible, with limited acceleration everywhere.

    Raises:
        ValueError: the acceleration is not positive and finite.
    """

    def __init__(self, start_enu_m: Point, acceleration_m_s2: float) -> None:
        self.limit(acceleration_m_s2)
        self._path = _Path(start_enu_m, start_enu_m, 0.0)
        self._ordered = False

    @property
    def target_enu_m(self) -> Point:
        """Where the vehicle is going to stop [m]; after `stop`, the end of its braking."""
        return self._path.target_enu_m

    @property
    def arrives_s(self) -> float | None:
        """When the last ordered target is reached [s], also if that is past."""
        return self._path.arrives_s if self._ordered else None

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        return self._path.position_enu_m(now_s)

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        return self._path.velocity_enu_m_s(now_s)

    def fly_to(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Turn towards ``target_enu_m`` at once.

        Raises:
            ValueError: the speed is not positive and finite.
        """
        _check_speed(speed_m_s)
        here, velocity = self.position_enu_m(now_s), self.velocity_enu_m_s(now_s)
        parts = self._straight_on(here, velocity, target_enu_m, speed_m_s)
        if parts is None:
            parts = self._round_the_bend(here, velocity, target_enu_m, speed_m_s)
        self._path = _Path(here, target_enu_m, now_s, parts)
        self._ordered = True

    def stop(self, now_s: float) -> None:
        """Brake, and stay where that ends."""
        here, velocity = self.position_enu_m(now_s), self.velocity_enu_m_s(now_s)
        brake = _brake(velocity, self._acceleration_m_s2)
        target_enu_m = here if brake is None else plus(here, brake.end_m)
        self._path = _Path(here, target_enu_m, now_s, () if brake is None else (brake,))
        self._ordered = False

    def limit(self, acceleration_m_s2: float) -> None:
        """From the next order on, speeds change with that acceleration.

        Raises:
            ValueError: it is not positive and finite.
        """
        self._acceleration_m_s2 = finite_acceleration_m_s2(acceleration_m_s2)

    def _straight_on(
        self, here: Point, velocity: Point, target_enu_m: Point, speed_m_s: float
    ) -> tuple[_Part, ...] | None:
        """The way of a vehicle that rests, or moves towards the target and can stop there."""
        limit_m_s2 = self._acceleration_m_s2
        first_m_s = math.hypot(*velocity)
        length_m = math.dist(here, target_enu_m)
        if first_m_s > 0.0:
            braking_m = 0.5 * first_m_s**2 / limit_m_s2
            if length_m == 0.0 or length_m * (1.0 + _SAME_WAY) < braking_m:
                return None
            way = _scaled(minus(target_enu_m, here), 1.0 / length_m)
            if math.dist(velocity, _scaled(way, first_m_s)) > _SAME_WAY * first_m_s:
                return None
        return _part(here, target_enu_m, first_m_s, speed_m_s, limit_m_s2, limit_m_s2)

    def _round_the_bend(
        self, here: Point, velocity: Point, target_enu_m: Point, speed_m_s: float
    ) -> tuple[_Part, ...]:
        """The way of a vehicle that moves elsewhere than to its target."""
        limit_m_s2, first_m_s = self._acceleration_m_s2, math.hypot(*velocity)
        # So it has stopped moving elsewhere when it is as fast as ordered. With equal shares one
        # that had all but stopped would speed up half as fast as it can.
        share = max(_LEAST_SHARE, min(1.0 - _LEAST_SHARE, first_m_s / (first_m_s + speed_m_s)))
        braking_m_s2 = limit_m_s2 * share
        left_m_s2 = limit_m_s2 - braking_m_s2
        brake = _brake(velocity, braking_m_s2)
        if brake is None:
            raise ValueError("a vehicle at rest flies straight on")
        bend = plus(here, brake.end_m)
        way = _part(bend, target_enu_m, 0.0, speed_m_s, left_m_s2, limit_m_s2)
        if way and way[0].ramps.braking_s < brake.ramps.duration_s:
            way = _part(bend, target_enu_m, 0.0, speed_m_s, left_m_s2, left_m_s2)
        return (brake, *way)


def _part(
    start: Point,
    end: Point,
    first_m_s: float,
    speed_m_s: float,
    change_m_s2: float,
    brake_m_s2: float,
) -> tuple[_Part, ...]:
    """A way between two places; none when they are the same."""
    whole = minus(end, start)
    length_m = math.hypot(*whole)
    if length_m == 0.0:
        return ()
    ramps = ramps_over(length_m, first_m_s, speed_m_s, change_m_s2, brake_m_s2)
    return (_Part(_scaled(whole, 1.0 / length_m), ramps, whole),)


def _brake(velocity: Point, brake_m_s2: float) -> _Part | None:
    """The way to rest from a velocity; None at rest."""
    speed_m_s = math.hypot(*velocity)
    if speed_m_s == 0.0:
        return None
    way = _scaled(velocity, 1.0 / speed_m_s)
    ramps = Ramps(speed_m_s, speed_m_s, 0.0, brake_m_s2, 0.0, 0.0)
    return _Part(way, ramps, _scaled(way, 0.5 * speed_m_s**2 / brake_m_s2))
