"""One simulated vehicle: MAVLink messages in, MAVLink messages out, no I/O.

`SimulatedAutopilot.step` takes an event and the time and returns what is to be sent, in
order; `SimulatedAutopilot.next_deadline_s` says when to call again with `TimeAdvanced`. Velocity
and attitude targets and RC override are not understood.
"""

from __future__ import annotations

import dataclasses
import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.battery import BatteryModel
from sim.autopilot.battery_change import BatteryChange
from sim.autopilot.commands import CommandExecutor, command_from_message
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import (
    Connected,
    Disconnected,
    MavlinkReceived,
    Outbox,
    OutgoingMessage,
    Reboot,
    Sender,
    TimeAdvanced,
    VehicleEvent,
)
from sim.autopilot.fence import FenceStore
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.flight import FlightMode
from sim.autopilot.message_rates import MessageRates
from sim.autopilot.mission_store import MissionServer, MissionStore
from sim.autopilot.parameters import ParameterEntry, ParameterTable
from sim.autopilot.pilot import Pilot
from sim.autopilot.positions import place_enu_m
from sim.autopilot.telemetry import DATA_STREAMS, TelemetryReporter

COMPONENT_ID = 1
_HEARTBEAT_S = 1.0
_SIMULATED = ParameterEntry("SWARM_SIMULATED", 1.0, mavlink.MAV_PARAM_TYPE_REAL32, read_only=True)
"""By which an agent knows that nothing falls from the sky if this vehicle does: it flies it
whatever its failsafes are. No firmware has such a parameter."""
_POSITION_IGNORED = 0b111
"""Bits of a position target's type mask that say that no position is meant."""
_NANO = 1e9

_MISSION_PROTOCOL = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_MISSION_COUNT,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM,
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_LIST,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST,
        mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT,
        mavlink.MAVLINK_MSG_ID_MISSION_CLEAR_ALL,
        mavlink.MAVLINK_MSG_ID_MISSION_ACK,
    }
)


