"""What differs between autopilot firmwares, one module each."""

from __future__ import annotations

from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.messages import Heartbeat

__all__ = ["firmware_of"]


def firmware_of(heartbeat: Heartbeat) -> Firmware | None:
    """The firmware that flies the vehicle of that heartbeat; None if it is none of ours."""
    firmwares: tuple[Firmware, ...] = (ArduCopter(), Px4Copter())
    return next((firmware for firmware in firmwares if firmware.flies(heartbeat)), None)
