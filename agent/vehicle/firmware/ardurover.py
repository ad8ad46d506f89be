"""ArduPilot's rovers, and boats, as Rover 4.8 behaves.

They are armed and drive: there is no take-off and no landing, and heights of targets are not
heeded. A rover that has come home stands there, its motors running, until it is disarmed.

Leaves out: commanding by missions, and boats that cannot hold their place (Rover lets them loiter).

Sources: https://ardupilot.org/rover/docs/rover-control-modes.html; GCS_MAVLink_Rover.cpp,
mode_guided.cpp, mode_rtl.cpp and failsafe.cpp of ArduPilot 4.8 for what commands and modes do.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NoReturn

from agent.vehicle.firmware.ardupilot import ArduPilot
from agent.vehicle.firmware.failsafes import ARDUROVER_NAMES, Failsafes, ardurover_failsafes
from agent.vehicle.firmware.fences import ARDUCOPTER_FENCE_NAMES
from agent.vehicle.firmware.kinematics import (
    ARDUROVER_LIMITS,
    Kinematics,
    ardurover_kinematics,
)
from agent.vehicle.firmware.profile import SpeedParameter
from swarm.model.vehicles import VehicleKind

_HOLD, _AUTO, _RTL, _SMART_RTL, _GUIDED = (4,), (10,), (11,), (12,), (15,)


class ArduRover(ArduPilot):
    """The firmware of ArduPilot's rovers."""

    name = "Rover"
    kind = VehicleKind.ROVER
    vehicle_types = frozenset({10, 11})
    """Ground rover and surface boat."""
    takes_missions = False
    stops_within_m = 4.0
    """It has arrived within WP_RADIUS, 2 m by default and 3 m in its own simulator, and brakes
    then."""
    disarms_itself = False
    mode_names = MappingProxyType(
        {
            (0,): "MANUAL",
            (1,): "ACRO",
            (3,): "STEERING",
            _HOLD: "HOLD",
            (5,): "LOITER",
            (6,): "FOLLOW",
            (7,): "SIMPLE",
            (8,): "DOCK",
            (9,): "CIRCLE",
            _AUTO: "AUTO",
            _RTL: "RTL",
            _SMART_RTL: "SMART_RTL",
            _GUIDED: "GUIDED",
            (16,): "INITIALISING",
        }
    )
    commanded_mode = _GUIDED
    mission_mode = _AUTO
    return_mode = _RTL
    land_mode = _HOLD
    """In which it stops, and can be disarmed."""
    returning_modes = frozenset({_HOLD, _RTL, _SMART_RTL})
    speed_parameters = (SpeedParameter("WP_SPEED", 1.0),)
    failsafe_names = ARDUROVER_NAMES
    limit_parameters = ARDUROVER_LIMITS
    fence_names = ARDUCOPTER_FENCE_NAMES

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It stands where it was sent, whoever falls silent."""
        del own_system_id
        return ardurover_failsafes(values)

    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """On straight legs; turns are left out."""
        return ardurover_kinematics(values)

    def takeoff(self, alt_m: float, home_alt_m: float) -> NoReturn:
        """There is none.

        Raises:
            ValueError: always.
        """
        del alt_m, home_alt_m
        raise ValueError("a rover does not take off")
