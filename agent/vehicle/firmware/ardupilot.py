"""What ArduPilot's vehicles have in common, and its copters, as ArduCopter 4.8 behaves.

Leaves out: planes that need a runway, and submarines.

Sources: https://mavlink.io/en/messages/ardupilotmega.html and
https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar

from agent.vehicle.firmware.failsafes import ARDUCOPTER_NAMES, Failsafes, arducopter_failsafes
from agent.vehicle.firmware.fences import ARDUCOPTER_FENCE_NAMES, FenceSetup, arducopter_fence
from agent.vehicle.firmware.kinematics import (
    ARDUCOPTER_LIMITS,
    Kinematics,
    arducopter_kinematics,
)
from agent.vehicle.firmware.profile import UNCHANGED, Firmware, SpeedParameter
from agent.vehicle.messages import (
    BatteryStatus,
    CommandLong,
    EkfStatus,
    ExtendedState,
    Heartbeat,
    Inbound,
    LandedState,
    MissionCurrent,
    SystemStatus,
)
from agent.vehicle.state import VehicleState

_AUTO, _GUIDED, _RTL, _LAND, _SMART_RTL, _AUTO_RTL = (3,), (4,), (6,), (9,), (21,), (27,)

_RESULT_FAILED = 4
_STATE_ACTIVE = 4
_CMD_NAV_TAKEOFF = 22


class ArduPilot(Firmware):
    """What its copters, rovers and planes have in common."""

    autopilot = 3
    commanded_mode_name = "GUIDED"
    commanded_by_choice = True
    """GUIDED is entered on command or by a switch only."""
    pilots_stop_it_there = False
    """Pilots and ground stations pause in other modes."""
    streams: ClassVar[tuple[tuple[int, type[Inbound]], ...]] = (
        (1, SystemStatus),
        (193, EkfStatus),
        (245, ExtendedState),
        (42, MissionCurrent),
        (147, BatteryStatus),
    )
    """ArduPilot streams nothing unasked."""
    mission_vehicle_items = 1
    """Item 0 is home, whatever is sent as such."""
    missions_give_way = False
    missions_begin_anew = False
    """Items are taken over one by one, and the number of the current one stays."""
    targets_turn_nose = False

    def has_rebooted(self, before: Heartbeat, heartbeat: Heartbeat) -> bool:
        """It was past booting, and is not any more."""
        return self.has_booted(before) and not self.has_booted(heartbeat)

    def airborne(self, vehicle: VehicleState) -> bool:
        """By EXTENDED_SYS_STATE; before it comes, by the heartbeat's ACTIVE."""
        if vehicle.landed is not LandedState.UNDEFINED:
            return vehicle.landed is not LandedState.ON_GROUND
        return vehicle.heartbeat is not None and vehicle.heartbeat.system_status >= _STATE_ACTIVE

    def alarmed(self, heartbeat: Heartbeat) -> bool:
        """Never: a failsafe that acts changes the mode.

        CRITICAL in GUIDED means that the vehicle's owner lets it fly on, for one without
        a remote control (FS_OPTIONS).
        """
        del heartbeat
        return False

    def unready(self, vehicle: VehicleState) -> str | None:
        """Pre-arm checks of SYS_STATUS, then the EKF's absolute horizontal position."""
        if not vehicle.prearm_heard:
            return "waiting for the pre-arm checks (SYS_STATUS)"
        if vehicle.ekf_flags is None:
            return "waiting for the position estimate's status (EKF_STATUS_REPORT)"
        if vehicle.estimate_lost:
            return "no position estimate yet"
        if vehicle.prearm_ok is False:
            return "pre-arm checks do not pass"
        return "waiting for a position" if vehicle.position is None else None

    def place_refusal(self, vehicle: VehicleState, result: int | None) -> str:
        """FAILED is all that it says of a place beyond its own fence, and of little else."""
        text = super().place_refusal(vehicle, result)
        fenced = vehicle.fence_enabled and result == _RESULT_FAILED
        return f"{text}, probably by its own fence" if fenced else text

    def fence_setup(self, values: Mapping[str, float]) -> FenceSetup:
        """Polygons are heeded where they are switched on."""
        return arducopter_fence(values)

    def reposition_params(self, speed_m_s: float) -> tuple[float, float]:
        """In GUIDED only, at the speed set before.

        The flag that would let the command change the mode is not set: a pilot who just took
        over keeps the vehicle.
        """
        del speed_m_s
        return UNCHANGED, 0.0

    def waypoint_params(self, hold_s: float) -> tuple[float, float, float, float]:
        """Copters keep the hold time only; their radius is WPNAV_RADIUS."""
        return (hold_s, 0.0, 0.0, 0.0)


class ArduCopter(ArduPilot):
    """The firmware of ArduPilot's copters.

    It cannot be paused: GUIDED flies on to its target, and being told GUIDED again changes
    nothing. BRAKE and LOITER would stop it, but in a mode in which it no longer obeys, as if its
    pilot had taken it; DO_PAUSE_CONTINUE pauses every later target too until it is told to
    continue, which may get lost.
    """

    name = "ArduCopter"
    mode_names = MappingProxyType(
        {
            (0,): "STABILIZE",
            (1,): "ACRO",
            (2,): "ALT_HOLD",
            _AUTO: "AUTO",
            _GUIDED: "GUIDED",
            (5,): "LOITER",
            _RTL: "RTL",
            (7,): "CIRCLE",
            _LAND: "LAND",
            (11,): "DRIFT",
            (13,): "SPORT",
            (14,): "FLIP",
            (15,): "AUTOTUNE",
            (16,): "POSHOLD",
            (17,): "BRAKE",
            (18,): "THROW",
            (19,): "AVOID_ADSB",
            (20,): "GUIDED_NOGPS",
            _SMART_RTL: "SMART_RTL",
            (22,): "FLOWHOLD",
            (23,): "FOLLOW",
            (24,): "ZIGZAG",
            (25,): "SYSTEMID",
            (26,): "AUTOROTATE",
            _AUTO_RTL: "AUTO_RTL",
            (28,): "TURTLE",
        }
    )
    commanded_mode = _GUIDED
    mission_mode = _AUTO
    """Refused on the ground unless the mission begins with a takeoff."""
    return_mode = _RTL
    land_mode = _LAND
    returning_modes = frozenset({_RTL, _LAND, _SMART_RTL, _AUTO_RTL})
    speed_parameters = (SpeedParameter("WP_SPD", 1.0), SpeedParameter("WPNAV_SPEED", 100.0))
    """WP_SPD [m/s] since 4.8, WPNAV_SPEED [cm/s] before."""
    failsafe_names = ARDUCOPTER_NAMES
    limit_parameters = ARDUCOPTER_LIMITS
    fence_names = ARDUCOPTER_FENCE_NAMES
    missions_give_way = True
    """It flies to targets as in GUIDED, and to waypoints on a slower track."""

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It listens to the heartbeats of certain system ids only."""
        return arducopter_failsafes(values, own_system_id)

    def kinematics(self, values: Mapping[str, float]) -> Kinematics:
        """As it flies to targets, in missions too."""
        return arducopter_kinematics(values)

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """ArduCopter reads the height as above home."""
        return CommandLong(_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, alt_m - home_alt_m))
