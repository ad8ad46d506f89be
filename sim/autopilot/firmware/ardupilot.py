"""ArduCopter: 4.8 as recorded, or with the older parameter names up to 4.6.

Sources: recordings of ArduCopter 4.8.0-dev, https://ardupilot.org/copter/docs/parameters.html.
Of parameters it has those that change the simulated vehicle or are asked for by common ground
stations.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import arducopter_jerk_s
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, TextTemplate
from sim.autopilot.firmware.model import (
    FailsafeBehaviour,
    FenceBehaviour,
    FirmwareModel,
    GcsFailsafe,
    MissionBehaviour,
    ModeBehaviour,
    RefusalCodes,
    texts_of,
)
from sim.autopilot.flight import FlightMode
from sim.autopilot.mission_run import MissionRunState
from sim.autopilot.parameters import (
    ParameterBehaviour,
    ParameterEntry,
    ParameterRole,
    ParameterTable,
)
from sim.autopilot.readiness import PowerUpStage

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_GROUND_LOST_LANDS = (5.0, 7.0)
"""Values of FS_GCS_ENABLE."""
_FENCE_CIRCLE = 2
"""Bit of FENCE_TYPE."""
_FENCE_POLYGON = 4
_FENCE_MODES = {
    1: FlightMode.RTL,
    2: FlightMode.LAND,
    3: FlightMode.RTL,
    4: FlightMode.BRAKE,
    5: FlightMode.RTL,
}
"""By FENCE_ACTION, without what it falls back on; SmartRTL is not simulated."""
_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT8 = mavlink.MAV_PARAM_TYPE_INT8
_INT16 = mavlink.MAV_PARAM_TYPE_INT16
_INT32 = mavlink.MAV_PARAM_TYPE_INT32

_MODES = {
    0: FlightMode.STABILIZE,
    2: FlightMode.ALT_HOLD,
    3: FlightMode.AUTO,
    4: FlightMode.GUIDED,
    5: FlightMode.LOITER,
    6: FlightMode.RTL,
    9: FlightMode.LAND,
    16: FlightMode.POSHOLD,
    17: FlightMode.BRAKE,
}

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

_DEBUG = mavlink.MAV_SEVERITY_DEBUG
_INFO = mavlink.MAV_SEVERITY_INFO
_NOTICE = mavlink.MAV_SEVERITY_NOTICE
_WARNING = mavlink.MAV_SEVERITY_WARNING
_CRITICAL = mavlink.MAV_SEVERITY_CRITICAL

_TEXTS = {
    _INFO: {
        FirmwareEvent.ARMED: "Arming motors",
        FirmwareEvent.DISARMED: "Disarming motors",
        FirmwareEvent.DISARMED_UNUSED: "Disarming motors",
        FirmwareEvent.DISARMED_LANDED: "Disarming motors",
        FirmwareEvent.MISSION_RECEIVED: "Flight plan received",
        FirmwareEvent.FENCE_ACTED: "Manual recovery started",
        FirmwareEvent.ITEM_BEGUN: "Mission: {seq} {name}",
        FirmwareEvent.WAYPOINT_REACHED: "Reached command #{seq}",
    },
    _DEBUG: {FirmwareEvent.FENCE_RECEIVED: "Fence Indexed OK"},
    _NOTICE: {
        FirmwareEvent.FENCE_BREACHED: "Polygon fence breached",
        FirmwareEvent.FENCE_CLEARED: "Fence breach cleared",
    },
    _WARNING: {
        FirmwareEvent.FENCE_REFUSED: "{reason}",
        FirmwareEvent.FENCE_KEPT: "Fence validation failed",
        FirmwareEvent.NO_SUCH_MODE: "No such mode {number}",
        FirmwareEvent.MODE_REFUSED: "Mode change to {mode} failed: {reason}",
    },
    _CRITICAL: {
        FirmwareEvent.ARMING_REFUSED: "Arm: {obstacle}",
        FirmwareEvent.NOT_READY: "PreArm: {obstacle}",
        FirmwareEvent.MISSION_REPLACED: "Auto mission changed, restarted command",
        FirmwareEvent.MISSION_REPLACED_IN_VAIN: (
            "Auto mission changed but failed to restart command"
        ),
        FirmwareEvent.MISSION_WITHOUT_TAKE_OFF: "Auto: Missing Takeoff Cmd",
    },
}

_CM = 0.01
_OLD_NAMES = {
    "MAV_SYSID": ("SYSID_THISMAV", _INT16, 1.0),
    "MAV_GCS_SYSID": ("SYSID_MYGCS", _INT16, 1.0),
    "ARMING_SKIPCHK": ("ARMING_CHECK", _INT32, 1.0),
    "WP_SPD": ("WPNAV_SPEED", _REAL, _CM),
    "WP_SPD_UP": ("WPNAV_SPEED_UP", _REAL, _CM),
    "WP_ACC": ("WPNAV_ACCEL", _REAL, _CM),
    "WP_JERK": ("WPNAV_JERK", _REAL, 1.0),
    "PSC_JERK_NE": ("PSC_JERK_XY", _REAL, 1.0),
    "ATC_ANGLE_MAX": ("ANGLE_MAX", _INT16, _CM),
    "WP_RADIUS_M": ("WPNAV_RADIUS", _REAL, _CM),
    "LAND_SPD_MS": ("LAND_SPEED", _INT16, _CM),
    "RTL_ALT_M": ("RTL_ALT", _INT32, _CM),
    "MAV1_POSITION": ("SR0_POSITION", _INT16, 1.0),
}
"""Up to 4.6: name, type and unit, in that of the newer one."""
_NOT_OLD = frozenset({"MAV_GCS_SYSID_HI"})


class ArduCopterModel(FirmwareModel):
    """Numbers, names and habits of ArduCopter.

    Args:
        old_names: speak with the parameter names and units of releases up to 4.6,
            which answer nothing to a question for an unknown parameter.
    """

    autopilot = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_GLOBAL_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    )
    vtol_state = mavlink.MAV_VTOL_STATE_MC
    modes = ModeBehaviour(
        at_boot=FlightMode.STABILIZE,
        for_reposition=FlightMode.GUIDED,
        by_hand=FlightMode.LOITER,
        unarmable=frozenset({FlightMode.AUTO, FlightMode.RTL, FlightMode.LAND, FlightMode.BRAKE}),
        change_speed=frozenset({FlightMode.GUIDED, FlightMode.AUTO, FlightMode.RTL}),
        told_at_once=True,
        set_mode_acknowledged_as=mavlink.MAVLINK_MSG_ID_SET_MODE,
    )
    mode_names = MappingProxyType({number: (mode, mode.value) for number, mode in _MODES.items()})
    told_modes = MappingProxyType(
        {
            FlightMode.AUTO: "Auto",
            FlightMode.STABILIZE: "Stabilize",
            FlightMode.ALT_HOLD: "Altitude Hold",
            FlightMode.LOITER: "Loiter",
            FlightMode.GUIDED: "Guided",
            FlightMode.LAND: "Land",
            FlightMode.RTL: "RTL",
            FlightMode.POSHOLD: "Position Hold",
            FlightMode.BRAKE: "Brake",
        }
    )
    missions = MissionBehaviour(first_item=1, restarts=True, gives_way=True)
    refusals = RefusalCodes(
        not_now=mavlink.MAV_RESULT_FAILED,
        no_such_mode=mavlink.MAV_RESULT_FAILED,
        reposition_without_flag=mavlink.MAV_RESULT_DENIED,
        no_such_stream=mavlink.MAV_RESULT_DENIED,
        no_such_message=mavlink.MAV_RESULT_FAILED,
        no_such_place=mavlink.MAV_RESULT_FAILED,
        outside_fence=mavlink.MAV_RESULT_FAILED,
    )
    failsafe_behaviour = FailsafeBehaviour(
        battery_words=(
            TextTemplate(_WARNING, "Battery 1 is {level} {volts:.2f}V used {used_mah:.0f} mAh"),
            TextTemplate(_WARNING, "Battery Failsafe"),
        ),
        position_words=(
            TextTemplate(_CRITICAL, "EKF variance: position lost"),
            TextTemplate(_CRITICAL, "EKF Failsafe: changed to Land Mode"),
        ),
        ground_regained=TextTemplate(_WARNING, "GCS Failsafe Cleared"),
        critical_when_disarmed=True,
    )
    fence_behaviour = FenceBehaviour(
        "Vehicle breaching Polygon fence", tells_status=True, switchable=True
    )
    disarm_delay_after_landing = ParameterRole.DISARM_DELAY_S
    jerk_cost_s = staticmethod(arducopter_jerk_s)
    disarms_at_once = frozenset({FlightMode.RTL, FlightMode.LAND})

    take_off_above_home = True
    reads_frames = True
    forgets_speed = True
    targets_end_look = True
    """Its position controller starts with the speed parameter at the first target."""
    tells_origin_when_armed = True
    coasting_s = 7.0

    missing_messages = frozenset({mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS})

    stage_texts = MappingProxyType(
        {
            PowerUpStage.BOOTED: TextTemplate(_INFO, "ArduPilot Ready"),
            PowerUpStage.ORIGIN: TextTemplate(_INFO, "EKF3 IMU0 origin set"),
            PowerUpStage.POSITION: TextTemplate(_INFO, "EKF3 IMU0 is using GPS"),
        }
    )
    texts = texts_of(_TEXTS)

    def __init__(self, *, old_names: bool = False) -> None:
        self._old_names = old_names
        self.parameter_habits = ParameterBehaviour(
            reports_errors=not old_names,
            # As recorded: the old name of a renamed parameter got neither value nor error.
            unanswered=frozenset({"SYSID_THISMAV"}),
        )
        minor = 6 if old_names else 8
        self.version = 4 << 24 | minor << 16

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up."""
        newest = (
            ParameterEntry("MAV_SYSID", float(config.system_id), _INT16, read_only=True),
            ParameterEntry("MAV_GCS_SYSID", 255.0, _INT16, least=1.0),
            ParameterEntry("MAV_GCS_SYSID_HI", 0.0, _INT16, least=0.0),
            ParameterEntry("ARMING_SKIPCHK", float(self._old_names), _INT32),
            ParameterEntry("WP_SPD", config.cruise_m_s, _REAL, ParameterRole.CRUISE_M_S, least=0.1),
            ParameterEntry(
                "WP_SPD_UP", config.climb_m_s, _REAL, ParameterRole.CLIMB_M_S, least=0.1
            ),
            self.acceleration_entry("WP_ACC", config.acceleration_m_s2, 0.5),
            ParameterEntry("WP_JERK", 1.0, _REAL, least=1.0),
            ParameterEntry("WP_ACC_CNR", 0.0, _REAL, least=0.0),
            ParameterEntry("WP_RADIUS_M", 2.0, _REAL, ParameterRole.CORNER_RADIUS_M, least=0.05),
            ParameterEntry(
                "LAND_SPD_MS", config.land_m_s, _REAL, ParameterRole.LAND_M_S, least=0.1
            ),
            ParameterEntry("RTL_ALT_M", 15.0, _REAL, ParameterRole.RETURN_HEIGHT_M, least=0.0),
            ParameterEntry("MAV1_POSITION", 0.0, _INT16, least=0.0),
            ParameterEntry("DISARM_DELAY", 10.0, _INT8, ParameterRole.DISARM_DELAY_S, least=0.0),
            ParameterEntry(
                "RTL_LOIT_TIME", 5000.0, _INT32, ParameterRole.RETURN_WAIT_S, 1e-3, least=0.0
            ),
            ParameterEntry("GUID_TIMEOUT", 3.0, _REAL, least=0.1),
            self.jerk_entry("PSC_JERK_NE", config.jerk_m_s3),
            ParameterEntry("ATC_ANGLE_MAX", 80.0, _REAL, read_only=True),
            ParameterEntry("FS_GCS_ENABLE", 0.0, _INT8),
            ParameterEntry("FS_GCS_TIMEOUT", 5.0, _REAL, least=2.0),
            ParameterEntry("BATT_FS_LOW_ACT", 0.0, _INT8),
            ParameterEntry("BATT_LOW_VOLT", 10.5, _REAL, least=0.0),
            ParameterEntry("FENCE_ENABLE", 0.0, _INT8),
            ParameterEntry("FENCE_TYPE", 7.0, _INT8),
            ParameterEntry("FENCE_RADIUS", 300.0, _REAL, least=30.0),
            ParameterEntry("FENCE_ACTION", 1.0, _INT8, least=0.0),
            ParameterEntry("FENCE_AUTOENABLE", 0.0, _INT8, least=0.0),
            ParameterEntry("FENCE_MARGIN", 2.0, _REAL, least=0.0),
            ParameterEntry("FENCE_OPTIONS", 0.0, _INT16, least=0.0),
            ParameterEntry("FENCE_TOTAL", 0.0, _INT8, read_only=True),
            ParameterEntry("CAM1_TYPE", 0.0, _INT8, least=0.0),
            ParameterEntry("CAM_AUTO_ONLY", 0.0, _INT8, least=0.0),
            ParameterEntry("AUTO_OPTIONS", 0.0, _INT32),
            ParameterEntry("MIS_TOTAL", 0.0, _INT16, read_only=True),
            ParameterEntry("MIS_RESTART", 0.0, _INT8),
        )
        if not self._old_names:
            return newest
        return tuple(_old(entry) for entry in newest if entry.name not in _NOT_OLD)

    def ground_lost(self, parameters: ParameterTable) -> GcsFailsafe | None:
        """Returns, or lands; it listens to one system id, or to some next to each other."""
        action = parameters.value("FS_GCS_ENABLE")
        if not action:
            return None
        lowest = int(parameters.value("SYSID_MYGCS" if self._old_names else "MAV_GCS_SYSID"))
        highest = max(lowest, int(parameters.value("MAV_GCS_SYSID_HI")))
        mode = FlightMode.LAND if action in _GROUND_LOST_LANDS else FlightMode.RTL
        return GcsFailsafe(mode, parameters.value("FS_GCS_TIMEOUT"), range(lowest, highest + 1))

    def fence_radius_m(self, parameters: ParameterTable) -> float:
        """Where it is on, and a circle."""
        circle = int(parameters.value("FENCE_TYPE")) & _FENCE_CIRCLE
        on = parameters.value("FENCE_ENABLE") and circle
        return parameters.value("FENCE_RADIUS") if on else 0.0

    def fence_on(self, parameters: ParameterTable, switched: bool | None) -> bool:
        """Where polygons are on, by parameter or by command, and may be."""
        polygon = int(parameters.value("FENCE_TYPE")) & _FENCE_POLYGON
        on = parameters.value("FENCE_ENABLE") if switched is None else switched
        return bool(on and polygon)

    def fence_mode(self, parameters: ParameterTable) -> FlightMode | None:
        """It returns, through the fence if need be."""
        return _FENCE_MODES.get(int(parameters.value("FENCE_ACTION")))

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE; the third says nothing here."""
        del sub
        return int(main) if math.isfinite(main) else None

    def base_mode(self, pilot: Pilot) -> int:
        """MAV_MODE_FLAG bits of a heartbeat.

        It sets GUIDED_ENABLED while its position controller runs: so also
        while booting, and no longer once it has returned and landed.
        """
        bits = int(_ALWAYS_SET)
        landed = pilot.flight.on_ground and not pilot.armed
        returned = pilot.mode is FlightMode.RTL and landed
        if not pilot.readiness.booted or (pilot.mode.controls_position and not returned):
            bits |= mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
        if pilot.armed:
            bits |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return bits

    def system_status(self, pilot: Pilot) -> int:
        """MAV_STATE of a heartbeat: active in the air only."""
        if not pilot.readiness.booted:
            return int(mavlink.MAV_STATE_BOOT)
        on_ground = pilot.flight.on_ground
        return int(mavlink.MAV_STATE_STANDBY if on_ground else mavlink.MAV_STATE_ACTIVE)

    def sensors(self, pilot: Pilot) -> tuple[int, int, int]:
        """Bits of SYS_STATUS, as recorded."""
        seen, running = (_GPS, _AHRS) if pilot.readiness.has_origin else (0, 0)
        if pilot.mode.controls_position:
            running |= _POSITION_CONTROL
        checked = 0 if pilot.obstacles else _PREARM
        on = seen | running
        return _PRESENT | seen, _ENABLED | on, _HEALTHY | on | checked

    def mission_told(self, pilot: Pilot) -> tuple[int, int, int]:
        """Home doesn't count; the mode is 1 in the mission mode, 0 (not told) otherwise."""
        run = pilot.run
        if not run.present:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif run.state is MissionRunState.COMPLETE:
            state = mavlink.MISSION_STATE_COMPLETE
        elif run.state is MissionRunState.RUNNING:
            state = mavlink.MISSION_STATE_ACTIVE
        elif run.state is MissionRunState.STOPPED and run.begun:
            state = mavlink.MISSION_STATE_PAUSED
        else:
            state = mavlink.MISSION_STATE_NOT_STARTED
        return max(0, len(pilot.store.items) - 1), state, int(pilot.mode is FlightMode.AUTO)


def _old(entry: ParameterEntry) -> ParameterEntry:
    """A parameter as releases up to 4.6 have it."""
    name, kind, unit = _OLD_NAMES.get(entry.name, (entry.name, entry.type, 1.0))
    return replace(
        entry,
        name=name,
        value=entry.value / unit,
        type=kind,
        unit_si=entry.unit_si * unit,
        least=entry.least / unit,
    )
