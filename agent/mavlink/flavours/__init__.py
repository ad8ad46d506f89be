"""What differs between autopilot firmwares, one module each."""

from __future__ import annotations

from agent.mavlink.flavours.ardupilot import ArduCopter
from agent.mavlink.flavours.base import Flavour
from agent.mavlink.flavours.px4 import Px4Copter
from agent.mavlink.messages import Heartbeat

__all__ = ["Flavour", "flavour_of"]


def flavour_of(heartbeat: Heartbeat) -> Flavour | None:
    """The flavour that flies the vehicle of that heartbeat; None if none can."""
    flavours: tuple[Flavour, ...] = (ArduCopter(), Px4Copter())
    for flavour in flavours:
        if flavour.flies(heartbeat):
            return flavour
    return None
