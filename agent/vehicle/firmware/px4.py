"""PX4, and its multicopters, as PX4 1.17 behaves.

Leaves out: planes (agent.vehicle.firmware.px4_plane), VTOL and rovers.

Sources: https://docs.px4.io/main/en/flight_modes_mc/ for what the modes do, and
https://mavlink.io/en/messages/common.html for the commands; how they are acknowledged
is not written anywhere, but recorded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from agent.vehicle.firmware.failsafes import PX4_NAMES, Failsafes, px4_failsafes
from agent.vehicle.firmware.fences import PX4_FENCE_NAMES, FenceSetup, px4_fence
from agent.vehicle.firmware.kinematics import PX4_LIMITS, Kinematics, px4_kinematics
from agent.vehicle.firmware.profile import UNCHANGED, Firmware, Mode, SpeedParameter
from agent.vehicle.messages import (
    CommandLong,
    EkfStatus,
    ExtendedState,
    Heartbeat,
    LandedState,
    ParameterValue,
    SystemStatus,
)
from agent.vehicle.parameter_override import OverrideSpec
from agent.vehicle.state import VehicleState

_AUTO = 4
_TAKEOFF, _LOITER, _MISSION = (_AUTO, 2), (_AUTO, 3), (_AUTO, 4)
_RTL, _LAND, _PRECLAND = (_AUTO, 5), (_AUTO, 6), (_AUTO, 9)

_STATE_CRITICAL, _STATE_EMERGENCY = 5, 6
_OUTSIDE_FENCE = "outside geofence"
_FENCE_IGNORED = "geofence invalid"
_CMD_NAV_TAKEOFF = 22
_CMD_DO_SET_MODE = 176
_CMD_DO_REPOSITION = 192
_CHANGE_MODE = 1.0
"""MAV_DO_REPOSITION_FLAGS_CHANGE_MODE."""
_WAYPOINT_RADIUS_M = 2.0
"""As ArduCopter's, within which a vehicle is as good as at its waypoint."""


