"""What differs between autopilot firmwares, and their choice by name.

Leaves out: what is common to them (the rest of sim.autopilot).
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sim.autopilot.flavours.base import Flavour

__all__ = ["FlavourName", "flavour_of"]


class FlavourName(StrEnum):
    """Firmwares as people name them."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


def flavour_of(name: FlavourName) -> Flavour:
    """The firmware of that name, in its newest version."""
    # Imported late: the command line knows the names without the dialect.
    from sim.autopilot.flavours.ardupilot import ArduCopter
    from sim.autopilot.flavours.px4 import Px4

    return Px4() if name == FlavourName.PX4 else ArduCopter()
