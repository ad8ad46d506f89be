"""How a vehicle flies its legs, as its parameters say: acceleration, jerk, top speed.

A leg from rest to rest takes d/v + v/a at best. What a limit of jerk j costs beyond that:

- ArduCopter, flown to targets, speeds up with that jerk, a/2j later than at once, and brakes along
  v = √(2·a·d) with a gain of j/a at the end (`shape_pos_vel_accel` of its control.cpp), which costs
  nothing until it is as slow as at an arrival.
- PX4 speeds up likewise, and brakes such that v² + b·v = 2·a·d with b = 4·a²/j
  (`computeMaxSpeedFromDistance` of its TrajMath.hpp): integrated down to the speed u of an arrival,
  (2·a/j)·(ln(v/u) − 1) longer than with a all along.

- Rover drives an S-curve, and every change of its acceleration takes a/j: a/j in all.

All are told as the acceleration with which v/a alone takes as long: short legs, on which v is
never reached, differ from that by a tenth of a second.

Sources: AC_WPNav.cpp, AC_PosControl.cpp and mode_guided.cpp of ArduPilot 4.8, its parameter list
for the names and units up to 4.6 (WPNAV_ACCEL [cm/s²], ANGLE_MAX [cdeg], PSC_JERK_XY);
FlightTaskAuto and multicopter_*_params.c of PX4 1.17; AR_WPNav.cpp of Rover 4.8.

Leaves out: speeds up and down, and what drag forbids.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from swarm.model.vehicles import turning_acceleration_m_s2

_GRAVITY_M_S2: Final = 9.80665
_ARRIVAL_M_S: Final = 0.5
"""As slow a vehicle has arrived."""
_ARDUCOPTER_M_S2: Final = 2.5
"""What it flies by where its parameter is 0 (WPNAV_ACCELERATION_MS)."""
_ENDLESS_M_S2: Final = 50.0
"""Of more than that nobody need take account."""


class LegLimit(Enum):
    """What a parameter limits."""

    ACCELERATION = "acceleration"
    JERK = "jerk"
    LEAN = "lean"
    SPEED = "speed"
    THROTTLE = "acceleration of the throttle"
    CIRCLE = "radius of its circles"


_CREDIBLE: Final = {
    LegLimit.ACCELERATION: (0.1, math.inf),
    LegLimit.JERK: (0.1, math.inf),
    LegLimit.LEAN: (1.0, 89.9),
    LegLimit.SPEED: (0.1, math.inf),
    LegLimit.THROTTLE: (0.1, math.inf),
    LegLimit.CIRCLE: (5.0, 10_000.0),
}
"""What is believed: accelerations [m/s²], jerks [m/s³], angles of lean [deg], speeds [m/s] and
radii [m]."""


@dataclass(frozen=True, slots=True)
class LimitParameter:
    """One limit under one of the names that its parameter has had."""

    limit: LegLimit
    name: str
    units_per_si: float = 1.0
    """Value of the parameter at 1 m/s², m/s³, degree or m/s."""


ARDUCOPTER_LIMITS: Final = (
    LimitParameter(LegLimit.ACCELERATION, "WP_ACC"),
    LimitParameter(LegLimit.ACCELERATION, "WPNAV_ACCEL", 100.0),
    LimitParameter(LegLimit.JERK, "PSC_JERK_NE"),
    LimitParameter(LegLimit.JERK, "PSC_NE_JERK"),
    LimitParameter(LegLimit.JERK, "PSC_JERK_XY"),
    LimitParameter(LegLimit.LEAN, "ATC_ANGLE_MAX"),
    LimitParameter(LegLimit.LEAN, "ANGLE_MAX", 100.0),
)
"""It flies as fast over ground as it is told and its angle of lean permits: no parameter says how
fast that is."""
PX4_LIMITS: Final = (
    LimitParameter(LegLimit.ACCELERATION, "MPC_ACC_HOR"),
    LimitParameter(LegLimit.JERK, "MPC_JERK_AUTO"),
    LimitParameter(LegLimit.LEAN, "MPC_TILTMAX_AIR"),
    LimitParameter(LegLimit.SPEED, "MPC_XY_VEL_MAX"),
)
ARDUROVER_LIMITS: Final = (
    LimitParameter(LegLimit.ACCELERATION, "WP_ACCEL"),
    LimitParameter(LegLimit.THROTTLE, "ATC_ACCEL_MAX"),
    LimitParameter(LegLimit.JERK, "WP_JERK"),
)
"""How fast it is able to drive no parameter says."""
QUADPLANE_LIMITS: Final = (LimitParameter(LegLimit.CIRCLE, "WP_LOITER_RAD"),)
"""To the left where it is negative."""

PX4_PLANE_LIMITS: Final = (
    LimitParameter(LegLimit.CIRCLE, "NAV_LOITER_RAD"),
    LimitParameter(LegLimit.SPEED, "FW_AIRSPD_MAX"),
)
"""Of the speed, through the air."""

JerkCost = Callable[[float, float, float], float]
"""Time [s] of a leg beyond d/v + v/a, of speed [m/s], acceleration [m/s²] and jerk [m/s³]."""


def arducopter_jerk_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """See `JerkCost`."""
    del speed_m_s
    return acceleration_m_s2 / (2.0 * jerk_m_s3)


def px4_jerk_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """See `JerkCost`."""
    slowing = max(0.0, math.log(max(1.0, speed_m_s / _ARRIVAL_M_S)) - 1.0)
    return acceleration_m_s2 / jerk_m_s3 * (0.5 + 2.0 * slowing)


def no_jerk_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """See `JerkCost`: of what turns, and is not limited by jerk."""
    del speed_m_s, acceleration_m_s2, jerk_m_s3
    return 0.0


def ardurover_jerk_s(speed_m_s: float, acceleration_m_s2: float, jerk_m_s3: float) -> float:
    """See `JerkCost`."""
    del speed_m_s
    return acceleration_m_s2 / jerk_m_s3


@dataclass(frozen=True, slots=True)
class NamedLimit:
    """A limit, and the parameter that sets it."""

    name: str
    value: float
    """In SI units, lean in degrees."""


@dataclass(frozen=True, slots=True)
class Kinematics:
    """What limits a vehicle on its legs, as far as it is known and to be believed."""

    acceleration: NamedLimit | None
    """[m/s²]; None: not known, or endless."""
    jerk_m_s3: float | None
    speed: NamedLimit | None
    """[m/s]"""
    absurd: tuple[NamedLimit, ...]
    """What nobody would believe."""
    jerk_cost_s: JerkCost
    throttle: NamedLimit | None = None
    """Acceleration that its motors may have [m/s²], where another one limits its legs."""
    circle: NamedLimit | None = None
    """Radius on which it waits, and turns [m]; None of one that stays."""

    def leg_acceleration_m_s2(self, speed_m_s: float) -> float | None:
        """With which d/v + v/a is the time of a leg, the limit of jerk included; None: unknown."""
        if self.circle is not None:
            return turning_acceleration_m_s2(speed_m_s, self.circle.value)
        if self.acceleration is None:
            return None
        set_m_s2 = self.acceleration.value
        speed_m_s = speed_m_s if self.speed is None else min(speed_m_s, self.speed.value)
        if self.jerk_m_s3 is None:
            return set_m_s2
        ramps_s = speed_m_s / set_m_s2 + self.jerk_cost_s(speed_m_s, set_m_s2, self.jerk_m_s3)
        return speed_m_s / ramps_s


def kinematics_of(
    parameters: tuple[LimitParameter, ...], values: Mapping[str, float], jerk_cost_s: JerkCost
) -> Kinematics:
    """What a vehicle is limited by whose parameters have these ``values``, as far as known."""
    limits: dict[LegLimit, NamedLimit] = {}
    absurd = []
    for parameter in parameters:
        if parameter.name not in values or parameter.limit in limits:
            continue
        found = NamedLimit(parameter.name, values[parameter.name] / parameter.units_per_si)
        low, high = _CREDIBLE[parameter.limit]
        if low <= found.value < high:
            limits[parameter.limit] = found
        else:
            absurd.append(found)
    acceleration, lean = limits.get(LegLimit.ACCELERATION), limits.get(LegLimit.LEAN)
    jerk, speed = limits.get(LegLimit.JERK), limits.get(LegLimit.SPEED)
    if lean is not None and acceleration is not None:
        leaning = NamedLimit(lean.name, _GRAVITY_M_S2 * math.tan(math.radians(lean.value)))
        acceleration = min(acceleration, leaning, key=lambda each: each.value)
    if acceleration is not None and acceleration.value > _ENDLESS_M_S2:
        acceleration = None
    jerk_m_s3 = None if jerk is None else jerk.value
    throttle, circle = limits.get(LegLimit.THROTTLE), limits.get(LegLimit.CIRCLE)
    return Kinematics(acceleration, jerk_m_s3, speed, tuple(absurd), jerk_cost_s, throttle, circle)


def arducopter_kinematics(values: Mapping[str, float]) -> Kinematics:
    """Of an ArduCopter; an acceleration of 0 means its own default."""
    known = {
        name: _ARDUCOPTER_M_S2 * parameter.units_per_si
        for parameter in ARDUCOPTER_LIMITS
        if parameter.limit is LegLimit.ACCELERATION and values.get(name := parameter.name) == 0.0
    }
    return kinematics_of(ARDUCOPTER_LIMITS, {**values, **known}, arducopter_jerk_s)


def px4_kinematics(values: Mapping[str, float]) -> Kinematics:
    """Of a PX4."""
    return kinematics_of(PX4_LIMITS, values, px4_jerk_s)


def ardurover_kinematics(values: Mapping[str, float]) -> Kinematics:
    """Of a Rover; limits of 0 are none, and without one of jerk it is as large as acceleration."""
    set_values = {name: value for name, value in values.items() if value != 0.0}
    found = kinematics_of(ARDUROVER_LIMITS, set_values, ardurover_jerk_s)
    slow = [each for each in (found.acceleration, found.throttle) if each is not None]
    acceleration = min(slow, key=lambda each: each.value, default=None)
    jerk_m_s3 = found.jerk_m_s3
    if jerk_m_s3 is None and acceleration is not None:
        jerk_m_s3 = acceleration.value
    return replace(found, acceleration=acceleration, jerk_m_s3=jerk_m_s3)


def quadplane_kinematics(values: Mapping[str, float]) -> Kinematics:
    """Of a QuadPlane, by the radius of its circles."""
    radii_m = {name: abs(value) for name, value in values.items()}
    return kinematics_of(QUADPLANE_LIMITS, radii_m, no_jerk_s)


def px4_plane_kinematics(values: Mapping[str, float]) -> Kinematics:
    """Of a PX4 on wings, by the radius of its circles."""
    radii_m = {name: abs(value) for name, value in values.items()}
    return kinematics_of(PX4_PLANE_LIMITS, radii_m, no_jerk_s)
