"""PX4 1.17 on a multicopter, as recorded.

Sources: recordings of PX4 1.17 (SIH quadrotor), https://docs.px4.io/main/en/flight_modes_mc/,
https://docs.px4.io/main/en/advanced_config/parameter_reference.html, and the behaviour of
its modules `commander`, `navigator` and `mavlink`. Leaves out: OFFBOARD and ACRO, the
cone in which it returns at a lower height, events (its newer way to give reasons),
parameters that neither change the simulated vehicle nor are asked for by common
ground stations.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import VehicleConfig
from sim.autopilot.flavours.base import (
    FailsafeHabits,
    GroundLost,
    MissionHabits,
    MissionView,
    ModeHabits,
    Refusals,
    Sensors,
)
from sim.autopilot.modes import Mode
from sim.autopilot.occasions import Occasion, OwnCommand, Text
from sim.autopilot.params import Parameter, ParameterHabits, ParameterTable, Setting
from sim.autopilot.readiness import Stage

__all__ = ["Px4"]

_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT32 = mavlink.MAV_PARAM_TYPE_INT32

_MODES = {
    (1, 0): (Mode.MANUAL, "Manual"),
    (2, 0): (Mode.ALT_HOLD, "Altitude"),
    (3, 0): (Mode.POSHOLD, "Position"),
    (4, 2): (Mode.TAKEOFF, "Takeoff"),
    (4, 3): (Mode.LOITER, "Hold"),
    (4, 4): (Mode.AUTO, "Mission"),
    (4, 5): (Mode.RTL, "Return"),
    (4, 6): (Mode.LAND, "Land"),
    (7, 0): (Mode.STABILIZE, "Stabilized"),
}
"""Main and sub mode -> the mode and what people read."""
_NUMBERS = {mode: main << 16 | sub << 24 for (main, sub), (mode, _) in _MODES.items()}
_NAMES = dict(_MODES.values())
_AUTOMATIC = frozenset({Mode.TAKEOFF, Mode.LOITER, Mode.AUTO, Mode.RTL, Mode.LAND})

_HEALTH_AT_BOOT = 0x0321C83F
_PRESENT = 0x0300402F
_ENABLED = 0x0301402F
_HEALTHY = 0x0320C83F
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
"""Told in the health bits alone."""

_GROUND_LOST_MODES = {2: Mode.RTL, 3: Mode.LAND}
"""By NAV_DLL_ACT; it holds, and falls, in other ways than are simulated."""
_GROUND_LOST_SPARED = {1: Mode.AUTO, 2: Mode.LOITER}
"""By bit of COM_DLL_EXCEPT."""
_FAILSAFE_HOLD_S = 5.0
"""COM_FAIL_ACT_T."""
_HEARTBEAT_MISSED_S = 2.5
"""Without a heartbeat for so long a ground station is not connected any more."""
_TEXTS_KEPT_S = 5.0
"""Texts wait so long for a ground station that is connected; nobody hears them otherwise."""
_UNKNOWN_TOTAL = 65535
_MISSION_MODE_ACTIVE = 1
_MISSION_MODE_SUSPENDED = 2

_INFO = mavlink.MAV_SEVERITY_INFO
_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL


class Px4:
    """Numbers, names and habits of PX4."""

    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    capabilities: int = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    vtol_state: int = mavlink.MAV_VTOL_STATE_UNDEFINED
    version: int = 1 << 24 | 17 << 16 | 255
    modes: ModeHabits = ModeHabits(
        at_boot=Mode.LOITER,
        for_reposition=Mode.LOITER,
        for_take_off=Mode.TAKEOFF,
        after_flight=Mode.LOITER,
        unarmable=frozenset({Mode.RTL, Mode.LAND}),
        change_speed=frozenset(Mode),
        reposition_needs_flag=True,
        told_at_once=False,
        flies_when_armed=True,
        acknowledgements=2,
        set_mode_acknowledged_as=mavlink.MAV_CMD_DO_SET_MODE,
    )
    missions: MissionHabits = MissionHabits(
        asks_for_int=True,
        int_frames=True,
        marks_current=True,
        first_item=0,
        check_s=1.9,
        restarts=False,
        upload_rewinds=True,
        climbs_first=True,
        repeats_reached=10,
        keeps_number=True,
        gives_way=False,
        forgets_mode=True,
    )
    refusals: Refusals = Refusals(
        not_now=mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
        no_such_mode=mavlink.MAV_RESULT_DENIED,
        reposition_without_flag=mavlink.MAV_RESULT_UNSUPPORTED,
        no_such_stream=mavlink.MAV_RESULT_FAILED,
        no_such_message=mavlink.MAV_RESULT_DENIED,
        outside_fence=mavlink.MAV_RESULT_ACCEPTED,
    )
    failsafe_habits: FailsafeHabits = FailsafeHabits(
        hold_s=_FAILSAFE_HOLD_S,
        words=(Text(_CRITICAL, "Failsafe activated"),),
        hold_words=(
            Text(
                _CRITICAL, f"Failsafe activated: entering Hold for {_FAILSAFE_HOLD_S:.0f} seconds"
            ),
        ),
        battery_words=(Text(_CRITICAL, "Critical battery"),),
        position_words=(),
        ground_regained=Text(_INFO, "GCS connection regained"),
        critical_when_disarmed=False,
        deaf_after_s=_HEARTBEAT_MISSED_S + _TEXTS_KEPT_S,
    )
    parameter_habits: ParameterHabits = ParameterHabits(
        reports_errors=False,
        integers_bytewise=True,
        index_by_name=True,
        tells_changes=True,
        told_at_boot=(
            "COM_DL_LOSS_T",
            "COM_OBC_LOSS_T",
            "COM_OF_LOSS_T",
            "COM_RC_LOSS_T",
            "SYS_AUTOSTART",
        ),
    )

    take_off_above_home: bool = False
    reads_frames: bool = False
    forgets_speed: bool = False
    obeys_leg_speed: bool = True
    pauses_anywhere: bool = True
    tells_origin_when_armed: bool = False
    constant_position_at_rest: bool = True
    coasting_s: float = math.inf

    unasked_streams: Mapping[int, float] = MappingProxyType(
        {
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: 1.0,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 1.0,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: 1.0,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 0.2,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: 2.0,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 1.0,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: 1.0,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 0.25,  # slower than the firmware's 15 Hz
            mavlink.MAVLINK_MSG_ID_VFR_HUD: 0.25,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: 2.0,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        }
    )
    fixed_streams: frozenset[int] = frozenset({mavlink.MAVLINK_MSG_ID_MISSION_CURRENT})
    missing_messages: frozenset[int] = frozenset({mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT})

    stage_texts: Mapping[Stage, Text] = MappingProxyType({})
    texts: Mapping[Occasion, Text] = MappingProxyType(
        {
            Occasion.ARMED: Text(_INFO, "Armed by external command"),
            Occasion.ARMING_REFUSED: Text(
                _CRITICAL, "Arming denied: Resolve system health failures first"
            ),
            Occasion.DISARMED: Text(_INFO, "Disarmed by external command"),
            Occasion.DISARMED_UNUSED: Text(_INFO, "Disarmed by auto preflight disarming"),
            Occasion.DISARMED_LANDED: Text(_INFO, "Disarmed by landing"),
            Occasion.DISARMING_REFUSED: Text(_CRITICAL, "Disarming denied: not landed"),
            Occasion.LIFTED_OFF: Text(_INFO, "Takeoff detected"),
            Occasion.LANDED: Text(_INFO, "Landing detected"),
            Occasion.TAKE_OFF_RAISED: Text(
                _CRITICAL, "Using minimum takeoff altitude: {height_m:.2f} m"
            ),
            Occasion.NO_SUCH_MODE: Text(_CRITICAL, "Unsupported auto mode"),
            Occasion.MODE_REFUSED: Text(
                _CRITICAL, "Switching to mode '{mode}' is currently not available"
            ),
            Occasion.TARGET_OUTSIDE_FENCE: Text(_CRITICAL, "Reposition is outside geofence"),
            Occasion.MISSION_BEGUN: Text(_INFO, "Executing Mission"),
            Occasion.MISSION_CLIMB: Text(_INFO, "Climb to {height_m:.1f} meters above home"),
            Occasion.MISSION_UNAVAILABLE: Text(_CRITICAL, "No valid mission available, loitering"),
            Occasion.MISSION_UNAVAILABLE_ON_GROUND: Text(
                _CRITICAL, "No valid mission available, refusing takeoff"
            ),
            Occasion.MISSION_OVER: Text(_INFO, "Mission finished, loitering"),
            Occasion.MISSION_OVER_ON_GROUND: Text(_INFO, "Mission finished, landed"),
            Occasion.RETURN_ORDERED: Text(_INFO, "Returning to launch"),
            Occasion.RETURN_BEGUN: Text(
                _INFO,
                "RTL: start return at {altitude_m:.0f} m ({above_home_m:.0f} m above destination)",
            ),
            Occasion.RETURN_LANDING: Text(_INFO, "RTL: land at destination"),
        }
    )
    own_commands: Mapping[Occasion, OwnCommand] = MappingProxyType(
        {
            Occasion.MISSION_OVER: OwnCommand(
                mavlink.MAV_CMD_DO_TRIGGER_CONTROL, (-1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
            ),
            Occasion.RETURN_BEGUN: OwnCommand(
                mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
                (1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0),
            ),
            Occasion.RETURN_LANDED: OwnCommand(0, (0.0, 2.0, 80.0, math.nan, 0.0, 0.0, 0.0)),
        }
    )
    """The mission triggers cameras and the return takes over gimbals; number 0 is recorded so."""
    numbers_texts: bool = True

    def parameters(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        """The parameter table at power-up, by name as PX4 sorts it."""
        return (
            Parameter("COM_DISARM_LAND", 2.0, _REAL, Setting.DISARM_LANDED_S),
            Parameter("COM_DISARM_PRFLT", 10.0, _REAL, Setting.DISARM_DELAY_S),
            Parameter("COM_DLL_EXCEPT", 0.0, _INT32, least=0.0),
            Parameter("COM_DL_LOSS_T", 30.0, _INT32, least=5.0),
            Parameter("COM_LOW_BAT_ACT", 3.0, _INT32, least=0.0),
            Parameter("COM_OBC_LOSS_T", 15.0, _REAL, least=0.0),
            Parameter("COM_OF_LOSS_T", 3.0, _REAL, least=0.0),
            Parameter("COM_RC_IN_MODE", 1.0, _INT32, least=0.0),
            Parameter("COM_RC_LOSS_T", 3.0, _REAL, least=0.0),
            Parameter("GF_ACTION", 2.0, _INT32, least=0.0),
            Parameter("GF_MAX_HOR_DIST", 0.0, _REAL, least=0.0),
            Parameter("MAV_SYS_ID", float(config.system_id), _INT32, read_only=True),
            Parameter("MAV_TYPE", float(mavlink.MAV_TYPE_QUADROTOR), _INT32, read_only=True),
            Parameter("MIS_TAKEOFF_ALT", 2.5, _REAL, Setting.TAKE_OFF_HEIGHT_M, least=0.0),
            Parameter("MPC_ACC_HOR", 3.0, _REAL, least=2.0),
            Parameter("MPC_JERK_AUTO", 4.0, _REAL, least=1.0),
            Parameter("MPC_LAND_SPEED", config.land_m_s, _REAL, Setting.LAND_M_S, least=0.6),
            Parameter("MPC_TKO_SPEED", config.climb_m_s, _REAL, Setting.TAKE_OFF_M_S, least=0.1),
            Parameter("MPC_XY_CRUISE", config.cruise_m_s, _REAL, Setting.CRUISE_M_S, least=0.1),
            Parameter("MPC_XY_VEL_MAX", max(12.0, config.cruise_m_s), _REAL, least=0.0),
            Parameter("MPC_Z_V_AUTO_UP", 3.0, _REAL, Setting.CLIMB_M_S, least=0.1),
            Parameter("NAV_ACC_RAD", 2.0, _REAL, least=0.05),
            Parameter("NAV_DLL_ACT", 0.0, _INT32, least=0.0),
            Parameter("RTL_DESCEND_ALT", 10.0, _REAL, least=0.0),
            Parameter("RTL_LAND_DELAY", 0.0, _REAL, Setting.RETURN_WAIT_S),
            Parameter("RTL_RETURN_ALT", 30.0, _REAL, Setting.RETURN_HEIGHT_M, least=0.0),
            Parameter("SYS_AUTOSTART", 10040.0, _INT32, least=0.0),
        )

    def ground_lost(self, parameters: ParameterTable) -> GroundLost | None:
        """Returns, or lands; any ground station will do."""
        mode = _GROUND_LOST_MODES.get(int(parameters.value("NAV_DLL_ACT")))
        if mode is None:
            return None
        after_s = _HEARTBEAT_MISSED_S + parameters.value("COM_DL_LOSS_T")
        excepted = int(parameters.value("COM_DLL_EXCEPT"))
        spared = {each for bit, each in _GROUND_LOST_SPARED.items() if excepted & bit}
        return GroundLost(mode, after_s, range(1, 256), frozenset(spared))

    def fence_radius_m(self, parameters: ParameterTable) -> float:
        """A circle, unless it is 0."""
        return parameters.value("GF_MAX_HOR_DIST")

    def disarm_delay(self, mode: Mode) -> Setting | None:
        """The same after every landing."""
        del mode
        return Setting.DISARM_LANDED_S

    def custom_mode(self, mode: Mode) -> int:
        """Number of the mode in a heartbeat."""
        return _NUMBERS[mode]

    def mode_name(self, mode: Mode) -> str:
        """What people read."""
        return _NAMES[mode]

    def mode_of(self, custom_mode: int) -> Mode | None:
        """The mode of that number, if the simulated vehicle has it."""
        known = _MODES.get((custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF))
        return None if known is None else known[0]

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE."""
        if not (0.0 <= main <= 255.0 and 0.0 <= sub <= 255.0):
            return None
        return int(main) << 16 | int(sub) << 24

    def base_mode(self, mode: Mode, *, armed: bool, on_ground: bool, booted: bool) -> int:
        """MAV_MODE_FLAG bits of a heartbeat."""
        del on_ground, booted
        bits: int = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if mode in _AUTOMATIC:
            bits |= (
                mavlink.MAV_MODE_FLAG_AUTO_ENABLED
                | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
                | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
            )
        else:
            bits |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
            if mode is not Mode.MANUAL:
                bits |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        if armed:
            bits |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return bits

    def system_status(self, *, armed: bool, on_ground: bool, booted: bool, ready: bool) -> int:
        """MAV_STATE of a heartbeat: active once the motors run, uninitialised before they may.

        What it checks before it arms it takes for part of its initialisation.
        """
        del on_ground
        if armed:
            return int(mavlink.MAV_STATE_ACTIVE)
        ready = ready and booted
        return int(mavlink.MAV_STATE_STANDBY if ready else mavlink.MAV_STATE_UNINIT)

    def sensors(self, mode: Mode, *, has_origin: bool, can_arm: bool) -> Sensors:
        """Bits of SYS_STATUS, as recorded."""
        del mode
        if not has_origin:
            return Sensors(present=0, enabled=0, health=_HEALTH_AT_BOOT)
        return Sensors(
            present=_PRESENT, enabled=_ENABLED, health=_HEALTHY | (_PREARM if can_arm else 0)
        )

    def mission_state(self, view: MissionView) -> int:
        """MISSION_STATE of MISSION_CURRENT.

        It speaks of the mode more than of the mission: a take-off or a landing that is
        done completes it too, and one that was left half-way stays active.
        """
        if not view.present:
            return int(mavlink.MISSION_STATE_NO_MISSION)
        if view.task_done:
            return int(mavlink.MISSION_STATE_COMPLETE)
        if self.mission_mode(view) == _MISSION_MODE_ACTIVE or view.current:
            return int(mavlink.MISSION_STATE_ACTIVE)
        return int(mavlink.MISSION_STATE_NOT_STARTED)

    def mission_mode(self, view: MissionView) -> int:
        """Taking off and landing count as a mission."""
        active = view.mode in (Mode.AUTO, Mode.TAKEOFF, Mode.LAND)
        return _MISSION_MODE_ACTIVE if active else _MISSION_MODE_SUSPENDED

    def mission_total(self, view: MissionView) -> int:
        """Unknown where there is none."""
        return view.items if view.items > 0 else _UNKNOWN_TOTAL
