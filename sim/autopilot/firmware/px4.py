"""PX4 1.17 on a multicopter, as recorded.

Sources: recordings of PX4 1.17 (SIH quadrotor), https://docs.px4.io/main/en/flight_modes_mc/,
https://docs.px4.io/main/en/advanced_config/parameter_reference.html, and the behaviour of
its modules `commander`, `navigator` and `mavlink`. Left out are OFFBOARD and ACRO, the cone in
which it returns at a lower height, events (its newer way to give reasons), and parameters that
neither change the simulated vehicle nor are asked for by common ground stations.
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import px4_jerk_s
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, OwnCommand, TextTemplate
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
from sim.autopilot.parameters import (
    ParameterBehaviour,
    ParameterEntry,
    ParameterRole,
    ParameterTable,
)

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_REAL = mavlink.MAV_PARAM_TYPE_REAL32
_INT32 = mavlink.MAV_PARAM_TYPE_INT32

_MODES = {
    (1, 0): (FlightMode.MANUAL, "Manual"),
    (2, 0): (FlightMode.ALT_HOLD, "Altitude"),
    (3, 0): (FlightMode.POSHOLD, "Position"),
    (4, 2): (FlightMode.TAKEOFF, "Takeoff"),
    (4, 3): (FlightMode.LOITER, "Hold"),
    (4, 4): (FlightMode.AUTO, "Mission"),
    (4, 5): (FlightMode.RTL, "Return"),
    (4, 6): (FlightMode.LAND, "Land"),
    (7, 0): (FlightMode.STABILIZE, "Stabilized"),
}
"""Main and sub mode -> the mode and what people read."""
_AUTOMATIC = frozenset(
    {FlightMode.TAKEOFF, FlightMode.LOITER, FlightMode.AUTO, FlightMode.RTL, FlightMode.LAND}
)

_HEALTH_AT_BOOT = 0x0321C83F
_PRESENT = 0x0300402F
_ENABLED = 0x0301402F
_HEALTHY = 0x0320C83F
_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
"""Told in the health bits alone."""

_GROUND_LOST_MODES = {2: FlightMode.RTL, 3: FlightMode.LAND}
"""By NAV_DLL_ACT; it holds, and falls, in other ways than are simulated."""
_FENCE_MODES = {2: FlightMode.LOITER, 3: FlightMode.RTL, 5: FlightMode.LAND}
"""By GF_ACTION; it warns, and terminates the flight, in other ways than are simulated."""
_GROUND_LOST_SPARED = {1: FlightMode.AUTO, 2: FlightMode.LOITER}
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

_TEXTS = {
    _INFO: {
        FirmwareEvent.ARMED: "Armed by external command",
        FirmwareEvent.DISARMED: "Disarmed by external command",
        FirmwareEvent.DISARMED_UNUSED: "Disarmed by auto preflight disarming",
        FirmwareEvent.DISARMED_LANDED: "Disarmed by landing",
        FirmwareEvent.LIFTED_OFF: "Takeoff detected",
        FirmwareEvent.LANDED: "Landing detected",
        FirmwareEvent.MISSION_BEGUN: "Executing Mission",
        FirmwareEvent.MISSION_CLIMB: "Climb to {height_m:.1f} meters above home",
        FirmwareEvent.MISSION_OVER: "Mission finished, loitering",
        FirmwareEvent.MISSION_OVER_ON_GROUND: "Mission finished, landed",
        FirmwareEvent.LANDING_ORDERED: "Landing at current position",
        FirmwareEvent.RETURN_ORDERED: "Returning to launch",
        FirmwareEvent.RETURN_BEGUN: (
            "RTL: start return at {altitude_m:.0f} m ({above_home_m:.0f} m above destination)"
        ),
        FirmwareEvent.RETURN_LANDING: "RTL: land at destination",
    },
    _CRITICAL: {
        FirmwareEvent.ARMING_REFUSED: "Arming denied: Resolve system health failures first",
        FirmwareEvent.DISARMING_REFUSED: "Disarming denied: not landed",
        FirmwareEvent.TAKE_OFF_RAISED: "Using minimum takeoff altitude: {height_m:.2f} m",
        FirmwareEvent.NO_SUCH_MODE: "Unsupported auto mode",
        FirmwareEvent.MODE_REFUSED: "Switching to mode '{mode}' is currently not available",
        FirmwareEvent.FENCE_WITHOUT_HOME: "Geofence invalid, doesn't contain Home position",
        FirmwareEvent.FENCE_ACTED: "Failsafe activated",
        FirmwareEvent.TARGET_OUTSIDE_FENCE: "Reposition is outside geofence",
        FirmwareEvent.MISSION_UNAVAILABLE: "No valid mission available, loitering",
        FirmwareEvent.MISSION_UNAVAILABLE_ON_GROUND: (
            "No valid mission available, refusing takeoff"
        ),
    },
}


def _custom_mode(main: int, sub: int) -> int:
    return main << 16 | sub << 24


class Px4Model(FirmwareModel):
    """Numbers, names and habits of PX4."""

    autopilot = mavlink.MAV_AUTOPILOT_PX4
    capabilities = (
        mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FLOAT
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
        | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_BYTEWISE
        | mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mavlink.MAV_PROTOCOL_CAPABILITY_MISSION_FENCE
    )
    vtol_state = mavlink.MAV_VTOL_STATE_UNDEFINED
    version = 1 << 24 | 17 << 16 | 255
    modes = ModeBehaviour(
        at_boot=FlightMode.LOITER,
        for_reposition=FlightMode.LOITER,
        by_hand=FlightMode.POSHOLD,
        for_take_off=FlightMode.TAKEOFF,
        after_flight=FlightMode.LOITER,
        unarmable=frozenset({FlightMode.RTL, FlightMode.LAND}),
        change_speed=frozenset(FlightMode),
        reposition_needs_flag=True,
        flies_when_armed=True,
        acknowledgements=2,
        set_mode_acknowledged_as=mavlink.MAV_CMD_DO_SET_MODE,
    )
    mode_names = MappingProxyType(
        {_custom_mode(main, sub): named for (main, sub), named in _MODES.items()}
    )
    told_modes = MappingProxyType(
        {
            FlightMode.MANUAL: "Manual",
            FlightMode.ALT_HOLD: 4,
            FlightMode.POSHOLD: 1,
            FlightMode.AUTO: 6,
            FlightMode.LOITER: "Hold",
            FlightMode.RTL: 5,
            FlightMode.STABILIZE: "Stabilized",
            FlightMode.LAND: 8,
            FlightMode.TAKEOFF: 7,
        }
    )
    """As PX4 1.17 was seen to, without those that are not simulated."""
    tells_all_modes = True
    custom_mode_bits = 0xFFFF0000
    missions = MissionBehaviour(
        asks_for_int=True,
        int_frames=True,
        gives_up_silently=True,
        marks_current=True,
        check_s=1.9,
        upload_rewinds=True,
        climbs_first=True,
        repeats_reached=10,
        keeps_number=True,
        tells_camera=True,
        item_radius=True,
        forgets_mode=True,
    )
    refusals = RefusalCodes(
        not_now=mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
        no_such_mode=mavlink.MAV_RESULT_DENIED,
        reposition_without_flag=mavlink.MAV_RESULT_UNSUPPORTED,
        no_such_stream=mavlink.MAV_RESULT_FAILED,
        no_such_message=mavlink.MAV_RESULT_DENIED,
        no_such_place=mavlink.MAV_RESULT_ACCEPTED,
        outside_fence=mavlink.MAV_RESULT_ACCEPTED,
    )
    disarm_delay_after_landing = ParameterRole.DISARM_LANDED_S
    jerk_cost_s = staticmethod(px4_jerk_s)
    fence_behaviour = FenceBehaviour(
        "Geofence breached", inclusions_add=True, needs_home_inside=True, critical=True
    )
    failsafe_behaviour = FailsafeBehaviour(
        hold_s=_FAILSAFE_HOLD_S,
        words=(TextTemplate(_CRITICAL, "Failsafe activated"),),
        hold_words=(
            TextTemplate(
                _CRITICAL, f"Failsafe activated: entering Hold for {_FAILSAFE_HOLD_S:.0f} seconds"
            ),
        ),
        battery_words=(TextTemplate(_CRITICAL, "Critical battery"),),
        ground_regained=TextTemplate(_INFO, "GCS connection regained"),
        deaf_after_s=_HEARTBEAT_MISSED_S + _TEXTS_KEPT_S,
    )
    parameter_habits = ParameterBehaviour(
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

    obeys_leg_speed = True
    looks_in_missions_alone = True
    pauses_anywhere = True
    constant_position_at_rest = True
    home_follows_landing = True
    coasting_s = math.inf

    unasked_streams = MappingProxyType(
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
    fixed_streams = frozenset({mavlink.MAVLINK_MSG_ID_MISSION_CURRENT})
    missing_messages = frozenset({mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT})

    texts = MappingProxyType(
        {
            **texts_of(_TEXTS),
            FirmwareEvent.FENCE_BREACHED: TextTemplate(
                _CRITICAL, "Geofence: approaching or outside geofence", plain=True
            ),
        }
    )
    own_commands = MappingProxyType(
        {
            FirmwareEvent.MISSION_OVER: OwnCommand(
                mavlink.MAV_CMD_DO_TRIGGER_CONTROL, (-1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
            ),
            FirmwareEvent.RETURN_BEGUN: OwnCommand(
                mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
                (1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0),
            ),
            FirmwareEvent.RETURN_LANDED: OwnCommand(0, (0.0, 2.0, 80.0, math.nan, 0.0, 0.0, 0.0)),
        }
    )
    """The mission triggers cameras and the return takes over gimbals; number 0 is recorded so."""
    numbers_texts = True

    def parameters(self, config: VehicleConfig) -> tuple[ParameterEntry, ...]:
        """The parameter table at power-up, by name as PX4 sorts it."""
        return (
            ParameterEntry("COM_DISARM_LAND", 2.0, _REAL, ParameterRole.DISARM_LANDED_S),
            ParameterEntry("COM_DISARM_PRFLT", 10.0, _REAL, ParameterRole.DISARM_DELAY_S),
            ParameterEntry("COM_DLL_EXCEPT", 0.0, _INT32, least=0.0),
            ParameterEntry("COM_DL_LOSS_T", 30.0, _INT32, least=5.0),
            ParameterEntry("COM_LOW_BAT_ACT", 3.0, _INT32, least=0.0),
            ParameterEntry("COM_OBC_LOSS_T", 15.0, _REAL, least=0.0),
            ParameterEntry("COM_OF_LOSS_T", 3.0, _REAL, least=0.0),
            ParameterEntry("COM_RC_IN_MODE", 1.0, _INT32, least=0.0),
            ParameterEntry("COM_RC_LOSS_T", 3.0, _REAL, least=0.0),
            ParameterEntry("GF_ACTION", 2.0, _INT32, least=0.0),
            ParameterEntry("GF_MAX_HOR_DIST", 0.0, _REAL, least=0.0),
            ParameterEntry("GF_MAX_VER_DIST", 0.0, _REAL, least=0.0),
            ParameterEntry("GF_PREDICT", 0.0, _INT32, least=0.0),
            ParameterEntry("GF_SOURCE", 0.0, _INT32, least=0.0),
            ParameterEntry("MAV_SYS_ID", float(config.system_id), _INT32, read_only=True),
            ParameterEntry("MAV_TYPE", float(mavlink.MAV_TYPE_QUADROTOR), _INT32, read_only=True),
            ParameterEntry(
                "MIS_TAKEOFF_ALT", 2.5, _REAL, ParameterRole.TAKE_OFF_HEIGHT_M, least=0.0
            ),
            self.acceleration_entry("MPC_ACC_HOR", config.acceleration_m_s2, 2.0),
            self.jerk_entry("MPC_JERK_AUTO", config.jerk_m_s3),
            ParameterEntry(
                "MPC_LAND_SPEED", config.land_m_s, _REAL, ParameterRole.LAND_M_S, least=0.6
            ),
            ParameterEntry(
                "MPC_TKO_SPEED", config.climb_m_s, _REAL, ParameterRole.TAKE_OFF_M_S, least=0.1
            ),
            ParameterEntry(
                "MPC_XY_CRUISE", config.cruise_m_s, _REAL, ParameterRole.CRUISE_M_S, least=0.1
            ),
            ParameterEntry("MPC_TILTMAX_AIR", 89.0, _REAL, read_only=True),
            ParameterEntry("MPC_XY_ERR_MAX", 2.0, _REAL, least=0.1),
            ParameterEntry("MPC_XY_TRAJ_P", 0.5, _REAL, least=0.1),
            ParameterEntry(
                "MPC_XY_VEL_MAX",
                max(12.0, config.cruise_m_s),
                _REAL,
                ParameterRole.TOP_SPEED_M_S,
                least=0.0,
            ),
            ParameterEntry("MPC_Z_V_AUTO_UP", 3.0, _REAL, ParameterRole.CLIMB_M_S, least=0.1),
            ParameterEntry("NAV_ACC_RAD", 2.0, _REAL, ParameterRole.CORNER_RADIUS_M, least=0.05),
            ParameterEntry("NAV_DLL_ACT", 0.0, _INT32, least=0.0),
            ParameterEntry("RTL_DESCEND_ALT", 10.0, _REAL, least=0.0),
            ParameterEntry("RTL_LAND_DELAY", 0.0, _REAL, ParameterRole.RETURN_WAIT_S),
            ParameterEntry("RTL_RETURN_ALT", 30.0, _REAL, ParameterRole.RETURN_HEIGHT_M, least=0.0),
            ParameterEntry("SYS_AUTOSTART", 10040.0, _INT32, least=0.0),
        )

    def ground_lost(self, parameters: ParameterTable) -> GcsFailsafe | None:
        """Returns, or lands; any ground station will do."""
        mode = _GROUND_LOST_MODES.get(int(parameters.value("NAV_DLL_ACT")))
        if mode is None:
            return None
        after_s = _HEARTBEAT_MISSED_S + parameters.value("COM_DL_LOSS_T")
        excepted = int(parameters.value("COM_DLL_EXCEPT"))
        spared = {each for bit, each in _GROUND_LOST_SPARED.items() if excepted & bit}
        return GcsFailsafe(mode, after_s, range(1, 256), frozenset(spared))

    def fence_radius_m(self, parameters: ParameterTable) -> float:
        """A circle, unless it is 0."""
        return parameters.value("GF_MAX_HOR_DIST")

    def fence_on(self, parameters: ParameterTable, switched: bool | None) -> bool:
        """Unless nothing is done about it; there is no switch."""
        del switched
        return parameters.value("GF_ACTION") > 0.0

    def fence_mode(self, parameters: ParameterTable) -> FlightMode | None:
        """It holds its place, by default."""
        return _FENCE_MODES.get(int(parameters.value("GF_ACTION")))

    def mode_commanded(self, main: float, sub: float) -> int | None:
        """``custom_mode`` from parameters 2 and 3 of DO_SET_MODE."""
        if not (0.0 <= main <= 255.0 and 0.0 <= sub <= 255.0):
            return None
        return _custom_mode(int(main), int(sub))

    def base_mode(self, pilot: Pilot) -> int:
        """MAV_MODE_FLAG bits of a heartbeat."""
        bits: int = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        if pilot.mode in _AUTOMATIC:
            bits |= (
                mavlink.MAV_MODE_FLAG_AUTO_ENABLED
                | mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
                | mavlink.MAV_MODE_FLAG_GUIDED_ENABLED
            )
        else:
            bits |= mavlink.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
            if pilot.mode is not FlightMode.MANUAL:
                bits |= mavlink.MAV_MODE_FLAG_STABILIZE_ENABLED
        if pilot.armed:
            bits |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        return bits

    def system_status(self, pilot: Pilot) -> int:
        """MAV_STATE of a heartbeat: active once the motors run, uninitialised before they may.

        What it checks before it arms it takes for part of its initialisation.
        """
        if pilot.armed:
            return int(mavlink.MAV_STATE_ACTIVE)
        ready = pilot.readiness.booted and not pilot.obstacles
        return int(mavlink.MAV_STATE_STANDBY if ready else mavlink.MAV_STATE_UNINIT)

    def sensors(self, pilot: Pilot) -> tuple[int, int, int]:
        """Bits of SYS_STATUS, as recorded."""
        if not pilot.readiness.has_origin:
            return 0, 0, _HEALTH_AT_BOOT
        return _PRESENT, _ENABLED, _HEALTHY | (0 if pilot.obstacles else _PREARM)

    def mission_told(self, pilot: Pilot) -> tuple[int, int, int]:
        """``total``, ``mission_state`` and ``mission_mode`` of MISSION_CURRENT.

        The state speaks of the mode more than of the mission: a take-off or a landing that is
        done completes it too, and one that was left half-way stays active.
        """
        flown = pilot.mode in (FlightMode.AUTO, FlightMode.TAKEOFF, FlightMode.LAND)
        if not pilot.run.present:
            state = mavlink.MISSION_STATE_NO_MISSION
        elif pilot.task_done:
            state = mavlink.MISSION_STATE_COMPLETE
        elif flown or pilot.run.current:
            state = mavlink.MISSION_STATE_ACTIVE
        else:
            state = mavlink.MISSION_STATE_NOT_STARTED
        mode = _MISSION_MODE_ACTIVE if flown else _MISSION_MODE_SUSPENDED
        return len(pilot.store.items) or _UNKNOWN_TOTAL, state, mode
