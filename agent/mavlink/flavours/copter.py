"""What multicopters of every firmware are told alike.

Leaves out: modes, takeoff and targets, in which firmwares differ.

Commands: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

from agent.mavlink.messages import CommandLong, Parameter

__all__ = ["COPTER_TYPES", "UNCHANGED", "Copter", "set_mode"]

COPTER_TYPES = frozenset({2, 3, 4, 13, 14, 15, 29, 35})
"""MAV_TYPE of quad-, coaxial, heli-, hexa-, octo-, tri-, dodeca- and decacopter."""
UNCHANGED = -1.0
"""What leaves a speed or throttle as it is."""

_CMD_DO_SET_MODE = 176
_CMD_DO_CHANGE_SPEED = 178
_CMD_COMPONENT_ARM_DISARM = 400
_CUSTOM_MODE_ENABLED = 1.0
_GROUND_SPEED = 1.0


class Copter:
    """The part that flavours of multicopters share."""

    def arm(self) -> CommandLong:
        """Start the motors, with all checks."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def disarm(self) -> CommandLong:
        """Stop the motors; refused in the air."""
        return CommandLong(_CMD_COMPONENT_ARM_DISARM, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))

    def value_of(self, parameter: Parameter) -> float:
        """Whole numbers are told as such, in the float."""
        return parameter.value

    def change_speed(self, speed_m_s: float) -> CommandLong:
        """Ground speed from now on.

        ArduPilot forgets it when GUIDED is entered or takeoff ends, so it is set after; for
        PX4 it counts for what is flown now, and targets bring their own.
        """
        params = (_GROUND_SPEED, speed_m_s, UNCHANGED, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(_CMD_DO_CHANGE_SPEED, params)


def set_mode(main: int, sub: int = 0) -> CommandLong:
    """Switch to a mode by the numbers of the firmware."""
    params = (_CUSTOM_MODE_ENABLED, float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
    return CommandLong(_CMD_DO_SET_MODE, params)
