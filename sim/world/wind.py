"""Wind: a steady one that slows a vehicle down, and gusts that shake it.

Modelled: a vehicle commands speed over ground, as autopilots do, and leans into the wind for
it; what it cannot exceed is its speed through the air. So a head wind or a strong cross wind
lowers the speed of a leg, and a tail wind does not raise it above the one ordered. Place
holding takes a steady wind out altogether. Gusts move the vehicle sideways about its path by
a sum of sine waves with random periods and phases, each a fixed share of the gust's speed:
smooth, bounded, a function of time. Gusts grow with height and are nothing on the ground.
Leaves out: wind that changes with place or slowly with time, vertical wind, the battery it
takes to fly against wind, and the instants of arrival, which gusts do not move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from sim.world.motion import Motion, Point

_WAVES = 4
_PERIODS_S = (4.0, 20.0)
_GIVE_FRAC = 0.1
"""Greatest speed at which a vehicle is moved by gusts, per speed of the gusts."""
_HALF_HEIGHT_M = 1.0
"""Height at which gusts have half of their effect [m]."""


@dataclass(frozen=True, slots=True)
class Gusts:
    """Sine waves of displacement along one of the two axes each."""

    east: tuple[tuple[float, float, float], ...]
    """Amplitude [m], angular frequency [rad/s] and phase [rad] of each wave."""
    north: tuple[tuple[float, float, float], ...]

    def displacement_m(self, now_s: float) -> tuple[float, float]:
        """Displacement east and north at that instant [m]."""
        return _value(self.east, now_s), _value(self.north, now_s)

    def velocity_m_s(self, now_s: float) -> tuple[float, float]:
        """How fast the displacement changes [m/s]."""
        return _slope(self.east, now_s), _slope(self.north, now_s)


def gusts_of(gust_m_s: float, rng: np.random.Generator) -> Gusts:
    """Gusts of that speed for one vehicle [m/s]."""
    wave_m_s = gust_m_s * _GIVE_FRAC / (_WAVES * math.sqrt(2.0))

    def axis() -> tuple[tuple[float, float, float], ...]:
        periods_s = rng.uniform(*_PERIODS_S, _WAVES)
        phases_rad = rng.uniform(0.0, math.tau, _WAVES)
        return tuple(
            (wave_m_s * period_s / math.tau, math.tau / period_s, phase_rad)
            for period_s, phase_rad in zip(periods_s.tolist(), phases_rad.tolist(), strict=True)
        )

    return Gusts(axis(), axis())


@dataclass(frozen=True, slots=True)
class Wind:
    """The air that a vehicle flies in."""

    velocity_enu_m_s: tuple[float, float] = (0.0, 0.0)
    """East and north, where the wind blows to [m/s]."""
    gusts: Gusts | None = None

    @property
    def speed_m_s(self) -> float:
        """Speed of the steady wind [m/s]."""
        return math.hypot(*self.velocity_enu_m_s)

    def ground_speed_m_s(self, way: Point, ordered_m_s: float, airspeed_m_s: float) -> float:
        """Speed over ground along a way that is in reach [m/s].

        ``way`` has length 1; the greatest speed through the air is above the wind's.
        """
        east_m_s, north_m_s = self.velocity_enu_m_s
        along_m_s = east_m_s * way[0] + north_m_s * way[1]
        across2_m2_s2 = self.speed_m_s**2 - along_m_s**2
        return min(ordered_m_s, along_m_s + math.sqrt(airspeed_m_s**2 - across2_m2_s2))


class WindyMotion:
    """The motion ``still``, of still air, in wind.

    The greatest airspeed is exceeded where a greater speed is ordered, unless it is ``exact``. The
    ground is at ``ground_up_m``.

    Raises:
        ValueError: the vehicle could not fly against the wind.
    """

    def __init__(
        self,
        still: Motion,
        wind: Wind,
        airspeed_m_s: float,
        ground_up_m: float,
        *,
        exact: bool = False,
    ) -> None:
        if not wind.speed_m_s < airspeed_m_s < math.inf:
            raise ValueError(
                f"airspeed must exceed the wind's {wind.speed_m_s} m/s, not be {airspeed_m_s} m/s"
            )
        self._still = still
        self._wind = wind
        self._airspeed_m_s = airspeed_m_s
        self._ground_up_m = ground_up_m
        self._exact = exact

    @property
    def target_enu_m(self) -> Point:
        """Where the vehicle is going to stay, but for gusts [m]."""
        return self._still.target_enu_m

    @property
    def arrives_s(self) -> float | None:
        """When it stops at the target [s]; None once `stop` was called or before any order."""
        return self._still.arrives_s

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        place = self._still.position_enu_m(now_s)
        gusts = self._wind.gusts
        height_m = place[2] - self._ground_up_m
        if gusts is None or height_m <= 0.0:
            return place
        effect_frac, _ = _effect(height_m)
        east_m, north_m = gusts.displacement_m(now_s)
        return place[0] + effect_frac * east_m, place[1] + effect_frac * north_m, place[2]

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        velocity = self._still.velocity_enu_m_s(now_s)
        gusts = self._wind.gusts
        if gusts is None:
            return velocity
        height_m = self._still.position_enu_m(now_s)[2] - self._ground_up_m
        if height_m <= 0.0:
            return velocity
        effect_frac, slope_per_m = _effect(height_m)
        fading_per_s = slope_per_m * velocity[2]
        east_m, north_m = gusts.displacement_m(now_s)
        east_m_s, north_m_s = gusts.velocity_m_s(now_s)
        return (
            velocity[0] + effect_frac * east_m_s + fading_per_s * east_m,
            velocity[1] + effect_frac * north_m_s + fading_per_s * north_m,
            velocity[2],
        )

    def fly_to(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Leave for a target, as fast as was ordered or the wind permits."""
        here = self._still.position_enu_m(now_s)
        length_m = math.dist(here, target_enu_m)
        if length_m > 0.0 and self._wind.speed_m_s > 0.0:
            east, north, up = (
                (to - at) / length_m for to, at in zip(target_enu_m, here, strict=True)
            )
            airspeed_m_s = self._airspeed_m_s
            if not self._exact:
                airspeed_m_s = max(airspeed_m_s, speed_m_s)
            speed_m_s = self._wind.ground_speed_m_s((east, north, up), speed_m_s, airspeed_m_s)
        self._still.fly_to(target_enu_m, speed_m_s, now_s)

    def stop(self, now_s: float) -> None:
        """Stay where the vehicle is, but for gusts."""
        self._still.stop(now_s)

    def limit(self, acceleration_m_s2: float) -> None:
        """As in still air."""
        self._still.limit(acceleration_m_s2)


def _effect(height_m: float) -> tuple[float, float]:
    """Share of the gusts at a height above ground, and its slope [1/m]."""
    low_m2 = _HALF_HEIGHT_M**2
    whole_m2 = height_m**2 + low_m2
    return height_m**2 / whole_m2, 2.0 * height_m * low_m2 / whole_m2**2


def _value(waves: tuple[tuple[float, float, float], ...], now_s: float) -> float:
    return sum(size * math.sin(turn * now_s + phase) for size, turn, phase in waves)


def _slope(waves: tuple[tuple[float, float, float], ...], now_s: float) -> float:
    return sum(size * turn * math.cos(turn * now_s + phase) for size, turn, phase in waves)
