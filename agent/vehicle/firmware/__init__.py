"""What differs between autopilot firmwares, one module each."""

from __future__ import annotations

from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.arduplane import ArduPlane
from agent.vehicle.firmware.ardurover import ArduRover
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.firmware.px4_plane import Px4Plane
from agent.vehicle.firmware.quadplane import QuadPlane
from agent.vehicle.messages import Heartbeat

__all__ = ["firmware_of", "unsupported"]


def firmware_of(heartbeat: Heartbeat) -> Firmware | None:
    """The firmware that flies the vehicle of that heartbeat; None if it is none of ours."""
    ardupilots: tuple[Firmware, ...] = (ArduCopter(), ArduRover(), QuadPlane(), ArduPlane())
    firmwares: tuple[Firmware, ...] = (*ardupilots, Px4Copter(), Px4Plane())
    return next((firmware for firmware in firmwares if firmware.flies(heartbeat)), None)


def unsupported(heartbeat: Heartbeat) -> str:
    """What is to be said of a vehicle that none of them flies."""
    return (
        f"autopilot {heartbeat.autopilot} on vehicle type {heartbeat.vehicle_type} "
        "(MAV_AUTOPILOT, MAV_TYPE) is not supported"
    )
