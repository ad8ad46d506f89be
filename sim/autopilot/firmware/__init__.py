"""What differs between autopilot firmwares, as models of them, and their choice by name."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim.autopilot.firmware.model import FirmwareModel

__all__ = ["FirmwareModelName", "firmware_model"]


class FirmwareModelName(StrEnum):
    """Firmwares as people name them."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


def firmware_model(name: FirmwareModelName) -> FirmwareModel:
    """The firmware of that name, in its newest version."""
    # Imported late: the command line knows the names without the dialect.
    from sim.autopilot.firmware.ardupilot import ArduCopterModel
    from sim.autopilot.firmware.px4 import Px4Model

    return Px4Model() if name == FirmwareModelName.PX4 else ArduCopterModel()
