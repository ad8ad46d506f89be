"""Flight modes, whatever number a flavour gives them.

Leaves out: numbers (sim.autopilot.flavours) and what flying in them means
(sim.autopilot.pilot).
"""

from __future__ import annotations

from enum import Enum

__all__ = ["Mode"]


class Mode(Enum):
    """What the vehicle flies by; the value is the name people see on ArduPilot."""

    MANUAL = "MANUAL"
    STABILIZE = "STABILIZE"
    ALT_HOLD = "ALT_HOLD"
    LOITER = "LOITER"
    POSHOLD = "POSHOLD"
    BRAKE = "BRAKE"
    GUIDED = "GUIDED"
    TAKEOFF = "TAKEOFF"
    AUTO = "AUTO"
    RTL = "RTL"
    LAND = "LAND"

    @property
    def needs_position(self) -> bool:
        """Whether it can be armed, or entered in flight, only with a position estimate."""
        return self.controls_position and self is not Mode.LAND

    @property
    def controls_position(self) -> bool:
        """Whether the autopilot itself holds the horizontal position."""
        return self not in (Mode.MANUAL, Mode.STABILIZE, Mode.ALT_HOLD)
