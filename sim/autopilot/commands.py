"""Carries out MAV_CMD commands and answers each with a MAV_RESULT.

A COMMAND_LONG is read as the COMMAND_INT it stands for. Which result a refusal gets differs
between firmwares. Source: https://mavlink.io/en/services/command.html.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.available_modes import AVAILABLE_MODES_ID, available_modes
from sim.autopilot.events import FirmwareEvent, Sender
from sim.autopilot.flight import FlightMode
from sim.autopilot.message_rates import MessageRates
from sim.autopilot.pilot import Pilot
from sim.autopilot.positions import ABOVE_HOME_FRAMES, place_enu_m
from sim.autopilot.telemetry import TelemetryReporter
from sim.world.motion import Point

_FORCE_ARM = 21196.0
_FORCE_REBOOT = 20190226.0
_POLYGONS = 4.0
"""Of DO_FENCE_ENABLE: fences of that kind."""

_ACCEPTED = int(mavlink.MAV_RESULT_ACCEPTED)
_DENIED = int(mavlink.MAV_RESULT_DENIED)
_FAILED = int(mavlink.MAV_RESULT_FAILED)
_UNSUPPORTED = int(mavlink.MAV_RESULT_UNSUPPORTED)

_LONG_ABOVE_HOME = frozenset({mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_DO_SET_ROI_LOCATION})
"""Commands whose height is above home when they come as COMMAND_LONG."""


@dataclass(frozen=True, slots=True)
class AutopilotCommand:
    """A command with its place in integer form."""

    id: int
    params: tuple[float, float, float, float]
    frame: int
    lat_e7: int | None
    """None where the place is not a number."""
    lon_e7: int | None
    height_m: float
    raw: tuple[float, float, float]
    """Parameters 5 to 7 as they came, for commands in which they are no place."""


def command_from_message(message: mavlink.MAVLink_message) -> AutopilotCommand:
    """The command in a COMMAND_LONG or COMMAND_INT."""
    params = (message.param1, message.param2, message.param3, message.param4)
    if message.get_msgId() == mavlink.MAVLINK_MSG_ID_COMMAND_INT:
        raw = (float(message.x), float(message.y), message.z)
        return AutopilotCommand(
            message.command, params, message.frame, message.x, message.y, message.z, raw
        )
    raw = (message.param5, message.param6, message.param7)
    frame = (
        mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        if message.command in _LONG_ABOVE_HOME
        else mavlink.MAV_FRAME_GLOBAL
    )
    return AutopilotCommand(message.command, params, frame, _e7(raw[0]), _e7(raw[1]), raw[2], raw)


def _is_nowhere(command: AutopilotCommand) -> bool:
    """Whether it names neither place nor height nor heading."""
    return all(math.isnan(value) for value in (command.params[3], *command.raw))


def _e7(degrees: float) -> int | None:
    return round(degrees * 1e7) if math.isfinite(degrees) else None


class CommandExecutor:
    """The commands one vehicle knows."""

    def __init__(self, pilot: Pilot, telemetry: TelemetryReporter, streams: MessageRates) -> None:
        self._pilot = pilot
        self._telemetry = telemetry
        self._streams = streams
        self._outbox = pilot.outbox
        self.reboot_asked = False
        """Set by a reboot command, for the vehicle to carry out after the answer."""

    def handle(self, command: AutopilotCommand, sender: Sender, now_s: float) -> None:
        """Carry ``command`` out and acknowledge it."""
        is_camera = command.id == mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST
        if is_camera and self._pilot.flavour.missions.tells_camera:
            self._pilot.camera.trigger(command.params[0])
            return
        is_mode = command.id == mavlink.MAV_CMD_DO_SET_MODE
        times = self._pilot.flavour.modes.acknowledgements if is_mode else 1
        self._answer(command.id, lambda: self._carry_out(command, sender, now_s), sender, times)

    def _carry_out(self, command: AutopilotCommand, sender: Sender, now_s: float) -> int:
        """The MAV_RESULT of doing it."""
        pilot = self._pilot
        match command.id:
            case mavlink.MAV_CMD_DO_SET_MODE:
                return self._set_mode(command, now_s)
            case mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                return self._arm_disarm(command, now_s)
            case mavlink.MAV_CMD_NAV_TAKEOFF:
                return self._take_off(command, now_s)
            case mavlink.MAV_CMD_NAV_LAND:
                pilot.narrator.tell(FirmwareEvent.LANDING_ORDERED)
                return self._result(pilot.set_mode(FlightMode.LAND, now_s))
            case mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH:
                pilot.narrator.tell(FirmwareEvent.RETURN_ORDERED)
                return self._result(pilot.set_mode(FlightMode.RTL, now_s))
            case mavlink.MAV_CMD_DO_REPOSITION:
                return self._reposition(command, now_s)
            case mavlink.MAV_CMD_DO_CHANGE_SPEED:
                return self._change_speed(command, now_s)
            case mavlink.MAV_CMD_MISSION_START:
                if command.params[0] != 0.0 or command.params[1] != 0.0:
                    return _DENIED  # flying a part of the mission is not supported
                return self._result(pilot.start_mission(now_s))
            case mavlink.MAV_CMD_DO_SET_MISSION_CURRENT:
                seq = command.params[0]
                if not math.isfinite(seq) or seq < 0.0:
                    return _DENIED
                return _ACCEPTED if self.set_mission_current(int(seq), sender, now_s) else _FAILED
            case mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST:
                return _ACCEPTED if self._pilot.camera.trigger(command.params[0]) else _FAILED
            case mavlink.MAV_CMD_DO_SET_ROI_LOCATION:
                return self._look_at(command)
            case mavlink.MAV_CMD_DO_SET_ROI_NONE:
                pilot.camera.look_at(None)
                return _ACCEPTED
            case mavlink.MAV_CMD_DO_SET_HOME:
                return self._set_home(command, now_s)
            case mavlink.MAV_CMD_GET_HOME_POSITION:
                return self._send(mavlink.MAVLINK_MSG_ID_HOME_POSITION, sender, now_s)
            case mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
                return self._set_message_interval(command, sender, now_s)
            case mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
                return self._get_message_interval(command, sender)
            case mavlink.MAV_CMD_REQUEST_MESSAGE:
                return self._send_asked(command, sender, now_s)
            case mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
                return self._send(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, sender, now_s)
            case mavlink.MAV_CMD_DO_FENCE_ENABLE if pilot.flavour.fence_behaviour.switchable:
                return self._switch_fence(command, now_s)
            case mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
                return self._reboot(command)
            case _:
                return _UNSUPPORTED

    def handle_set_mode(self, base_mode: int, mode: int, sender: Sender, now_s: float) -> None:
        """Obey the older message SET_MODE; acknowledged like a command."""
        custom = base_mode & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        self._answer(
            self._pilot.flavour.modes.set_mode_acknowledged_as,
            lambda: self._set_custom_mode(mode, now_s) if custom else _DENIED,
            sender,
        )

    def _answer(self, command_id: int, act: Callable[[], int], to: Sender, times: int = 1) -> None:
        """Act, but let the acknowledgement go ahead of whatever that makes the vehicle say."""
        said_before = self._outbox.take()
        result = act()
        said_meanwhile = self._outbox.take()
        self._outbox.put(said_before)
        ack = mavlink.MAVLink_command_ack_message(command_id, result, 0, 0, to.system, to.component)
        for _ in range(times):
            self._outbox.reply(to, ack)
        self._outbox.put(said_meanwhile)

    def _set_custom_mode(self, custom_mode: int | None, now_s: float) -> int:
        """Change to a mode by its number; the MAV_RESULT."""
        mode = None if custom_mode is None else self._pilot.flavour.mode_of(custom_mode)
        if mode is None:
            self._pilot.narrator.tell(FirmwareEvent.NO_SUCH_MODE, number=custom_mode)
            return self._pilot.flavour.refusals.no_such_mode
        return self._result(self._pilot.set_mode(mode, now_s))

    def _result(self, done: bool) -> int:
        """MAV_RESULT of something the vehicle may be unable to do now."""
        return _ACCEPTED if done else self._pilot.flavour.refusals.not_now

    def _set_mode(self, command: AutopilotCommand, now_s: float) -> int:
        flags = command.params[0]
        if not math.isfinite(flags) or not int(flags) & mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED:
            return _DENIED
        custom_mode = self._pilot.flavour.mode_commanded(command.params[1], command.params[2])
        return self._set_custom_mode(custom_mode, now_s)

    def _switch_fence(self, command: AutopilotCommand, now_s: float) -> int:
        """Polygons alone, or all kinds of fences; of others it is not told apart."""
        on, kinds = command.params[:2]
        if on not in (0.0, 1.0) or kinds not in (0.0, _POLYGONS):
            return _FAILED
        return _ACCEPTED if self._pilot.fence.switch(now_s, on=bool(on)) else _FAILED

    def _arm_disarm(self, command: AutopilotCommand, now_s: float) -> int:
        forced = command.params[1] == _FORCE_ARM
        if command.params[0] == 1.0:
            return self._result(self._pilot.arm(now_s, forced=forced))
        if command.params[0] == 0.0:
            return self._result(self._pilot.disarm(now_s, forced=forced))
        return _UNSUPPORTED

    def _take_off(self, command: AutopilotCommand, now_s: float) -> int:
        pilot = self._pilot
        if pilot.flight.drives:
            return _UNSUPPORTED
        up_m: float | None = None
        if pilot.flavour.take_off_above_home:
            if not math.isfinite(command.height_m) or command.frame not in ABOVE_HOME_FRAMES:
                return _DENIED
            up_m = pilot.flight.home_enu_m[2] + command.height_m
        elif math.isfinite(command.height_m):
            up_m = command.height_m - pilot.config.origin.alt_m
        return self._result(pilot.take_off(up_m, now_s))

    def _reposition(self, command: AutopilotCommand, now_s: float) -> int:
        pilot = self._pilot
        speed_m_s, flags = command.params[:2]
        behaviour = pilot.flavour.modes
        change_mode = math.isfinite(flags) and bool(
            int(flags) & mavlink.MAV_DO_REPOSITION_FLAGS_CHANGE_MODE
        )
        needs_flag = behaviour.reposition_needs_flag or not pilot.takes_targets
        if needs_flag and not change_mode:
            return pilot.flavour.refusals.reposition_without_flag
        pause = pilot.flavour.pauses_anywhere and _is_nowhere(command)
        target_enu_m = self._place(command)
        if target_enu_m is None and not pause:
            return _DENIED
        if not pilot.takes_targets and not pilot.set_mode(behaviour.for_reposition, now_s):
            return pilot.flavour.refusals.not_now
        if target_enu_m is None and not pilot.armed:
            return _ACCEPTED
        if target_enu_m is None:  # PX4 reckons where it can stop, and does not come back
            target_enu_m = pilot.flight.stopped_enu_m(now_s)
        elif not pilot.fence.allows_target(target_enu_m):
            pilot.narrator.tell(FirmwareEvent.TARGET_OUTSIDE_FENCE)
            return pilot.flavour.refusals.outside_fence
        own_speed = pilot.flavour.obeys_leg_speed and 0.0 < speed_m_s < math.inf
        pilot.fly_guided(target_enu_m, now_s, speed_m_s if own_speed else None)
        yaw_rad = command.params[3]
        own_heading = pilot.flavour.looks_in_missions_alone and math.isfinite(yaw_rad)
        pilot.camera.on_target(math.degrees(yaw_rad) if own_heading else None)
        return _ACCEPTED

    def _look_at(self, command: AutopilotCommand) -> int:
        """Keep the camera on a place; on nothing any more if that is zero in all."""
        place_enu_m = self._place(command)
        if place_enu_m is None:
            return self._pilot.flavour.refusals.no_such_place
        nowhere = command.lat_e7 == command.lon_e7 == 0 and command.height_m == 0.0
        self._pilot.camera.look_at(None if nowhere else place_enu_m)
        return _ACCEPTED

    def _place(self, command: AutopilotCommand) -> Point | None:
        if command.lat_e7 is None or command.lon_e7 is None:
            return None
        frame = command.frame if self._pilot.flavour.reads_frames else mavlink.MAV_FRAME_GLOBAL
        return place_enu_m(
            self._pilot.config.origin,
            frame,
            command.lat_e7,
            command.lon_e7,
            command.height_m,
            self._pilot.flight.home_enu_m[2],
        )

    def _change_speed(self, command: AutopilotCommand, now_s: float) -> int:
        kind, speed_m_s = command.params[:2]
        if kind not in (mavlink.SPEED_TYPE_AIRSPEED, mavlink.SPEED_TYPE_GROUNDSPEED):
            return _FAILED
        if not 0.0 < speed_m_s < math.inf:
            return _FAILED
        return self._result(self._pilot.change_speed(speed_m_s, now_s))

    def set_mission_current(self, seq: int, sender: Sender, now_s: float) -> bool:
        """Go to a mission item and say which one is current; False if there is no such item."""
        if not self._pilot.run.set_current(seq, now_s):
            return False
        self._send(mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, sender, now_s)
        return True

    def _set_home(self, command: AutopilotCommand, now_s: float) -> int:
        if command.params[0] == 1.0:
            home_enu_m: Point | None = self._pilot.position_enu_m(now_s)
        elif command.lat_e7 == 0 and command.lon_e7 == 0:
            home_enu_m = None
        else:
            home_enu_m = self._place(command)
        if home_enu_m is None:
            return _DENIED
        if not self._pilot.readiness.has_origin:
            return _FAILED
        self._pilot.set_home(home_enu_m, now_s, lock=True)
        return _ACCEPTED

    def _send(self, message_id: int, sender: Sender, now_s: float) -> int:
        message = self._telemetry.build(message_id, now_s)
        if message is None:
            return self._pilot.flavour.refusals.no_such_message
        self._outbox.reply(sender, message)
        return _ACCEPTED

    def _send_asked(self, command: AutopilotCommand, sender: Sender, now_s: float) -> int:
        message_id, which = command.params[:2]
        if message_id == AVAILABLE_MODES_ID:
            for message in available_modes(self._pilot.flavour, which):
                self._outbox.reply(sender, message)
            return _ACCEPTED
        return self._send(int(message_id), sender, now_s) if math.isfinite(message_id) else _DENIED

    def _set_message_interval(self, command: AutopilotCommand, sender: Sender, now_s: float) -> int:
        message_id, interval_us = command.params[:2]
        changeable = self._telemetry.known - self._pilot.flavour.fixed_streams
        if not math.isfinite(message_id) or int(message_id) not in changeable:
            return self._pilot.flavour.refusals.no_such_stream
        if not math.isfinite(interval_us):
            return _DENIED
        interval_s: float | None = interval_us / 1e6
        if interval_us == 0.0:  # back to the firmware's own rate
            interval_s = self._pilot.flavour.unasked_streams.get(int(message_id))
        elif interval_us < 0.0:
            interval_s = None
        self._streams.set_interval(sender.channel, int(message_id), interval_s, now_s)
        return _ACCEPTED

    def _get_message_interval(self, command: AutopilotCommand, sender: Sender) -> int:
        message_id = command.params[0]
        if not math.isfinite(message_id) or not 0 <= int(message_id) <= 0xFFFF:
            return _DENIED
        if int(message_id) not in self._telemetry.known:
            interval_us = 0  # not available
        else:
            interval_s = self._streams.interval_s(sender.channel, int(message_id))
            interval_us = -1 if interval_s is None else min(2**31 - 1, round(interval_s * 1e6))
        self._outbox.reply(
            sender, mavlink.MAVLink_message_interval_message(int(message_id), interval_us)
        )
        return _ACCEPTED

    def _reboot(self, command: AutopilotCommand) -> int:
        if command.params[0] not in (1.0, 3.0):
            return _UNSUPPORTED
        if self._pilot.armed and command.raw[1] != _FORCE_REBOOT:
            return self._pilot.flavour.refusals.not_now
        self.reboot_asked = True
        return _ACCEPTED
