"""A small scripted ArduCopter for tests of the bridge, in virtual time.

Written from the recordings and from nothing of the simulated autopilot, so that the two
cannot share a mistake. Its knobs make it refuse, forget and misbehave. What a PX4 does
otherwise is in tests.support.fake_px4; link, motion and knobs are the same.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20 import development as later_dialect

from swarm.model.frames import Origin, enu_from_wgs84, wgs84_from_enu
from tests.support.fake_fences import FENCE, FakeFence
from tests.support.fake_missions import CopterMissions

Point = tuple[float, float, float]

STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND = 0, 3, 4, 5, 6, 9
ACCEPTED, BUSY, DENIED, UNSUPPORTED, FAILED = 0, 1, 2, 3, 4
SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED, INTERVAL = 176, 400, 22, 192, 178, 511
ASK = 512
SWITCH_FENCE = 207

_CLIMB_M_S = 2.5
_AUTO_DISARM_S = 10.0
_RTL_ALT_M = 15.0
_GEOFENCE = 1 << 20


class FakeCopter:
    """One vehicle; `receive` and `advance` give back the bytes it says."""

    mav_type, autopilot = 2, 3
    boot_mode, own_mode, pilot_mode = STABILIZE, GUIDED, LOITER
    """What it boots into, what takes targets, and what a pilot flies in."""
    return_mode, land_mode, mission_mode = RTL, LAND, AUTO
    tells_all_modes = False
    missions: type[CopterMissions] = CopterMissions
    mode_names: ClassVar = {GUIDED: "GUIDED", LOITER: "LOITER", RTL: "RTL", LAND: "LAND"}
    takeoff_mode = GUIDED
    """The mode it takes off in."""
    streams_asked = frozenset({33, 1, 193, 245, 42, 147})
    """Message ids that have to be asked for."""
    speed_names: tuple[str, ...] = ("WP_SPD", "WPNAV_SPEED")
    """Names that the parameter of the cruise speed may have."""
    failsafe_names = frozenset(
        {
            "FS_GCS_ENABLE",
            "FS_GCS_TIMEOUT",
            "MAV_GCS_SYSID",
            "SYSID_MYGCS",
            "MAV_GCS_SYSID_HI",
            "BATT_FS_LOW_ACT",
            "SWARM_SIMULATED",
        }
    )
    """What may be read of it besides."""
    limit_names = frozenset(
        {
            *("WP_ACC", "WPNAV_ACCEL", "ATC_ANGLE_MAX", "ANGLE_MAX"),
            *("PSC_JERK_NE", "PSC_NE_JERK", "PSC_JERK_XY"),
        }
    )
    """What may be read of it to know how it flies its legs."""
    fence_names = frozenset({"FENCE_ENABLE", "FENCE_TYPE", "FENCE_ACTION", "FENCE_AUTOENABLE"})
    """What is read of its fence."""
    fence_as_int = False
    """Whether it asks for the corners of a fence by the newer message."""
    jerk_names: tuple[str, ...] = ("WP_JERK", "WPNAV_JERK")
    """Names that the parameter of the greatest jerk may have."""

    def __init__(
        self,
        origin: Origin,
        *,
        system_id: int = 1,
        ground_m: float = 0.0,
        boot_s: float = 1.0,
        ready_s: float = 3.0,
        default_speed_m_s: float = 10.0,
    ) -> None:
        self.modes: dict[int, str] = {}
        """Its modes by number, as it tells them; none: it knows no such message."""
        self.origin = origin
        self.system_id = system_id
        self.component_id = 1
        self.boot_s = boot_s
        self.ready_s = ready_s
        self.default_speed_m_s = default_speed_m_s
        self.heard: list[Any] = []
        """Every message heard, decoded."""
        self.verdicts: dict[int, list[int | None]] = {}
        """Results to answer per command before behaving; None is silence."""
        self.deaf_to: set[int] = set()
        """Streams that are acknowledged and never sent."""
        self.silent = False
        self.fastest_m_s = math.inf
        """What its limits of tilt and thrust allow, whatever speed it acknowledges."""
        self.stays_armed = False
        """Does not disarm by itself once it has landed."""
        self.stuck = False
        """Acknowledges targets and does not move."""
        self.fence_radius_m = math.inf
        """Of its own fence, beyond which it flies to no target."""
        self.prearm_ok = True
        self.battery_percent = 80
        self.ekf_flags = 831
        self.system_status: int | None = None
        """MAV_STATE to say instead of the true one."""
        self.parameters: dict[str, float] = {
            "WP_SPD": default_speed_m_s,
            "WP_JERK": 1.0,
            "WP_ACC": 2.5,
            "PSC_JERK_NE": 5.0,
            "ATC_ANGLE_MAX": 30.0,
            "FS_GCS_ENABLE": 1.0,
            "FS_GCS_TIMEOUT": 5.0,
            "MAV_GCS_SYSID": 255.0,
            "MAV_GCS_SYSID_HI": 0.0,
            "BATT_FS_LOW_ACT": 2.0,
            "FENCE_ENABLE": 0.0,
            "FENCE_TYPE": 7.0,
            "FENCE_ACTION": 1.0,
            "FENCE_AUTOENABLE": 0.0,
        }
        self.ground_m = ground_m
        self.home_m: Point = (0.0, 0.0, ground_m)
        self.position_m: Point = self.home_m
        self.mission = self.missions(self)
        self.fence = FakeFence(self, as_int=self.fence_as_int)
        self._buffer: list[bytes] = []
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
        self._handlers: dict[str, Callable[[Any], None]] = {
            "COMMAND_LONG": self._on_command,
            "COMMAND_INT": self._on_command,
            "PARAM_REQUEST_READ": self._on_param_read,
            "PARAM_SET": self._on_param_set,
            "MISSION_COUNT": self.mission.on_count,
            "MISSION_ITEM_INT": self.mission.on_item,
            "MISSION_REQUEST_LIST": self.mission.on_request_list,
            "MISSION_REQUEST_INT": self.mission.on_request,
            "MISSION_CLEAR_ALL": self.mission.on_clear_all,
            "MISSION_SET_CURRENT": self.mission.on_set_current,
            "MISSION_ACK": self.mission.on_ack,
        }
        self.now_s = 0.0
        self.power_on(0.0)

    def power_on(self, now_s: float) -> None:
        """Begin anew, where the vehicle is."""
        self.on_at_s = now_s
        self.mode = self.boot_mode
        self.fence.is_on = False
        self.armed = False
        self.armed_at_s = 0.0
        self.airborne = self.position_m[2] > self.ground_m + 0.1
        self.target_m: Point | None = None
        self.lands = False
        """Comes down where it is, as it was told."""
        self.velocity_m_s: Point = (0.0, 0.0, 0.0)
        self.speed_m_s = self.default_speed_m_s
        self.in_takeoff = False
        self._intervals_s: dict[int, float] = {}
        self._due_s: dict[int, float] = {}
        self._heartbeat_due_s = now_s

    # What it says.

    def say(self, message: Any) -> None:
        """Say any message at all."""
        self._sender.srcSystem = self.system_id
        self._sender.srcComponent = self.component_id
        self._buffer.append(bytes(message.pack(self._sender)))
        self._sender.seq = (self._sender.seq + 1) % 256

    def _tell_modes(self, asked: int) -> None:
        """The one asked for; of all, as many as this firmware tells."""
        last = (len(self.modes) if self.tells_all_modes else 1) if asked == 0 else asked
        named = list(enumerate(self.modes.items(), 1))
        for index, (mode, name) in named[max(0, asked - 1) : last]:
            fields = (len(named), index, 0, mode, 0, name.encode())
            self.say(later_dialect.MAVLink_available_modes_message(*fields))

    def text(self, severity: int, text: str) -> None:
        self.say(mavlink.MAVLink_statustext_message(severity, text.encode()))

    def heartbeat(self) -> None:
        booted = self.now_s - self.on_at_s >= self.boot_s
        status = 1 if not booted else 4 if self.airborne else 3
        status = status if self.system_status is None else self.system_status
        base_mode = 81 | (128 if self.armed else 0)
        self.say(
            mavlink.MAVLink_heartbeat_message(
                self.mav_type, self.autopilot, base_mode, self.mode, status, 3
            )
        )

    def position(self, boot_ms: int | None = None) -> None:
        if boot_ms is None:
            boot_ms = round((self.now_s - self.on_at_s) * 1e3)
        if self.now_s - self.on_at_s < self.ready_s / 2:
            self.say(mavlink.MAVLink_global_position_int_message(boot_ms, *[0] * 8))
            return
        lat_deg, lon_deg, alt_m = wgs84_from_enu(self.origin, self.position_m)
        east, north, up = self.velocity_m_s
        self.say(
            mavlink.MAVLink_global_position_int_message(
                boot_ms,
                round(lat_deg * 1e7),
                round(lon_deg * 1e7),
                round(alt_m * 1e3),
                round((self.position_m[2] - self.home_m[2]) * 1e3),
                round(north * 100),
                round(east * 100),
                round(-up * 100),
                0,
            )
        )

    @property
    def ready(self) -> bool:
        return self.now_s - self.on_at_s >= self.ready_s

    def _stream(self, message_id: int) -> None:
        bit = 268435456
        match message_id:
            case 33:
                self.position()
            case 1:
                health = bit if self.ready and self.prearm_ok else 0
                enabled = bit | (_GEOFENCE if self.fence_radius_m < math.inf else 0)
                fields = (bit, enabled, health, 0, 12600, 0, self.battery_percent, 0, 0, 0, 0, 0, 0)
                self.say(mavlink.MAVLink_sys_status_message(*fields))
            case 193:
                flags = self.ekf_flags if self.ready else 167
                self.say(mavlink.MAVLink_ekf_status_report_message(flags, 0, 0, 0, 0, 0))
            case 245:
                landed = 1 if not self.airborne else 3 if self.in_takeoff else 2
                self.say(mavlink.MAVLink_extended_sys_state_message(3, landed))
            case 42:
                self.mission.say_current()
            case _:
                pass

    # What it hears.

    def receive(self, data: bytes, now_s: float) -> list[bytes]:
        self.now_s = now_s
        for message in self._parser.parse_buffer(data) or ():
            self.heard.append(message)
            if getattr(message, "target_system", self.system_id) != self.system_id:
                continue
            fence = getattr(message, "mission_type", 0) == FENCE
            handler = self.fence.on if fence else self._handlers.get(message.get_type())
            if handler is not None and not self.silent:
                handler(message)
        return self._flush()

    def commands(self, command: int) -> list[Any]:
        """Commands heard of that number."""
        return [m for m in self.heard if getattr(m, "command", None) == command]

    def _on_command(self, message: Any) -> None:
        scripted = self.verdicts.get(message.command)
        if scripted:
            verdict = scripted.pop(0)
            if verdict is not None:
                self.ack(message.command, verdict)
            return
        self.ack(message.command, self._do(message))

    def ack(self, command: int, result: int, target: tuple[int, int] = (255, 191)) -> None:
        self.say(mavlink.MAVLink_command_ack_message(command, result, 0, 0, *target))

    def _do(self, m: Any) -> int:
        match m.command:
            case 511:
                self._intervals_s[int(m.param1)] = m.param2 / 1e6
                self._due_s[int(m.param1)] = self.now_s
            case 176:
                return self._obey_mode(int(m.param2))
            case 400 if m.param1 == 1.0:
                return self._arm()
            case 400 if self.airborne:
                return FAILED
            case 400:
                self.armed = False
            case 22:
                if not (self.armed and self.mode == GUIDED and not self.airborne):
                    return FAILED
                self.airborne = self.in_takeoff = True
                self.target_m = (*self.position_m[:2], self.home_m[2] + m.param7)
            case 178:
                self.speed_m_s = m.param2
            case 192:
                return self._reposition(m)
            case 512 if self.modes and m.param1 == 435.0:
                self._tell_modes(int(m.param2))
            case 207:
                return ACCEPTED if self.fence.switch(m) else FAILED
            case _:
                return UNSUPPORTED
        return ACCEPTED

    def _arm(self) -> int:
        if not self.ready or not self.prearm_ok or self.mode != GUIDED:
            self.text(2, "Arm: Need Position Estimate")
            return FAILED
        self.armed, self.armed_at_s = True, self.now_s
        self.home_m = self.position_m
        return ACCEPTED

    def _reposition(self, m: Any) -> int:
        if self.mode != GUIDED and not self.mission.gives_way and not int(m.param2) & 1:
            return DENIED
        assert m.frame in (0, 5), "above mean sea level"
        target_m = enu_from_wgs84(self.origin, m.x / 1e7, m.y / 1e7, m.z)
        if math.hypot(*target_m[:2]) > self.fence_radius_m:
            return FAILED  # without a word
        if self.mission.gives_way:
            self.mission.take_target(target_m)
        if self.in_takeoff:
            self.in_takeoff = False
            self.speed_m_s = self.default_speed_m_s
        if not self.stuck:
            self.target_m = target_m
        return ACCEPTED

    def _obey_mode(self, mode: int) -> int:
        if mode == self.mode:
            return ACCEPTED
        if mode == self.mission_mode and (why := self.mission.refusal()):
            self.text(2, why)
            return FAILED
        self.set_mode(mode)
        if mode == self.land_mode:
            self.lands = True
            self.target_m = (*self.position_m[:2], self.ground_m) if self.airborne else None
            self.armed &= self.airborne
        return ACCEPTED

    def set_mode(self, mode: int) -> None:
        """By command, by the pilot's switch or by a failsafe."""
        self.mode = mode
        self.target_m = None
        self.lands = False
        self.in_takeoff = False
        self.mission.leave()
        if mode == self.return_mode:
            self.begin_return()
        elif mode == self.mission_mode:
            self.mission.enter()
        self._tell_change()

    def begin_return(self) -> None:
        """Climb, before it flies home."""
        east, north, _ = self.position_m
        self.target_m = (east, north, max(self.position_m[2], self.home_m[2] + _RTL_ALT_M))

    def _tell_change(self) -> None:
        self.heartbeat()

    def _on_param_read(self, message: Any) -> None:
        if message.param_id in self.parameters:
            self._say_parameter(message.param_id)

    def _on_param_set(self, message: Any) -> None:
        if message.param_id in self.parameters:
            self.parameters[message.param_id] = message.param_value
            self._say_parameter(message.param_id)

    def _say_parameter(self, name: str) -> None:
        value = self.parameters[name]
        self.say(mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 65535))

    # What it does.

    def advance(self, now_s: float) -> list[bytes]:
        duration_s, self.now_s = now_s - self.now_s, now_s
        self._move(duration_s)
        self.mission.advance()
        self.fence.advance()
        if self.armed and not self.airborne and now_s - self.armed_at_s > _AUTO_DISARM_S:
            self.armed = False
        if now_s >= self._heartbeat_due_s:
            self._heartbeat_due_s = now_s + 1.0
            self.heartbeat()
        for message_id, interval_s in self._intervals_s.items():
            if now_s >= self._due_s[message_id]:
                self._due_s[message_id] = now_s + interval_s
                if message_id not in self.deaf_to:
                    self._stream(message_id)
        return self._flush()

    def _move(self, duration_s: float) -> None:
        if not self.airborne or self.target_m is None or duration_s <= 0.0:
            self.velocity_m_s = (0.0, 0.0, 0.0)
            return
        away_m = math.dist(self.position_m, self.target_m)
        speed_m_s = _CLIMB_M_S if self.in_takeoff else min(self.speed_m_s, self.fastest_m_s)
        share = min(1.0, speed_m_s * duration_s / away_m) if away_m > 0.0 else 1.0
        before = self.position_m
        east, north, up = (a + share * (b - a) for a, b in zip(before, self.target_m, strict=True))
        self.position_m = (east, north, up)
        moved = [(b - a) / duration_s for a, b in zip(before, self.position_m, strict=True)]
        still = share >= 1.0
        self.velocity_m_s = (0.0, 0.0, 0.0) if still else (moved[0], moved[1], moved[2])
        if still and (self.mode == self.return_mode or self.mission.going_home):
            self._next_of_return()
        elif still and self.lands:
            self._land()

    def _next_of_return(self) -> None:
        east, north, _ = self.home_m
        if self.position_m == self.home_m:
            self._land()
        elif math.dist(self.position_m[:2], (east, north)) < 1e-6:
            self.target_m = self.home_m
        else:
            self.target_m = (east, north, self.position_m[2])

    def _land(self) -> None:
        self.mission.going_home = False
        self.airborne = self.lands = False
        self.armed = self.stays_armed
        self.target_m = None

    def _flush(self) -> list[bytes]:
        said, self._buffer = self._buffer, []
        return [] if self.silent else said

    def count(self) -> Counter[int]:
        """How often each command number was heard, but for questions, which command nothing."""
        return Counter(m.command for m in self.heard if getattr(m, "command", ASK) != ASK)
