"""ArduPilot's planes that take off and land upright (QuadPlanes), as ArduPlane 4.8 behaves.

In GUIDED one rises on its rotors, flies to targets on its wings and waits on a circle round them,
as wide as WP_LOITER_RAD; where Q_GUIDED_MODE is 1 it hovers over them, having passed that circle.
It comes home by QRTL, which lands it upright where it took off, and disarms it. Planes tell their
kind by Q_MAV_TYPE: where that is 0 they say that they are planes like any other, and are not flown.

Leaves out: planes that need a runway (agent.vehicle.firmware.arduplane), landings elsewhere than at
home, lines, zones (a scenario with such is refused) and commanding by missions.

Sources: https://ardupilot.org/plane/docs/quadplane-flying.html; GCS_MAVLink_Plane.cpp,
mode_guided.cpp, mode_qrtl.cpp, quadplane.cpp and Parameters.cpp of ArduPilot 4.8.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from agent.vehicle.firmware.ardupilot import ArduPilot
from agent.vehicle.firmware.failsafes import QUADPLANE_NAMES, Failsafes, quadplane_failsafes
from agent.vehicle.firmware.fences import ARDUCOPTER_FENCE_NAMES
from agent.vehicle.firmware.kinematics import (
    QUADPLANE_LIMITS,
    Kinematics,
    quadplane_kinematics,
)
from agent.vehicle.firmware.profile import UNCHANGED, Mode
from agent.vehicle.messages import CommandLong
from swarm.model.vehicles import VehicleKind

_AUTO, _RTL, _GUIDED, _QLAND, _QRTL, _AUTOLAND = (10,), (11,), (15,), (20,), (21,), (26,)
_CMD_NAV_TAKEOFF = 22
_CMD_DO_CHANGE_SPEED = 178
_AIRSPEED = 0.0


class WingedArduPilot(ArduPilot):
    """What ArduPlane does whatever it flies."""

    takes_missions = False
    mode_names = MappingProxyType(
        {
            (0,): "MANUAL",
            (1,): "CIRCLE",
            (2,): "STABILIZE",
            (3,): "TRAINING",
            (4,): "ACRO",
            (5,): "FBWA",
            (6,): "FBWB",
            (7,): "CRUISE",
            (8,): "AUTOTUNE",
            _AUTO: "AUTO",
            _RTL: "RTL",
            (12,): "LOITER",
            (13,): "TAKEOFF",
            (14,): "AVOID_ADSB",
            _GUIDED: "GUIDED",
            (16,): "INITIALISING",
            (17,): "QSTABILIZE",
            (18,): "QHOVER",
            (19,): "QLOITER",
            _QLAND: "QLAND",
            _QRTL: "QRTL",
            (22,): "QAUTOTUNE",
            (23,): "QACRO",
            (24,): "THERMAL",
            (25,): "LOITER_ALT_QLAND",
            _AUTOLAND: "AUTOLAND",
        }
    )
    commanded_mode: ClassVar[Mode] = _GUIDED
    mission_mode: ClassVar[Mode] = _AUTO
    speed_parameters = ()
    """AIRSPEED_CRUISE may lie outside of what the plane can fly; the command is refused then."""
    limit_parameters = QUADPLANE_LIMITS
    fence_names = ARDUCOPTER_FENCE_NAMES

    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """By its turns."""
        return quadplane_kinematics(values)

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """ArduPlane reads the height as above where it stands."""
        return CommandLong(_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, alt_m - home_alt_m))

    def change_speed(self, speed_m_s: float) -> CommandLong:
        """Speed through the air; a ground speed would be the least one that it keeps."""
        params = (_AIRSPEED, speed_m_s, UNCHANGED, 0.0, 0.0, 0.0, 0.0)
        return CommandLong(_CMD_DO_CHANGE_SPEED, params)


class QuadPlane(WingedArduPilot):
    """The firmware of ArduPilot's planes, of those with rotors."""

    name = "QuadPlane"
    kind = VehicleKind.QUADPLANE
    vehicle_types = frozenset({19, 20, 21, 22, 23, 24, 25})
    """MAV_TYPE of tailsitters, tiltrotors, fixed rotors and tilted wings."""
    return_mode = _QRTL
    land_mode = _QLAND
    returning_modes = frozenset({_RTL, _QLAND, _QRTL, _AUTOLAND})
    failsafe_names = QUADPLANE_NAMES

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It listens to the heartbeats of certain system ids only."""
        return quadplane_failsafes(values, own_system_id)
