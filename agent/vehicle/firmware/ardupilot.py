"""ArduPilot's copters, as ArduCopter 4.8 behaves.

Leaves out: planes, rovers and submarines, whose modes have other numbers and which
take off otherwise.

Sources: https://mavlink.io/en/messages/ardupilotmega.html and
https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from agent.vehicle.commands import result_text
from agent.vehicle.firmware.failsafes import ARDUCOPTER_NAMES, Failsafes, arducopter_failsafes
from agent.vehicle.firmware.profile import COPTER_TYPES, UNCHANGED, Copter, SpeedParameter, set_mode
from agent.vehicle.messages import (
    AltitudeFrame,
    BatteryStatus,
    CommandInt,
    CommandLong,
    EkfStatus,
    ExtendedState,
    Heartbeat,
    Inbound,
    Landed,
    MissionCurrent,
    SystemStatus,
)
from agent.vehicle.parameter_override import OverrideSpec
from agent.vehicle.state import VehicleState

__all__ = ["ArduCopter"]


_AUTOPILOT_ARDUPILOT = 3

_AUTO = 3
_GUIDED = 4
_RTL = 6
_LAND = 9
_SMART_RTL = 21
_AUTO_RTL = 27
_MODE_NAMES = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    _AUTO: "AUTO",
    _GUIDED: "GUIDED",
    5: "LOITER",
    _RTL: "RTL",
    7: "CIRCLE",
    _LAND: "LAND",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    _SMART_RTL: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    _AUTO_RTL: "AUTO_RTL",
    28: "TURTLE",
}

_RESULT_FAILED = 4
_STATE_STANDBY = 3
_STATE_ACTIVE = 4

_CMD_NAV_TAKEOFF = 22
_CMD_DO_REPOSITION = 192


class ArduCopter(Copter):
    """The firmware of ArduPilot's copters."""

    @property
    def speed_parameters(self) -> tuple[SpeedParameter, ...]:
        """WP_SPD [m/s] since 4.8, WPNAV_SPEED [cm/s] before."""
        return (SpeedParameter("WP_SPD", 1.0), SpeedParameter("WPNAV_SPEED", 100.0))

    @property
    def override_spec(self) -> OverrideSpec | None:
        """None: targets are not flown by the jerk of missions, and missions give way to them."""
        return None

    @property
    def failsafe_names(self) -> tuple[tuple[str, ...], ...]:
        """Ground station and battery failsafes."""
        return ARDUCOPTER_NAMES

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It listens to the heartbeats of certain system ids only."""
        return arducopter_failsafes(values, own_system_id)

    @property
    def streams(self) -> tuple[tuple[int, type[Inbound]], ...]:
        """ArduPilot streams nothing unasked."""
        return (
            (1, SystemStatus),
            (193, EkfStatus),
            (245, ExtendedState),
            (42, MissionCurrent),
            (147, BatteryStatus),
        )

    @property
    def mission_vehicle_items(self) -> int:
        """Item 0 is home, whatever is sent as such."""
        return 1

    @property
    def missions_give_way(self) -> bool:
        """Yes: it flies to targets as in GUIDED, and to waypoints on a slower track."""
        return True

    @property
    def acknowledged_twice(self) -> frozenset[int]:
        """None."""
        return frozenset()

    @property
    def pilots_stop_it_there(self) -> bool:
        """Pilots and ground stations pause in other modes."""
        return False

    @property
    def commanded_mode_name(self) -> str:
        """GUIDED."""
        return "GUIDED"

    @property
    def commanded_by_choice(self) -> bool:
        """Yes: GUIDED is entered on command or by a switch only."""
        return True

    def flies(self, heartbeat: Heartbeat) -> bool:
        """Whether it is an ArduPilot copter."""
        return (
            heartbeat.autopilot == _AUTOPILOT_ARDUPILOT and heartbeat.vehicle_type in COPTER_TYPES
        )

    def mode_name(self, custom_mode: int) -> str:
        """The mode's name, for people."""
        return _MODE_NAMES.get(custom_mode, f"mode {custom_mode}")

    def is_commanded(self, custom_mode: int) -> bool:
        """GUIDED takes our targets."""
        return custom_mode == _GUIDED

    def is_taking_off(self, custom_mode: int) -> bool:
        """Never: it takes off in GUIDED."""
        del custom_mode
        return False

    def is_mission(self, custom_mode: int) -> bool:
        """AUTO."""
        return custom_mode == _AUTO

    def is_returning(self, custom_mode: int) -> bool:
        """RTL and its kin, and LAND."""
        return custom_mode in (_RTL, _LAND, _SMART_RTL, _AUTO_RTL)

    def has_booted(self, heartbeat: Heartbeat) -> bool:
        """STANDBY or beyond; a mode set earlier is acknowledged and then overwritten."""
        return heartbeat.system_status >= _STATE_STANDBY

    def has_rebooted(self, before: Heartbeat, heartbeat: Heartbeat) -> bool:
        """It was past booting, and is not any more."""
        return self.has_booted(before) and not self.has_booted(heartbeat)

    def airborne(self, vehicle: VehicleState) -> bool:
        """By EXTENDED_SYS_STATE; before it comes, by the heartbeat's ACTIVE."""
        if vehicle.landed is not Landed.UNDEFINED:
            return vehicle.landed is not Landed.ON_GROUND
        return vehicle.heartbeat is not None and vehicle.heartbeat.system_status >= _STATE_ACTIVE

    def position_fault(self, vehicle: VehicleState) -> str | None:
        """By the EKF's flags: a lost position is told on, from dead reckoning."""
        return "the position estimate is lost" if vehicle.estimate_lost else None

    def alarmed(self, heartbeat: Heartbeat) -> bool:
        """Never: a failsafe that acts changes the mode.

        CRITICAL in GUIDED means that the vehicle's owner lets it fly on, for one without
        a remote control (FS_OPTIONS).
        """
        del heartbeat
        return False

    def place_refusal(self, vehicle: VehicleState, result: int | None) -> str:
        """FAILED is all that it says of a place beyond its own fence, and of little else."""
        text = result_text(result)
        fenced = vehicle.fence_enabled and result == _RESULT_FAILED
        return f"{text}, probably by its own fence" if fenced else text

    def ignores_target(self, text: str) -> bool:
        """Never: what it acknowledges it flies to."""
        del text
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
        if vehicle.position is None:
            return "waiting for a position"
        return None

    def set_commanded_mode(self) -> CommandLong:
        """GUIDED."""
        return set_mode(_GUIDED)

    def set_mission_mode(self) -> CommandLong:
        """AUTO; refused on the ground unless the mission begins with a takeoff."""
        return set_mode(_AUTO)

    def set_return_mode(self) -> CommandLong:
        """RTL, which climbs, returns, lands and disarms."""
        return set_mode(_RTL)

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """ArduCopter reads the height as above home."""
        return CommandLong(_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, alt_m - home_alt_m))

    def reposition(
        self, lat_deg: float, lon_deg: float, alt_m: float, speed_m_s: float
    ) -> CommandInt:
        """Fly there at once, in GUIDED only, at the speed set before.

        The altitude is given above mean sea level, like the mission's own, so that home's
        height does not matter. The flag that would let the command change the mode is not
        set: a pilot who just took over keeps the vehicle.
        """
        del speed_m_s
        return CommandInt(
            _CMD_DO_REPOSITION,
            AltitudeFrame.MEAN_SEA_LEVEL,
            (UNCHANGED, 0.0, 0.0, math.nan),
            lat_deg,
            lon_deg,
            alt_m,
        )

    def pause(self) -> CommandLong | None:
        """None: GUIDED flies on to its target, and being told GUIDED again changes nothing.

        BRAKE and LOITER would stop it, but in a mode in which it no longer obeys, as if its
        pilot had taken it; DO_PAUSE_CONTINUE pauses every later target too until it is
        told to continue, which may get lost.
        """
        return None

    def waypoint_params(self, hold_s: float) -> tuple[float, float, float, float]:
        """Copters keep the hold time only; their radius is WPNAV_RADIUS."""
        return (hold_s, 0.0, 0.0, 0.0)
