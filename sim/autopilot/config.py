"""What a simulated vehicle is made of: identity, place, speeds and delays.

Leaves out: the parameters a ground station can change (sim.autopilot.params).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.kinematics import Point
from swarm.model.frames import DEFAULT_ORIGIN, Origin

__all__ = ["Delays", "VehicleConfig"]


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

    def __post_init__(self) -> None:
        if not 1 <= self.system_id <= 254:
            raise ValueError(f"system id must be within 1..254, not {self.system_id}")
        for name in ("cruise_m_s", "climb_m_s", "land_m_s", "endurance_s"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < math.inf:
                raise ValueError(f"{name} must be positive and finite, not {value}")
        for name in ("spool_up_s", "touchdown_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be >= 0, not {getattr(self, name)}")
