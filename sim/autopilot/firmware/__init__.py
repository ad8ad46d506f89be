"""What differs between autopilot firmwares, as models of them, and their choice by name."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import Fault, InputError

if TYPE_CHECKING:
    from sim.autopilot.firmware.model import FirmwareModel

__all__ = ["SIMULATED", "FirmwareModelName", "check_simulated", "firmware_model"]


class FirmwareModelName(StrEnum):
    """Firmwares as people name them."""

    ARDUPILOT = "ardupilot"
    PX4 = "px4"


SIMULATED: Final[Mapping[FirmwareModelName, frozenset[VehicleKind]]] = MappingProxyType(
    {
        FirmwareModelName.ARDUPILOT: frozenset(
            {
                VehicleKind.COPTER,
                VehicleKind.ROVER,
                VehicleKind.QUADPLANE,
                VehicleKind.PLANE,
            }
        ),
        FirmwareModelName.PX4: frozenset({VehicleKind.COPTER, VehicleKind.PLANE}),
    }
)
"""Which kinds of vehicles there are of each."""


def check_simulated(
    name: FirmwareModelName, vehicles: Collection[VehicleKind], source: str
) -> None:
    """Refuse vehicles of which there are none of that firmware; ``source`` asks for it.

    Raises:
        InputError: there is one.
    """
    for vehicle in vehicles:
        if vehicle not in SIMULATED[name]:
            problem = f"no {vehicle} is simulated with that firmware"
            have = [each for each in FirmwareModelName if vehicle in SIMULATED[each]]
            remedy = f"take {' or '.join(have)}, or make it a copter"
            raise InputError(Fault(source, name, problem, remedy))


def firmware_model(
    name: FirmwareModelName, vehicle: VehicleKind = VehicleKind.COPTER
) -> FirmwareModel:
    """The firmware of that name for that kind of vehicle, in its newest version.

    Raises:
        ValueError: there is none of that kind.
    """
    if vehicle not in SIMULATED[name]:
        raise ValueError(f"no {vehicle} is simulated with {name}")
    # Imported late: the command line knows the names without the dialect.
    from sim.autopilot.firmware.ardupilot import ArduCopterModel
    from sim.autopilot.firmware.arduplane import ArduPlaneModel
    from sim.autopilot.firmware.ardurover import ArduRoverModel
    from sim.autopilot.firmware.px4 import Px4Model
    from sim.autopilot.firmware.px4_plane import Px4PlaneModel
    from sim.autopilot.firmware.quadplane import QuadPlaneModel

    if vehicle is VehicleKind.ROVER:
        return ArduRoverModel()
    if vehicle is VehicleKind.QUADPLANE:
        return QuadPlaneModel()
    if vehicle is VehicleKind.PLANE:
        return Px4PlaneModel() if name == FirmwareModelName.PX4 else ArduPlaneModel()
    return Px4Model() if name == FirmwareModelName.PX4 else ArduCopterModel()
