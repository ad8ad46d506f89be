"""A small scripted PX4 for tests of the bridge, in virtual time.

Written from the recordings and from nothing of the simulated autopilot. Link, motion and
knobs are those of the scripted ArduCopter; what is here is what PX4 does otherwise.
"""

from __future__ import annotations

import math
import struct
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from swarm.model.frames import enu_from_wgs84
from tests.support.fake_copter import ACCEPTED, DENIED, FAILED, SET_MODE, UNSUPPORTED, FakeCopter
from tests.support.fake_missions import Px4Missions

AUTO_TAKEOFF, AUTO_LOITER, AUTO_MISSION, AUTO_RTL, AUTO_LAND = (
    4 << 16 | sub << 24 for sub in (2, 3, 4, 5, 6)
)
POSCTL = 3 << 16

_INT32, _REAL32 = 6, 9
_PREARM = 0x10000000
_CONST_POS_MODE = 128
"""Set while it stands still, position or not; on the ground with a position it says 1023."""
_SPOOL_UP_S = 1.5
_CHANGE_TOLD_S = 0.4
"""How long after a change of mode a heartbeat tells it."""
_UNASKED_S = {1: 1.0, 33: 0.5, 42: 1.0, 245: 1.0}
_CHUNK_CHARS = 50


class FakePx4(FakeCopter):
    """One vehicle; `receive` and `advance` give back the bytes it says."""

    mav_type, autopilot = 2, 12
    tells_all_modes = True
    boot_mode, own_mode, pilot_mode = AUTO_LOITER, AUTO_LOITER, POSCTL
    return_mode, land_mode, mission_mode = AUTO_RTL, AUTO_LAND, AUTO_MISSION
    missions = Px4Missions
    mode_names: ClassVar = {
        AUTO_TAKEOFF: "AUTO.TAKEOFF",
        AUTO_LOITER: "AUTO.LOITER",
        AUTO_MISSION: "AUTO.MISSION",
        POSCTL: "POSCTL",
        AUTO_RTL: "AUTO.RTL",
        AUTO_LAND: "AUTO.LAND",
    }
    takeoff_mode = AUTO_TAKEOFF
    streams_asked = frozenset({33, 1, 230, 245})
    speed_names = ("MPC_XY_CRUISE",)
    failsafe_names = frozenset(
        {"NAV_DLL_ACT", "COM_DLL_EXCEPT", "COM_DL_LOSS_T", "COM_LOW_BAT_ACT", "SWARM_SIMULATED"}
    )
    limit_names = frozenset({"MPC_ACC_HOR", "MPC_JERK_AUTO", "MPC_TILTMAX_AIR", "MPC_XY_VEL_MAX"})
    fence_names = frozenset({"GF_ACTION"})
    fence_as_int = True
    jerk_names = ("MPC_JERK_AUTO",)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._texts = 0
        self.late_texts: list[tuple[int, str]] = []
        """To be said once what it heard is answered."""
        super().__init__(*args, **kwargs)
        self.ekf_flags = 895
        self.parameters = {
            "MPC_XY_CRUISE": self.default_speed_m_s,
            "MPC_JERK_AUTO": 4.0,
            "MPC_ACC_HOR": 3.0,
            "MPC_TILTMAX_AIR": 45.0,
            "MPC_XY_VEL_MAX": 12.0,
            "NAV_DLL_ACT": 2.0,
            "COM_DLL_EXCEPT": 0.0,
            "COM_DL_LOSS_T": 30.0,
            "COM_LOW_BAT_ACT": 3.0,
            "GF_ACTION": 2.0,
        }

    def power_on(self, now_s: float) -> None:
        self._heartbeat_due_s = now_s
        super().power_on(now_s)
        self._lifts_off_at_s = math.inf
        self._intervals_s = dict(_UNASKED_S)
        self._due_s = dict.fromkeys(_UNASKED_S, now_s)

    # What it says.

    def text(self, severity: int, text: str) -> None:
        chunks = range(0, len(text) + 1, _CHUNK_CHARS)
        for seq, begin in enumerate(chunks):
            chunk = f"{text}\t"[begin : begin + _CHUNK_CHARS].encode()
            self.say(mavlink.MAVLink_statustext_message(severity, chunk, self._texts, seq))
        self._texts += 1

    def heartbeat(self) -> None:
        booted = self.now_s - self.on_at_s >= self.boot_s
        status = 0 if not booted else 4 if self.armed else 3
        status = status if self.system_status is None else self.system_status
        base_mode = 29 | (128 if self.armed else 0)
        self.say(
            mavlink.MAVLink_heartbeat_message(
                self.mav_type, self.autopilot, base_mode, self.mode, status, 3
            )
        )

    def position(self, boot_ms: int | None = None) -> None:
        if self.now_s - self.on_at_s >= self.ready_s / 2:
            super().position(boot_ms)

    def _stream(self, message_id: int) -> None:
        if message_id == 230:
            flags = self.ekf_flags if self.ready else 167
            if not self.airborne:
                flags |= _CONST_POS_MODE
            self.say(mavlink.MAVLink_estimator_status_message(0, flags, *[0.0] * 8))
            return
        if message_id != 1:
            super()._stream(message_id)
            return
        healthy = _PREARM if self.ready and self.prearm_ok else 0
        sensors = (0x300402F, 0x301402F, 0x320C83F | healthy)
        fields = (*sensors, 160, 16200, -100, self.battery_percent, 0, 0, 0, 0, 0, 0)
        self.say(mavlink.MAVLink_sys_status_message(*fields))

    def _say_parameter(self, name: str) -> None:
        value, kind = self.parameters[name], _REAL32
        if not name.startswith("MPC_"):
            kind = _INT32
            (value,) = struct.unpack("<f", struct.pack("<i", round(value)))
        self.say(mavlink.MAVLink_param_value_message(name.encode(), value, kind, 1, 65535))

    # What it hears.

    def ack(self, command: int, result: int, target: tuple[int, int] = (255, 191)) -> None:
        for _ in range(2 if command == SET_MODE else 1):
            super().ack(command, result, target)

    def _do(self, m: Any) -> int:
        match m.command:
            case 511 if int(m.param1) in (193, 42):
                return FAILED
            case 176:
                assert m.param1 == 1.0
                self._obey_mode(int(m.param2) << 16 | int(m.param3) << 24)
                return ACCEPTED  # whatever becomes of it
            case 22:
                return self._take_off(m)
            case 400 if m.param1 == 0.0 and self.airborne:
                return DENIED
            case _:
                return super()._do(m)

    def _arm(self) -> int:
        if not self.ready or not self.prearm_ok:
            self.text(2, "Arming denied: resolve system health failures first")
            return DENIED
        self.armed, self.armed_at_s = True, self.now_s
        self.home_m = self.position_m
        self.text(6, "Armed by external command")
        self._tell_change()
        return ACCEPTED

    def _take_off(self, m: Any) -> int:
        assert all(math.isnan(p) for p in (m.param4, m.param5, m.param6)), "where it stands"
        if not self.armed:
            return DENIED
        self.set_mode(AUTO_TAKEOFF)
        self.target_m = (*self.position_m[:2], m.param7 - self.origin.alt_m)
        if self.airborne:
            self.in_takeoff = True
        else:
            self._lifts_off_at_s = self.now_s + _SPOOL_UP_S
        return ACCEPTED

    def _reposition(self, m: Any) -> int:
        if not int(m.param2) & 1:
            return UNSUPPORTED
        nowhere = m.get_type() == "COMMAND_LONG"
        if nowhere:
            assert all(math.isnan(p) for p in (m.param4, m.param5, m.param6, m.param7)), "a pause"
        else:
            assert m.frame in (0, 5), "above mean sea level"
        if self.mode != AUTO_LOITER:
            self.speed_m_s = self.default_speed_m_s
            self.set_mode(AUTO_LOITER)
        if m.param1 > 0.0:
            self.speed_m_s = m.param1
        target_m = (
            self.position_m if nowhere else enu_from_wgs84(self.origin, m.x / 1e7, m.y / 1e7, m.z)
        )
        if math.hypot(*target_m[:2]) > self.fence_radius_m:
            self.late_texts.append((2, "Reposition is outside geofence"))
        elif not self.stuck:
            self.target_m = target_m
        return ACCEPTED  # by another part of it than the one that minds its fence

    def set_mode(self, mode: int) -> None:
        """By command, by the pilot's switch, by a failsafe or by itself.

        Told the mode it is in, it goes on with what it does there.
        """
        if mode != self.mode:
            self.in_takeoff = False
            self._lifts_off_at_s = math.inf
            super().set_mode(mode)

    def _tell_change(self) -> None:
        self._heartbeat_due_s = min(self._heartbeat_due_s, self.now_s + _CHANGE_TOLD_S)

    # What it does.

    def advance(self, now_s: float) -> list[bytes]:
        if self.armed and now_s >= self._lifts_off_at_s:
            self._lifts_off_at_s = math.inf
            self.airborne = self.in_takeoff = True
            self.text(6, "Takeoff detected")
        while self.late_texts:
            self.text(*self.late_texts.pop(0))
        armed = self.armed
        said = super().advance(now_s)
        if armed and not self.armed:
            self.set_mode(AUTO_LOITER)
        return said

    def _move(self, duration_s: float) -> None:
        super()._move(duration_s)
        if self.in_takeoff and self.position_m == self.target_m:
            self.set_mode(AUTO_LOITER)

    def _land(self) -> None:
        super()._land()
        self.text(6, "Disarmed by landing")