class SimulatedAutopilot:
    """The machine of one vehicle, powered up at ``start_s``."""

    def __init__(self, config: VehicleConfig, flavour: FirmwareModel, start_s: float) -> None:
        self.config = config
        self.foreign = 0
        """Messages dropped because they were for somebody else."""
        self.unknown = 0
        """Messages dropped because this vehicle doesn't know them."""
        self._flavour = flavour
        self._outbox = Outbox(numbers_texts=flavour.numbers_texts)
        self._streams = MessageRates()
        self._parameters = ParameterTable((*flavour.parameters(config), _SIMULATED))
        self._store = MissionStore()
        self._fence_store = FenceStore(config.origin)
        self._battery = BatteryModel(
            config.endurance_s, config.battery_failsafe, config.charge_frac
        )
        self._change = BatteryChange(config)
        self._power_returns_s: float | None = None
        """When somebody has put the other battery in [s]; None: it has power."""
        self._now_s = start_s
        self._power_up(config, start_s)

    def _power_up(self, config: VehicleConfig, now_s: float) -> None:
        self.pilot = Pilot(
            config,
            self._flavour,
            self._parameters,
            self._store,
            self._fence_store,
            self._outbox,
            self._battery,
            now_s,
            mode_changed=self._on_mode_changed,
        )
        """The autopilot inside."""
        self._telemetry = TelemetryReporter(self.pilot)
        self._commands = CommandExecutor(self.pilot, self._telemetry, self._streams)
        self._transfer = MissionServer(self.pilot)
        self._heartbeat_s = now_s

    def step(self, event: VehicleEvent, now_s: float) -> list[OutgoingMessage]:
        """Take an event; what is to be sent, in order. Time never goes back: it stands still."""
        now_s = self._now_s = max(now_s, self._now_s)
        self._advance(now_s)
        match event:
            case MavlinkReceived() | Reboot() if self._power_returns_s is not None:
                pass
            case MavlinkReceived(channel, message):
                self._receive(channel, message, now_s)
            case Connected(channel):
                self._streams.open(channel, self._flavour.unasked_streams, now_s, self._heartbeat_s)
                if (
                    self._heartbeat_s > now_s and self._power_returns_s is None
                ):  # otherwise it comes below
                    self._say(mavlink.MAVLINK_MSG_ID_HEARTBEAT, channel, now_s)
            case Disconnected(channel):
                self._streams.close(channel)
                self._transfer.forget(channel)
            case Reboot():
                self._reboot(now_s)
            case TimeAdvanced():
                pass
        if not isinstance(event, TimeAdvanced):  # which has brought about nothing more that is due
            self._advance(now_s)
        if self._power_returns_s is None:
            self._report(now_s)
        return self._outbox.take()

    @property
    def is_without_power(self) -> bool:
        """Whether somebody is changing its battery just now, so that it hears and says nothing."""
        return self._power_returns_s is not None

    def next_deadline_s(self) -> float:
        """When `step` should be called at the latest [s]."""
        if self._power_returns_s is not None:
            return self._power_returns_s
        due_s = min(self._heartbeat_s, self.pilot.deadline_s(), self._streams.deadline_s())
        return min(due_s, self._own_deadline_s())

    def _advance(self, now_s: float) -> None:
        """Let everything happen that is due, each at its own instant."""
        while (due_s := self._own_deadline_s()) <= now_s:
            if self._power_returns_s is not None:
                self._reboot(due_s)
                continue
            self.pilot.advance(due_s)
            if due_s < self._own_deadline_s():  # the motors have stopped, or run again
                continue
            transfer_s = self._transfer.deadline_s()
            if transfer_s is not None and transfer_s <= due_s:
                self._transfer.advance(due_s)
            else:
                self._change_battery()
        if self._power_returns_s is None:
            self.pilot.advance(now_s)
            if self._own_deadline_s() <= now_s:  # by what has just happened
                self._advance(now_s)

    def _own_deadline_s(self) -> float:
        """When something happens that the autopilot knows nothing of, or in a transfer [s]."""
        if self._power_returns_s is not None:
            return self._power_returns_s
        transfer_s = self._transfer.deadline_s()
        cut = self._change.due(self.pilot)
        return min(
            math.inf if transfer_s is None else transfer_s, math.inf if cut is None else cut.off_s
        )

    def _change_battery(self) -> None:
        """Give the vehicle the battery that is due; where that cuts its power, be silent."""
        cut = self._change.due(self.pilot)
        if cut is None:
            return
        self._battery.fill()
        self.pilot.stands_since_s = None
        self.pilot.failsafes.battery_changed()
        if self.config.swap_reboots:
            self._power_returns_s = cut.on_s

    def _report(self, now_s: float) -> None:
        """Send the telemetry that is due, as of now."""
        if self._heartbeat_s <= now_s:
            self._say_heartbeat(now_s)
            next_s = self._heartbeat_s + _HEARTBEAT_S
            self._heartbeat_s = next_s if next_s > now_s else now_s + _HEARTBEAT_S
        for channel, message_id in self._streams.take_due(now_s):
            self._say(message_id, channel, now_s)

    def _on_mode_changed(self, now_s: float) -> None:
        self.pilot.camera.on_target()
        if self._flavour.modes.told_at_once:
            self._say_heartbeat(now_s)

    def _say_heartbeat(self, now_s: float) -> None:
        for channel in self._streams.channels:
            self._say(mavlink.MAVLINK_MSG_ID_HEARTBEAT, channel, now_s)

    def _say(self, message_id: int, channel: int, now_s: float) -> None:
        message = self._telemetry.build(message_id, now_s)
        if message is not None:
            self._outbox.on_channel(channel, message)

    def _reboot(self, now_s: float) -> None:
        """Begin again from power-up, with parameters and mission as they stand.

        In the air the vehicle drops to the ground at once: nothing flies it.
        """
        self._power_returns_s = None
        east_m, north_m, _ = self.pilot.position_enu_m(now_s)
        ground_up_m = self.pilot.flight.ground_up_m(east_m, north_m)
        here = dataclasses.replace(self.config, start_enu_m=(east_m, north_m, ground_up_m))
        for channel in self._streams.channels:
            self._streams.close(channel)
            self._streams.open(channel, self._flavour.unasked_streams, now_s, self._heartbeat_s)
        self._outbox.take()
        self._battery.stop(now_s)
        self._power_up(here, now_s)

    def _receive(self, channel: int, message: mavlink.MAVLink_message, now_s: float) -> None:
        if getattr(message, "target_system", 0) not in (0, self.config.system_id) or getattr(
            message, "target_component", 0
        ) not in (0, COMPONENT_ID):
            self.foreign += 1
            return
        sender = Sender(channel, message.get_srcSystem(), message.get_srcComponent())
        self._obey(message, sender, now_s)
        if self._commands.reboot_asked:
            said = self._outbox.take()
            self._reboot(now_s)
            self._outbox.put(said)

    def _obey(self, message: mavlink.MAVLink_message, sender: Sender, now_s: float) -> None:
        match message.get_msgId():
            case mavlink.MAVLINK_MSG_ID_HEARTBEAT:
                if message.type == mavlink.MAV_TYPE_GCS:
                    self.pilot.failsafes.hear_ground(sender.system, now_s)
            case mavlink.MAVLINK_MSG_ID_COMMAND_LONG | mavlink.MAVLINK_MSG_ID_COMMAND_INT:
                self._commands.handle(command_from_message(message), sender, now_s)
            case mavlink.MAVLINK_MSG_ID_SET_MODE:
                mode = message.base_mode, message.custom_mode
                self._commands.handle_set_mode(*mode, sender, now_s)
            case mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT:
                self._fly_to(message, now_s)
            case mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM:
                self._set_data_streams(message, sender, now_s)
            case mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ:
                self.pilot.parameter_server.read(message, sender)
            case mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST:
                self.pilot.parameter_server.list_all(sender)
            case mavlink.MAVLINK_MSG_ID_PARAM_SET:
                self.pilot.parameter_server.write(message, sender)
            case mavlink.MAVLINK_MSG_ID_MISSION_SET_CURRENT:
                self._commands.set_mission_current(message.seq, sender, now_s)
            case number if number in _MISSION_PROTOCOL:
                self._transfer.handle(message, sender, now_s)
            case mavlink.MAVLINK_MSG_ID_TIMESYNC:
                if message.tc1 == 0:
                    boot_ns = round((now_s - self.pilot.readiness.boot_s) * _NANO)
                    answer = mavlink.MAVLink_timesync_message(boot_ns, message.ts1)
                    self._outbox.reply(sender, answer)
            case mavlink.MAVLINK_MSG_ID_PING:
                if message.target_system == 0 and message.target_component == 0:
                    asked = message.time_usec, message.seq
                    answer = mavlink.MAVLink_ping_message(*asked, sender.system, sender.component)
                    self._outbox.reply(sender, answer)
            case _:
                self.unknown += 1

    def _fly_to(self, message: mavlink.MAVLink_message, now_s: float) -> None:
        if self.pilot.mode is not FlightMode.GUIDED or message.type_mask & _POSITION_IGNORED:
            return
        target_enu_m = place_enu_m(
            self.config.origin,
            message.coordinate_frame,
            message.lat_int,
            message.lon_int,
            message.alt,
            self.pilot.flight.home_enu_m[2],
        )
        if target_enu_m is not None:
            self.pilot.fly_guided(target_enu_m, now_s)

    def _set_data_streams(
        self, message: mavlink.MAVLink_message, sender: Sender, now_s: float
    ) -> None:
        everything = message.req_stream_id == mavlink.MAV_DATA_STREAM_ALL
        wanted = message.start_stop == 1 and message.req_message_rate > 0
        interval_s = 1.0 / message.req_message_rate if wanted else None
        for stream, message_ids in DATA_STREAMS.items():
            if everything or stream == message.req_stream_id:
                for message_id in message_ids:
                    self._streams.set_interval(sender.channel, message_id, interval_s, now_s)
