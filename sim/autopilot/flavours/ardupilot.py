"""ArduCopter: 4.8 as recorded, or with the older parameter names up to 4.6.

Sources: recordings of ArduCopter 4.8.0-dev, https://ardupilot.org/copter/docs/parameters.html.
Leaves out: parameters that neither change the simulated vehicle nor are asked for
by common ground stations.
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

__all__ = ["ArduCopter"]

_GROUND_LOST_LANDS = (5.0, 7.0)
"""Values of FS_GCS_ENABLE."""
_FENCE_CIRCLE = 2
"""Bit of FENCE_TYPE."""
_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_INT16 = mavlink.MAV_PARAM_TYPE_INT16
_INT32 = mavlink.MAV_PARAM_TYPE_INT32

_MODES = {
    0: Mode.STABILIZE,
    2: Mode.ALT_HOLD,
    3: Mode.AUTO,
    4: Mode.GUIDED,
    5: Mode.LOITER,
    6: Mode.RTL,
    9: Mode.LAND,
    16: Mode.POSHOLD,
    17: Mode.BRAKE,
}
_NUMBERS = {mode: number for number, mode in _MODES.items()}

_ALWAYS_SET = (
    mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
    | mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
)

_PRESENT = 0x5371FC0F
_ENABLED = 0x53419C0F
_HEALTHY = 0x47519C0F
_GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_AHRS = mavlink.MAV_SYS_STATUS_AHRS
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_POSITION_CONTROL = (
    mavlink.MAV_SYS_STATUS_SENSOR_Z_ALTITUDE_CONTROL
    | mavlink.MAV_SYS_STATUS_SENSOR_XY_POSITION_CONTROL
)

_INFO = mavlink.MAV_SEVERITY_INFO
_WARNING = mavlink.MAV_SEVERITY_WARNING
_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL


class ArduCopter:
    """Numbers, names and habits of ArduCopter.

    Args:
        old_names: speak with the parameter names and units of releases up to 4.6,
            which answer nothing to a question for an unknown parameter.
    """

    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    capabilities: int = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    )
    vtol_state: int = mavlink.MAV_VTOL_STATE_MC
    modes: ModeHabits = ModeHabits(
        at_boot=Mode.STABILIZE,
        for_reposition=Mode.GUIDED,
        for_take_off=None,
        after_flight=None,
        unarmable=frozenset({Mode.AUTO, Mode.RTL, Mode.LAND, Mode.BRAKE}),
        change_speed=frozenset({Mode.GUIDED, Mode.AUTO, Mode.RTL}),
        reposition_needs_flag=False,
        told_at_once=True,
        flies_when_armed=False,
        acknowledgements=1,
        set_mode_acknowledged_as=mavlink.MAVLINK_MSG_ID_SET_MODE,
    )
    missions: MissionHabits = MissionHabits(
        asks_for_int=False,
        int_frames=False,
        marks_current=False,
        first_item=1,
        check_s=0.0,
        restarts=True,
        upload_rewinds=False,
        climbs_first=False,
        repeats_reached=0,
        keeps_number=False,
        gives_way=True,
        forgets_mode=False,
    )
    refusals: Refusals = Refusals(
        not_now=mavlink.MAV_RESULT_FAILED,
        no_such_mode=mavlink.MAV_RESULT_FAILED,
        reposition_without_flag=mavlink.MAV_RESULT_DENIED,
        no_such_stream=mavlink.MAV_RESULT_DENIED,
        no_such_message=mavlink.MAV_RESULT_FAILED,
        outside_fence=mavlink.MAV_RESULT_FAILED,
    )
    failsafe_habits: FailsafeHabits = FailsafeHabits(
        hold_s=0.0,
        words=(),
        hold_words=(),
        battery_words=(
            Text(_WARNING, "Battery 1 is {level} {volts:.2f}V used {used_mah:.0f} mAh"),
            Text(_WARNING, "Battery Failsafe"),
        ),
        position_words=(
            Text(_CRITICAL, "EKF variance: position lost"),
            Text(_CRITICAL, "EKF Failsafe: changed to Land Mode"),
        ),
        ground_regained=Text(_WARNING, "GCS Failsafe Cleared"),
        critical_when_disarmed=True,
        deaf_after_s=math.inf,
    )

    take_off_above_home: bool = True
    reads_frames: bool = True
    forgets_speed: bool = True
    """Its position controller starts with the speed parameter at the first target."""
    obeys_leg_speed: bool = False
    pauses_anywhere: bool = False
    tells_origin_when_armed: bool = True
    constant_position_at_rest: bool = False
    coasting_s: float = 7.0

    unasked_streams: Mapping[int, float] = MappingProxyType({})
    fixed_streams: frozenset[int] = frozenset()
    missing_messages: frozenset[int] = frozenset({mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS})

    stage_texts: Mapping[Stage, Text] = MappingProxyType(
        {
            Stage.BOOTED: Text(_INFO, "ArduPilot Ready"),
            Stage.ORIGIN: Text(_INFO, "EKF3 IMU0 origin set"),
            Stage.POSITION: Text(_INFO, "EKF3 IMU0 is using GPS"),
        }
    )
    texts: Mapping[Occasion, Text] = MappingProxyType(
        {
            Occasion.ARMED: Text(_INFO, "Arming motors"),
            Occasion.ARMING_REFUSED: Text(_CRITICAL, "Arm: {obstacle}"),
            Occasion.NOT_READY: Text(_CRITICAL, "PreArm: {obstacle}"),
            Occasion.DISARMED: Text(_INFO, "Disarming motors"),
            Occasion.DISARMED_UNUSED: Text(_INFO, "Disarming motors"),
            Occasion.DISARMED_LANDED: Text(_INFO, "Disarming motors"),
            Occasion.NO_SUCH_MODE: Text(_WARNING, "No such mode {number}"),
            Occasion.MODE_REFUSED: Text(_WARNING, "Mode change to {mode} failed: {reason}"),
            Occasion.MISSION_RECEIVED: Text(_INFO, "Flight plan received"),
            Occasion.MISSION_REPLACED: Text(_CRITICAL, "Auto mission changed, restarted command"),
            Occasion.MISSION_REPLACED_IN_VAIN: Text(
                _CRITICAL, "Auto mission changed but failed to restart command"
            ),
            Occasion.MISSION_WITHOUT_TAKE_OFF: Text(_CRITICAL, "Auto: Missing Takeoff Cmd"),
            Occasion.ITEM_BEGUN: Text(_INFO, "Mission: {seq} {name}"),
            Occasion.WAYPOINT_REACHED: Text(_INFO, "Reached command #{seq}"),
        }
    )
    own_commands: Mapping[Occasion, OwnCommand] = MappingProxyType({})
    numbers_texts: bool = False

    def __init__(self, *, old_names: bool = False) -> None:
        self._old_names = old_names
        self.parameter_habits: ParameterHabits = ParameterHabits(
            reports_errors=not old_names,
            integers_bytewise=False,
            index_by_name=False,
            # As recorded: the old name of a renamed parameter got neither value nor error.
            unanswered=frozenset({"SYSID_THISMAV"}),
        )
        minor = 6 if old_names else 8
        self.version: int = 4 << 24 | minor << 16

    def parameters(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        """The parameter table at power-up."""
        own = self._old(config) if self._old_names else self._new(config)
        return (
            *own,
            Parameter("DISARM_DELAY", 10.0, _INT8, Setting.DISARM_DELAY_S, least=0.0),
            Parameter("RTL_LOIT_TIME", 5000.0, _INT32, Setting.RETURN_WAIT_S, 1e-3, least=0.0),
            Parameter("GUID_TIMEOUT", 3.0, _REAL, least=0.1),
            Parameter("FS_GCS_ENABLE", 0.0, _INT8),
            Parameter("FS_GCS_TIMEOUT", 5.0, _REAL, least=2.0),
            Parameter("BATT_FS_LOW_ACT", 0.0, _INT8),
            Parameter("BATT_LOW_VOLT", 10.5, _REAL, least=0.0),
            Parameter("FENCE_ENABLE", 0.0, _INT8),
            Parameter("FENCE_TYPE", 7.0, _INT8),
            Parameter("FENCE_RADIUS", 300.0, _REAL, least=30.0),
            Parameter("AUTO_OPTIONS", 0.0, _INT32),
            Parameter("MIS_TOTAL", 0.0, _INT16, read_only=True),
            Parameter("MIS_RESTART", 0.0, _INT8),
        )

    def _new(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        return (
            Parameter("MAV_SYSID", float(config.system_id), _INT16, read_only=True),
            Parameter("MAV_GCS_SYSID", 255.0, _INT16, least=1.0),
            Parameter("MAV_GCS_SYSID_HI", 0.0, _INT16, least=0.0),
            Parameter("ARMING_SKIPCHK", 0.0, _INT32),
            Parameter("WP_SPD", config.cruise_m_s, _REAL, Setting.CRUISE_M_S, least=0.1),
            Parameter("WP_SPD_UP", config.climb_m_s, _REAL, Setting.CLIMB_M_S, least=0.1),
            Parameter("WP_ACC", 2.5, _REAL, least=0.5),
            Parameter("WP_JERK", 1.0, _REAL, least=1.0),
            Parameter("WP_RADIUS_M", 2.0, _REAL, least=0.05),
            Parameter("LAND_SPD_MS", config.land_m_s, _REAL, Setting.LAND_M_S, least=0.1),
            Parameter("RTL_ALT_M", 15.0, _REAL, Setting.RETURN_HEIGHT_M, least=0.0),
            Parameter("MAV1_POSITION", 0.0, _INT16, least=0.0),
        )

    def _old(self, config: VehicleConfig) -> tuple[Parameter, ...]:
        cm = 0.01
        return (
            Parameter("SYSID_THISMAV", float(config.system_id), _INT16, read_only=True),
            Parameter("SYSID_MYGCS", 255.0, _INT16, least=1.0),
            Parameter("ARMING_CHECK", 1.0, _INT32),
            Parameter(
                "WPNAV_SPEED", config.cruise_m_s / cm, _REAL, Setting.CRUISE_M_S, cm, least=10.0
            ),
            Parameter(
                "WPNAV_SPEED_UP", config.climb_m_s / cm, _REAL, Setting.CLIMB_M_S, cm, least=10.0
            ),
            Parameter("WPNAV_ACCEL", 250.0, _REAL, least=50.0),
            Parameter("WPNAV_JERK", 1.0, _REAL, least=1.0),
            Parameter("WPNAV_RADIUS", 200.0, _REAL, least=5.0),
            Parameter("LAND_SPEED", config.land_m_s / cm, _INT16, Setting.LAND_M_S, cm, least=10.0),
            Parameter("RTL_ALT", 1500.0, _INT32, Setting.RETURN_HEIGHT_M, cm, least=0.0),
            Parameter("SR0_POSITION", 0.0, _INT16, least=0.0),
        )

    def ground_lost(self, parameters: ParameterTable) -> GroundLost | None:
        """Returns, or lands; it listens to one system id, or to some next to each other."""
        action = parameters.value("FS_GCS_ENABLE")
        if not action:
            return None
        lowest = int(parameters.value("SYSID_MYGCS" if self._old_names else "MAV_GCS_SYSID"))
        highest = max(lowest, int(parameters.value("MAV_GCS_SYSID_HI")))
        mode = Mode.LAND if action in _GROUND_LOST_LANDS else Mode.RTL
        return GroundLost(mode, parameters.value("FS_GCS_TIMEOUT"), range(lowest, highest + 1))

    def fence_radius_m(self, parameters: ParameterTable) -> float:
        """Where it is on, and a circle."""
        circle = int(parameters.value("FENCE_TYPE")) & _FENCE_CIRCLE
        on = parameters.value("FENCE_ENABLE") and circle
        return parameters.value("FENCE_RADIUS") if on else 0.0

    def disarm_delay(self, mode: Mode) -> Setting | None:
        """At once where the mode was to land; otherwise as after arming."""
        return None if mode in (Mode.RTL, Mode.LAND) else Setting.DISARM_DELAY_S

    def custom_mode(self, mode: Mode) -> int:
        """Number of the mode in a heartbeat."""
        return _NUMBERS[mode]

    def mode_name(self, mode: Mode) -> str:
        """What the firmware calls the mode."""
        return mode.value

    def mode_of(self, custom_mode: int) -> Mode | None:
        """The mode of that number, if the simulated vehicle has it."""
        return _MODES.get(custom_mode)

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE; the third says nothing here."""
        del sub
        return int(main) if math.isfinite(main) else None

    def base_mode(self, mode: Mode, *, armed: bool, on_ground: bool, booted: bool) -> int:
        """MAV_MODE_FLAG bits of a heartbeat.

        ArduCopter sets GUIDED_ENABLED while its position controller runs: so also
        while booting, and no longer once it has returned and landed.
        """
        bits = int(_ALWAYS_SET)
        returned = mode is Mode.RTL and on_ground and not armed
        if not booted or (mode.controls_position and not returned):
            bits |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        if armed:
            bits |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return bits

    def system_status(self, *, armed: bool, on_ground: bool, booted: bool, ready: bool) -> int:
        """MAV_STATE of a heartbeat: active in the air only."""
        del armed, ready
        if not booted:
            return int(mavlink.MAV_STATE_BOOT)
        return int(mavlink.MAV_STATE_STANDBY if on_ground else mavlink.MAV_STATE_ACTIVE)

    def sensors(self, mode: Mode, *, has_origin: bool, can_arm: bool) -> Sensors:
        """Bits of SYS_STATUS, as recorded."""
        seen = _GPS if has_origin else 0
        running = _AHRS if has_origin else 0
        if mode.controls_position:
            running |= _POSITION_CONTROL
        return Sensors(
            present=_PRESENT | seen,
            enabled=_ENABLED | seen | running,
            health=_HEALTHY | seen | running | (_PREARM if can_arm else 0),
        )

    def mission_state(self, view: MissionView) -> int:
        """MISSION_STATE of MISSION_CURRENT."""
        if not view.present:
            return int(mavlink.MISSION_STATE_NO_MISSION)
        if view.over:
            return int(mavlink.MISSION_STATE_COMPLETE)
        if view.running:
            return int(mavlink.MISSION_STATE_ACTIVE)
        return int(
            mavlink.MISSION_STATE_PAUSED if view.stopped else mavlink.MISSION_STATE_NOT_STARTED
        )

    def mission_mode(self, view: MissionView) -> int:
        """1 while the mission mode is on, 0 (not told) otherwise."""
        return 1 if view.mode is Mode.AUTO else 0

    def mission_total(self, view: MissionView) -> int:
        """Home doesn't count."""
        return view.items
