"""What a simulated vehicle is made of: identity, place, motion, battery and delays.

Leaves out: the parameters a ground station can change (sim.autopilot.params).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.kinematics import IdealMotion, Motion, Point
from sim.smooth_motion import SmoothMotion
from sim.wind import Wind, WindyMotion
from swarm.model.frames import DEFAULT_ORIGIN, Origin

__all__ = ["BatteryFailsafe", "Delays", "VehicleConfig"]

_AIRSPEED_PER_CRUISE = 1.5


@dataclass(frozen=True, slots=True)
class Delays:
    """What the vehicle waits for after power-up, each in seconds since boot.

    Raises:
        ValueError: the stages are not in order.
    """

    boot_s: float = 1.0
    """The autopilot is initialised: its state goes from BOOT to STANDBY."""
    sensors_s: float = 1.0
    """Accelerometers agree; before that no mode can be armed."""
    origin_s: float = 2.0
    """GPS has a fix: origin and home are set, and positions are told."""
    position_s: float = 3.0
    """The estimator uses GPS: modes that navigate can be armed."""

    def __post_init__(self) -> None:
        stages_s = (0.0, self.boot_s, self.sensors_s, self.origin_s, self.position_s)
        if list(stages_s) != sorted(stages_s) or not math.isfinite(self.position_s):
            raise ValueError(f"delays must be >= 0 and in order, not {stages_s[1:]}")


@dataclass(frozen=True, slots=True)
class BatteryFailsafe:
    """Charges at which the firmware acts on its own.

    Raises:
        ValueError: the charges are not in order within 0..1.
    """

    low_frac: float = 0.2
    """It warns and returns."""
    critical_frac: float = 0.1
    """It lands where it is."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.critical_frac <= self.low_frac <= 1.0:
            raise ValueError(
                f"charges must be 0 <= critical <= low <= 1, not {self.critical_frac} and "
                f"{self.low_frac}"
            )


@dataclass(frozen=True, slots=True)
class VehicleConfig:
    """One simulated vehicle.

    Raises:
        ValueError: a number is out of range.
    """

    system_id: int
    """MAVLink system id, 1..254 (255 is customary for ground stations)."""
    start_enu_m: Point = (0.0, 0.0, 0.0)
    """Where it stands at power-up [m]; its third number is the height of the ground there."""
    origin: Origin = DEFAULT_ORIGIN
    """Place of the local frame's zero."""
    cruise_m_s: float = 10.0
    """Speed while navigating [m/s], until a ground station changes it."""
    climb_m_s: float = 2.5
    """Take-off speed [m/s]."""
    land_m_s: float = 1.5
    """Landing speed [m/s]."""
    delays: Delays = Delays()
    spool_up_s: float = 1.0
    """From an accepted take-off to leaving the ground [s]; 3 to 4 on ArduCopter."""
    touchdown_s: float = 1.0
    """Rest on the ground that makes a landing [s]."""
    endurance_s: float | None = None
    """Armed time that empties a full battery [s]; None: it stays full."""
    battery_failsafe: BatteryFailsafe | None = None
    """None: the firmware lets the battery run empty, and the vehicle flies on."""
    position_failsafe_s: float | None = None
    """Time without GPS after which the firmware lands the vehicle [s]; None: it hovers."""
    acceleration_m_s2: float | None = None
    """Greatest acceleration [m/s²]; None: speeds change in no time."""
    wind: Wind | None = None
    """The air it flies in; None: still."""

    def __post_init__(self) -> None:
        if not 1 <= self.system_id <= 254:
            raise ValueError(f"system id must be within 1..254, not {self.system_id}")
        for name in (
            "cruise_m_s",
            "climb_m_s",
            "land_m_s",
            "endurance_s",
            "position_failsafe_s",
            "acceleration_m_s2",
        ):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {value}")
        for name in ("spool_up_s", "touchdown_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be >= 0, not {getattr(self, name)}")
        if self.wind is not None and self.wind.speed_m_s >= self.airspeed_m_s:
            raise ValueError(
                f"wind of {self.wind.speed_m_s:g} m/s is too much for a vehicle that makes "
                f"{self.airspeed_m_s:g} m/s through the air"
            )

    @property
    def airspeed_m_s(self) -> float:
        """Greatest speed through the air [m/s]: half as much again as the cruise speed."""
        return _AIRSPEED_PER_CRUISE * self.cruise_m_s

    def motion(self) -> Motion:
        """How it moves from its start on."""
        motion: Motion = IdealMotion(self.start_enu_m)
        if self.acceleration_m_s2 is not None:
            motion = SmoothMotion(self.start_enu_m, self.acceleration_m_s2)
        if self.wind is not None:
            motion = WindyMotion(motion, self.wind, self.airspeed_m_s, self.start_enu_m[2])
        return motion
