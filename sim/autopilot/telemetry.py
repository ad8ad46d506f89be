"""What a vehicle reports about itself, message by message.

Source: https://mavlink.io/en/messages/common.html. Attitude other than heading, raw sensors and RC
channels are not told.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import ChargeLevel
from sim.autopilot.flight import MotionPhase
from sim.autopilot.pilot import Pilot
from sim.autopilot.positions import home_position, origin_position, place_wgs84_e7

_EKF_ALIGNED = (
    mavlink.EKF_ATTITUDE
    | mavlink.EKF_VELOCITY_HORIZ
    | mavlink.EKF_VELOCITY_VERT
    | mavlink.EKF_POS_VERT_ABS
)
_EKF_WITHOUT_POSITION = _EKF_ALIGNED | mavlink.EKF_CONST_POS_MODE
_EKF_WITH_POSITION = (
    _EKF_ALIGNED
    | mavlink.EKF_POS_HORIZ_REL
    | mavlink.EKF_POS_HORIZ_ABS
    | mavlink.EKF_PRED_POS_HORIZ_REL
    | mavlink.EKF_PRED_POS_HORIZ_ABS
)

_EKF_COASTING = mavlink.EKF_ATTITUDE | mavlink.EKF_VELOCITY_VERT | mavlink.EKF_POS_VERT_ABS

_GPS = mavlink.MAV_SYS_STATUS_SENSOR_GPS
_BATTERY = mavlink.MAV_SYS_STATUS_SENSOR_BATTERY
_FENCE = mavlink.MAV_SYS_STATUS_GEOFENCE
_UTC_AT_BOOT_US = 1_735_689_600_000_000
"""Simulated GPS time at boot: 2025-01-01 UTC. The core knows no wall clock."""
_INT16_MAX = 32767
_UNKNOWN_MV = 65535
_LANDED_STATES = {
    MotionPhase.GROUNDED: mavlink.MAV_LANDED_STATE_ON_GROUND,
    MotionPhase.SPOOLING_UP: mavlink.MAV_LANDED_STATE_ON_GROUND,
    MotionPhase.TAKING_OFF: mavlink.MAV_LANDED_STATE_TAKEOFF,
    MotionPhase.LANDING: mavlink.MAV_LANDED_STATE_LANDING,
    MotionPhase.TOUCHED_DOWN: mavlink.MAV_LANDED_STATE_LANDING,
}
"""All else is in the air."""

DATA_STREAMS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_MISSION_CURRENT,
        mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
    ),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (
        mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT,
    ),
}
"""The older way to ask for streams, MAV_DATA_STREAM -> message ids."""


class TelemetryReporter:
    """Builds reports from the state of one pilot."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self._heading_deg = 0.0
        builders: dict[int, Callable[[float], mavlink.MAVLink_message]] = {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._heartbeat,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: self._gps_raw,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_MISSION_CURRENT: self._mission_current,
            mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: self._navigation,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT: self._ekf_status,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: self._estimator_status,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self._origin,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
        }
        missing = pilot.flavour.missing_messages
        self._builders = {key: build for key, build in builders.items() if key not in missing}

    @property
    def known(self) -> frozenset[int]:
        """Message ids that can be asked for."""
        return frozenset(self._builders)

    def build(self, message_id: int, now_s: float) -> mavlink.MAVLink_message | None:
        """The message as of now; None if there is none of that id, or nothing to say yet."""
        if message_id not in self._builders:
            return None
        if not self._pilot.readiness.has_origin and message_id in (
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION,
        ):
            return None
        return self._builders[message_id](now_s)

    def _boot_s(self, now_s: float) -> float:
        return max(0.0, now_s - self._pilot.readiness.boot_s)

    def _boot_us(self, now_s: float) -> int:
        return int(self._boot_s(now_s) * 1e6)

    def _boot_ms(self, now_s: float) -> int:
        return int(self._boot_s(now_s) * 1e3) & 0xFFFFFFFF

    def _state(self) -> int:
        """MAV_STATE."""
        pilot = self._pilot
        if pilot.readiness.booted and (pilot.failsafes.acts or pilot.fence.acts):
            return int(mavlink.MAV_STATE_CRITICAL)
        return pilot.flavour.system_status(pilot)

    def _heartbeat(self, now_s: float) -> mavlink.MAVLink_message:
        del now_s
        pilot = self._pilot
        return mavlink.MAVLink_heartbeat_message(
            pilot.flavour.vehicle_type,
            pilot.flavour.autopilot,
            pilot.flavour.base_mode(pilot),
            pilot.flavour.custom_mode(pilot.mode),
            self._state(),
            3,
        )

    def _sys_status(self, now_s: float) -> mavlink.MAVLink_message:
        pilot = self._pilot
        present, enabled, healthy = pilot.flavour.sensors(pilot)
        lost = _GPS if pilot.readiness.gps_lost else 0
        lost |= _BATTERY if pilot.battery.level > ChargeLevel.FINE else 0
        lost |= _FENCE if pilot.fence.breached else 0
        fenced = _FENCE if pilot.parameters.value("FENCE_ENABLE") or pilot.fence.switched else 0
        return mavlink.MAVLink_sys_status_message(
            *(present, enabled | fenced, healthy & ~lost, 0),
            *self._measured(now_s),
            *(0, 0, 0, 0, 0, 0),
        )

    def _measured(self, now_s: float) -> tuple[int, int, int]:
        """Voltage [mV], current [0.01 A] and remaining charge [%] of the battery."""
        battery = self._pilot.battery
        voltage_mv = round(battery.voltage_v(now_s) * 1e3)
        remaining_percent = math.ceil(battery.remaining_frac(now_s) * 100.0)
        return voltage_mv, round(battery.current_a * 100.0), remaining_percent

    def _battery(self, now_s: float) -> mavlink.MAVLink_message:
        voltage_mv, current_ca, remaining_percent = self._measured(now_s)
        consumed_mah = self._pilot.battery.consumed_mah(now_s)
        return mavlink.MAVLink_battery_status_message(
            0,
            mavlink.MAV_BATTERY_FUNCTION_ALL,
            mavlink.MAV_BATTERY_TYPE_LIPO,
            _INT16_MAX,
            [voltage_mv, *[_UNKNOWN_MV] * 9],
            current_ca,
            -1 if consumed_mah is None else round(consumed_mah),
            -1,
            remaining_percent,
        )

    def _system_time(self, now_s: float) -> mavlink.MAVLink_message:
        fixed = self._pilot.readiness.has_origin
        utc_us = _UTC_AT_BOOT_US + self._boot_us(now_s) if fixed else 0
        return mavlink.MAVLink_system_time_message(utc_us, self._boot_ms(now_s))

    def _gps_raw(self, now_s: float) -> mavlink.MAVLink_message:
        fixed = self._pilot.readiness.has_origin and not self._pilot.readiness.gps_lost
        lat_e7, lon_e7, alt_mm = self._place(now_s)
        return mavlink.MAVLink_gps_raw_int_message(
            self._boot_us(now_s),
            mavlink.GPS_FIX_TYPE_RTK_FIXED if fixed else mavlink.GPS_FIX_TYPE_NO_FIX,
            *(lat_e7, lon_e7, alt_mm),
            *(100, 100) if fixed else (65535, 65535),
            min(65535, round(self._ground_speed_m_s(now_s) * 100.0)),
            self._heading_cdeg(now_s),
            10 if fixed else 0,
        )

    def _place(self, now_s: float) -> tuple[int, int, int]:
        if not self._pilot.readiness.has_origin:
            return 0, 0, 0
        return place_wgs84_e7(self._pilot.config.origin, self._pilot.told_enu_m(now_s))

    def _velocity_ned_m_s(self, now_s: float) -> tuple[float, float, float]:
        east_m_s, north_m_s, up_m_s = self._pilot.flight.motion.velocity_enu_m_s(now_s)
        if self._pilot.readiness.gps_lost:
            east_m_s = north_m_s = 0.0
        return north_m_s, east_m_s, 0.0 - up_m_s

    def _ground_speed_m_s(self, now_s: float) -> float:
        north_m_s, east_m_s, _ = self._velocity_ned_m_s(now_s)
        return math.hypot(north_m_s, east_m_s)

    def _heading_cdeg(self, now_s: float) -> int:
        """Heading 0..35999 [0.01 deg]: as it was told, else along the way flown last."""
        north_m_s, east_m_s, _ = self._velocity_ned_m_s(now_s)
        told_deg = self._pilot.camera.heading_deg(now_s)
        if told_deg is not None:
            self._heading_deg = told_deg
        elif north_m_s or east_m_s:
            self._heading_deg = math.degrees(math.atan2(east_m_s, north_m_s))
        return round(self._heading_deg * 100.0) % 36000

    def _attitude(self, now_s: float) -> mavlink.MAVLink_message:
        heading_cdeg = self._heading_cdeg(now_s)
        yaw_rad = math.radians((heading_cdeg / 100.0 + 180.0) % 360.0 - 180.0)
        return mavlink.MAVLink_attitude_message(
            self._boot_ms(now_s), 0.0, 0.0, yaw_rad, 0.0, 0.0, 0.0
        )

    def _local_position(self, now_s: float) -> mavlink.MAVLink_message:
        east_m, north_m, up_m = self._pilot.told_enu_m(now_s)
        return mavlink.MAVLink_local_position_ned_message(
            self._boot_ms(now_s), north_m, east_m, 0.0 - up_m, *self._velocity_ned_m_s(now_s)
        )

    def _global_position(self, now_s: float) -> mavlink.MAVLink_message:
        up_m = self._pilot.position_enu_m(now_s)[2]
        relative_mm = round((up_m - self._pilot.flight.home_enu_m[2]) * 1e3)
        return mavlink.MAVLink_global_position_int_message(
            self._boot_ms(now_s),
            *self._place(now_s),
            relative_mm if self._pilot.readiness.has_origin else 0,
            *(
                max(-_INT16_MAX, min(_INT16_MAX, round(speed_m_s * 100.0)))
                for speed_m_s in self._velocity_ned_m_s(now_s)
            ),
            self._heading_cdeg(now_s),
        )

    def _navigation(self, now_s: float) -> mavlink.MAVLink_message:
        here, target = self._pilot.position_enu_m(now_s), self._pilot.flight.motion.target_enu_m
        east_m, north_m, up_m = (to - at for to, at in zip(target, here, strict=True))
        bearing_deg = round(math.degrees(math.atan2(east_m, north_m)))
        return mavlink.MAVLink_nav_controller_output_message(
            *(0.0, 0.0),
            round(self._heading_deg),
            bearing_deg,
            min(65535, round(math.hypot(east_m, north_m))),
            *(up_m, 0.0, 0.0),
        )

    def _vfr_hud(self, now_s: float) -> mavlink.MAVLink_message:
        ground_speed_m_s = self._ground_speed_m_s(now_s)
        return mavlink.MAVLink_vfr_hud_message(
            ground_speed_m_s,
            ground_speed_m_s,
            self._heading_cdeg(now_s) // 100,
            0 if self._pilot.flight.on_ground else 50,
            self._place(now_s)[2] / 1e3,
            -self._velocity_ned_m_s(now_s)[2],
        )

    def _mission_current(self, now_s: float) -> mavlink.MAVLink_message:
        del now_s
        pilot = self._pilot
        told = pilot.flavour.mission_told(pilot)
        return mavlink.MAVLink_mission_current_message(pilot.run.told, *told)

    def _version(self, now_s: float) -> mavlink.MAVLink_message:
        del now_s
        flavour = self._pilot.flavour
        no_hash = [0] * 8
        return mavlink.MAVLink_autopilot_version_message(
            flavour.capabilities,
            *(flavour.version, 0, 0, 0),
            *(no_hash, no_hash, no_hash),
            *(0, 0, self._pilot.config.system_id),
        )

    def _ekf_status(self, now_s: float) -> mavlink.MAVLink_message:
        ratios = (0.0, 0.0, 0.0, 0.0, 0.0)
        return mavlink.MAVLink_ekf_status_report_message(self._estimator_flags(now_s), *ratios)

    def _estimator_status(self, now_s: float) -> mavlink.MAVLink_message:
        ratios_and_accuracies = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
        flags = self._estimator_flags(now_s) & ~mavlink.EKF_UNINITIALIZED
        boot_us = self._boot_us(now_s)
        return mavlink.MAVLink_estimator_status_message(boot_us, flags, *ratios_and_accuracies)

    def _estimator_flags(self, now_s: float) -> int:
        readiness, flavour = self._pilot.readiness, self._pilot.flavour
        if not readiness.booted:
            return int(mavlink.EKF_UNINITIALIZED)
        flags = _EKF_WITHOUT_POSITION
        if readiness.has_position:
            flags = _EKF_WITH_POSITION
        elif readiness.lost_s(now_s) <= flavour.coasting_s:
            flags = _EKF_COASTING
        if flavour.constant_position_at_rest and self._pilot.flight.on_ground:
            flags |= mavlink.EKF_CONST_POS_MODE
        return int(flags)

    def _extended_state(self, now_s: float) -> mavlink.MAVLink_message:
        del now_s
        flavour, activity = self._pilot.flavour, self._pilot.flight.activity
        landed = _LANDED_STATES.get(activity, mavlink.MAV_LANDED_STATE_IN_AIR)
        if self._pilot.flight.drives:
            landed = mavlink.MAV_LANDED_STATE_UNDEFINED
        return mavlink.MAVLink_extended_sys_state_message(flavour.vtol_state, landed)

    def _origin(self, now_s: float) -> mavlink.MAVLink_message:
        return origin_position(self._pilot.config.origin, self._boot_us(now_s))

    def _home(self, now_s: float) -> mavlink.MAVLink_message:
        home_enu_m = self._pilot.flight.home_enu_m
        return home_position(self._pilot.config.origin, home_enu_m, self._boot_us(now_s))