class Px4(Firmware):
    """What PX4 does whatever it flies."""

    autopilot = 12
    name = "PX4"
    mode_names = MappingProxyType(
        {
            (1, 0): "MANUAL",
            (2, 0): "ALTCTL",
            (3, 0): "POSCTL",
            (3, 1): "POSCTL.ORBIT",
            (3, 2): "POSCTL.SLOW",
            (_AUTO, 1): "AUTO.READY",
            _TAKEOFF: "AUTO.TAKEOFF",
            _LOITER: "AUTO.LOITER",
            _MISSION: "AUTO.MISSION",
            _RTL: "AUTO.RTL",
            _LAND: "AUTO.LAND",
            (_AUTO, 8): "AUTO.FOLLOW",
            _PRECLAND: "AUTO.PRECLAND",
            (5, 0): "ACRO",
            (6, 0): "OFFBOARD",
            (7, 0): "STABILIZED",
            (8, 0): "RATTITUDE",
            (10, 0): "TERMINATION",
        }
    )
    commanded_mode = _LOITER
    commanded_mode_name = "AUTO.LOITER (Hold)"
    """Called Hold by ground stations."""
    commanded_by_choice = False
    """PX4 boots into Hold and ends takeoffs, missions and landings there; people hover in it. So
    it does not tell that anybody gave the vehicle to us, and a pilot who chooses Hold is not
    seen to have taken it over."""
    pilots_stop_it_there = True
    """A ground station pauses it in Hold."""
    takeoff_mode = _TAKEOFF
    """Until the height is reached."""
    mission_mode = _MISSION
    """Acknowledged even if there is no mission to fly."""
    return_mode = _RTL
    land_mode = _LAND
    returning_modes = frozenset({_RTL, _LAND, _PRECLAND})
    failsafe_names = PX4_NAMES
    fence_names = PX4_FENCE_NAMES
    streams = ((1, SystemStatus), (230, EkfStatus), (245, ExtendedState))
    """What comes too seldom unasked. EKF_STATUS_REPORT does not exist, and MISSION_CURRENT streams
    by itself: asked for either, PX4 answers "failed"."""
    mission_vehicle_items = 0
    """Item 0 is flown like any other."""
    missions_give_way = False
    """It knows no such item."""
    missions_begin_anew = True
    """Taken over with its last item, current one included (`MavlinkMissionManager`)."""
    targets_turn_nose = True
    """What is looked at turns the nose in missions alone (`MissionBase::heading_sp_update`)."""
    acknowledged_twice = frozenset({_CMD_DO_SET_MODE})
    """Within a few milliseconds."""

    def mode(self, custom_mode: int) -> Mode:
        """Main and sub mode."""
        return custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF

    def has_rebooted(self, before: Heartbeat, heartbeat: Heartbeat) -> bool:
        """It flew, and is "uninitialised": disarmed, it is so whenever its checks fail.

        A reboot on the ground shows in its time since boot.
        """
        return before.armed and not self.has_booted(heartbeat)

    def airborne(self, vehicle: VehicleState) -> bool | None:
        """By EXTENDED_SYS_STATE alone: the heartbeat is ACTIVE on the ground too, once armed."""
        if vehicle.landed is LandedState.UNDEFINED:
            return None if vehicle.armed else False
        return vehicle.landed is not LandedState.ON_GROUND

    def alarmed(self, heartbeat: Heartbeat) -> bool:
        """CRITICAL or EMERGENCY: PX4 warns, or holds for some seconds before it acts."""
        return heartbeat.system_status in (_STATE_CRITICAL, _STATE_EMERGENCY)

    def unready(self, vehicle: VehicleState) -> str | None:
        """Pre-arm checks, whose bit PX4 sets in the health of SYS_STATUS alone, then a position.

        The checks include the position estimate only as far as the mode needs one.
        """
        if not vehicle.prearm_heard:
            return "waiting for the pre-arm checks (SYS_STATUS)"
        if not vehicle.prearm_healthy:
            return "pre-arm checks do not pass"
        if vehicle.estimate_lost:
            return "no position estimate yet"
        return "waiting for a position" if vehicle.position is None else None

    def ignores_target(self, text: str) -> bool:
        """One beyond its own fence: its commander acknowledges, its navigator then minds."""
        return _OUTSIDE_FENCE in text.lower()

    def value_of(self, parameter: ParameterValue) -> float:
        """The bytes of whole numbers travel in the float."""
        return parameter.value if parameter.integer is None else float(parameter.integer)

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It listens to the heartbeats of every ground station, so ours are enough."""
        del own_system_id
        return px4_failsafes(values)

    def fence_setup(self, values: Mapping[str, float]) -> FenceSetup:
        """Polygons are heeded wherever anything is done about fences."""
        return px4_fence(values)

    def disowns_fence(self, text: str) -> bool:
        """A polygon that leaves out its home, or the place where it flies when it is put on it."""
        return _FENCE_IGNORED in text.lower()

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """PX4 reads the height as above sea level; NaN is its own yaw and place."""
        del home_alt_m
        params = (0.0, 0.0, 0.0, math.nan, math.nan, math.nan, alt_m)
        return CommandLong(_CMD_NAV_TAKEOFF, params)

    def reposition_params(self, speed_m_s: float) -> tuple[float, float]:
        """At that speed.

        PX4 does not take the command without the flag that lets it change the mode, not
        even in AUTO.LOITER. So a target can pull the vehicle back from a pilot who took
        over less than a heartbeat ago, until he moves the sticks again. Commanding by
        missions avoids that: no upload changes the mode.
        """
        return speed_m_s, _CHANGE_MODE

    def pause(self) -> CommandLong:
        """A target without a place, height and heading: PX4 brakes and stops, as in its code.

        The navigator computes the point itself (navigator_main.cpp, "pause vehicle"), and
        QGroundControl's pause is the same. A position that we heard wrongly plays no part.
        """
        nowhere = (math.nan, math.nan, math.nan, math.nan)
        return CommandLong(_CMD_DO_REPOSITION, (UNCHANGED, _CHANGE_MODE, 0.0, *nowhere))

    def waypoint_params(self, hold_s: float) -> tuple[float, float, float, float]:
        """The hold begins within a radius of 10 m (NAV_ACC_RAD) unless told another."""
        return (hold_s, _WAYPOINT_RADIUS_M, 0.0, math.nan)


class Px4Copter(Px4):
    """The firmware of PX4's multicopters."""

    speed_parameters = (SpeedParameter("MPC_XY_CRUISE", 1.0),)
    """[m/s]; it also survives a restart of the vehicle."""
    override_spec = OverrideSpec(("MPC_JERK_AUTO",), 20.0)
    """[m/s³] PX4 brakes so early that the jerk, 4 by default, costs ever more time the nearer the
    target is; agent.vehicle.firmware.kinematics has the formula."""
    limit_parameters = PX4_LIMITS

    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """As it flies to targets and by missions."""
        return px4_kinematics(values)
