"""Records what real firmware says to the orders of our bridge, as test data.

Start firmware in software-in-the-loop as `swarm run` does (sim.fleet.firmware says how: any
instance), then: ``python -m tests.benchmarks.record_autopilot LINK PLAY FILE --speedup N``. A
LINK is ``tcp:HOST:PORT`` (ArduCopter) or ``udpin:HOST:PORT`` (PX4), N the firmware's own speed-up.
For the refusals before a position is known it must have been started just before. Plays:
``flight``, ``runway`` of a plane, and a failure each: ``ground-lost``, ``battery-low``,
``gps-lost``. Orders, missions
and parameters are those of the bridge, put into frames by its codec; the failures are settings of
the firmware's own simulator. Reports that repeat a state are thinned, messages that the bridge
does not look at are left out, and so are parameters that nobody asked for.
"""

from __future__ import annotations

import argparse
import json
import math
import select
import socket
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final, Protocol, TextIO

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Runway
from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.firmware import firmware_of
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.landing_pattern import RunwayLanding
from agent.vehicle.messages import (
    CommandInt,
    CommandLong,
    GroundHeartbeat,
    Inbound,
    LandedState,
    MissionItem,
    MissionSetCurrent,
    Outbound,
    ParameterRead,
    Position,
    StatusText,
)
from agent.vehicle.mission_plan import MissionPlan, MissionSeqs
from agent.vehicle.mission_transfer import MissionInForce, MissionPolicy, MissionTransfer
from agent.vehicle.state import VehicleState
from swarm.model.frames import Origin
from swarm.runtime.clock import SystemClock

CLOCK: Final = SystemClock()
METRES_PER_DEGREE: Final = 111_195.0
REPORT_S: Final = 5.0
"""A state that does not change is written down that often [vehicle seconds]."""
POSITION_S: Final = 2.0
STATES: Final = {
    "HEARTBEAT": ("custom_mode", "base_mode", "system_status"),
    "MISSION_CURRENT": ("seq", "total", "mission_state", "mission_mode"),
    "EXTENDED_SYS_STATE": ("vtol_state", "landed_state"),
    "SYS_STATUS": (
        "onboard_control_sensors_present",
        "onboard_control_sensors_enabled",
        "onboard_control_sensors_health",
    ),
    "EKF_STATUS_REPORT": ("flags",),
    "ESTIMATOR_STATUS": ("flags",),
    "HOME_POSITION": ("latitude", "longitude"),
    "GLOBAL_POSITION_INT": (),
}
"""Reports, and by what two of them differ."""
EVENTS: Final = frozenset(
    {
        *("COMMAND_ACK", "COMMAND_LONG", "STATUSTEXT", "PARAM_VALUE", "PARAM_ERROR"),
        *("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ITEM_REACHED", "MISSION_ACK"),
        *("MISSION_COUNT", "MISSION_ITEM_INT", "GPS_GLOBAL_ORIGIN"),
    }
)
"""Messages of which every one is written down."""
LOG_FILE: Final = "[logger]"
"""How a text begins that names a file, by date."""


class Link(Protocol):
    """Bytes to and from one firmware."""

    def fileno(self) -> int:
        """What to wait for."""
        ...

    def receive(self) -> bytes:
        """What has come; blocks."""
        ...

    def send(self, data: bytes) -> None:
        """Say something."""
        ...


class TcpLink:
    """The firmware listens."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.create_connection((host, port), 10.0)
        self.fileno = self._socket.fileno

    def receive(self) -> bytes:
        """What has come."""
        return self._socket.recv(65536)

    def send(self, data: bytes) -> None:
        """Say something."""
        self._socket.sendall(data)


class UdpLink:
    """The firmware speaks first."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((host, port))
        self._peer: Any = None
        self.fileno = self._socket.fileno

    def receive(self) -> bytes:
        """What has come."""
        data, self._peer = self._socket.recvfrom(65536)
        return data

    def send(self, data: bytes) -> None:
        """Say something; nobody hears it before the firmware has spoken."""
        if self._peer is not None:
            self._socket.sendto(data, self._peer)


class Notes:
    """The file: every message that matters, with the wall time since the first."""

    def __init__(self, file: TextIO, speedup: float) -> None:
        self._file = file
        self._speedup = speedup
        self._start_s = CLOCK.now_s()
        self._asked: set[str] = {"MIS_TOTAL"}
        self._last: dict[str, tuple[float, tuple[Any, ...]]] = {}

    def take(self, message: Any, sender: str) -> None:
        """Write it down, unless it tells nothing new."""
        name = message.get_type()
        at_s = CLOCK.now_s() - self._start_s
        if sender == "ground":
            if name.startswith("PARAM"):
                self._asked.add(message.param_id)
        elif name in STATES:
            state = tuple(getattr(message, field) for field in STATES[name])
            told_s, told = self._last.get(name, (-math.inf, ()))
            pause_s = REPORT_S if state else POSITION_S
            if state == told and at_s - told_s < pause_s / self._speedup:
                return
            self._last[name] = (at_s, state)
        elif name not in EVENTS or self._is_of_no_interest(message):
            return
        fields = {each: _plain(getattr(message, each)) for each in message.fieldnames}
        envelope = {
            "t_s": round(at_s, 3),
            "from": sender,
            "sys": message.get_srcSystem(),
            "comp": message.get_srcComponent(),
            "msg": name,
        }
        self._file.write(json.dumps(envelope | fields) + "\n")

    def _is_of_no_interest(self, message: Any) -> bool:
        """Whether it is a parameter that nobody asked for, or names a file."""
        if message.get_type() == "PARAM_VALUE":
            return str(message.param_id) not in self._asked
        return message.get_type() == "STATUSTEXT" and str(message.text).startswith(LOG_FILE)


def _plain(value: Any) -> Any:
    """A field as JSON knows it, a real one as the nine digits that tell it from any other."""
    if isinstance(value, float):
        return "nan" if value != value else float(f"{value:.9g}")
    return [_plain(each) for each in value] if isinstance(value, list) else value


class Ground:
    """The ground's side of a play: says what the bridge would say, and waits for effects."""

    def __init__(self, link: Link, notes: Notes, speedup: float) -> None:
        self._link = link
        self._notes = notes
        self._speedup = speedup
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._own = mavlink.MAVLink(None)
        self._heartbeat_s = 0.0
        self._transfer: MissionTransfer | None = None
        self.is_heard = True
        """Whether the vehicle gets our heartbeats."""
        self.state = VehicleState()
        self.texts: list[str] = []
        self.codec: MavlinkCodec | None = None
        self.wait(lambda: self.state.heartbeat is not None, "a heartbeat")
        heartbeat = self.state.heartbeat
        flavour = None if heartbeat is None else firmware_of(heartbeat)
        if flavour is None:
            raise SystemExit("no firmware that is known")
        self.flavour: Firmware = flavour

    @property
    def is_px4(self) -> bool:
        """Which of the two it is."""
        return self.state.heartbeat is not None and self.state.heartbeat.autopilot == 12

    def say(self, *messages: Outbound) -> None:
        """Send orders, and listen for a moment."""
        if self.codec is None:
            raise SystemExit("nobody to speak to")
        for message in messages:
            self._put(self.codec.encode(message))
            self.listen(0.3)

    def write(self, name: str, value: float) -> None:
        """Set a parameter; PX4 wants whole numbers as bytes, and their own type."""
        kind = mavlink.MAV_PARAM_TYPE_REAL32
        if self.is_px4 and isinstance(value, int):
            kind = mavlink.MAV_PARAM_TYPE_INT32
            [value] = struct.unpack("<f", struct.pack("<i", value))
        assert self.codec is not None
        message = mavlink.MAVLink_param_set_message(
            self.codec._target, 1, name.encode(), value, kind
        )
        sender = self.codec._sender
        self._put(bytes(message.pack(sender)))
        sender.seq = (sender.seq + 1) % 256
        self.listen(0.5)

    def read(self, *names: str) -> None:
        """Ask for parameters."""
        for name in names:
            self.say(ParameterRead(name))

    def _put(self, frame: bytes) -> None:
        for message in self._own.parse_buffer(frame) or ():
            self._notes.take(message, "ground")
        self._link.send(frame)

    def listen(self, duration_s: float) -> None:
        """Listen for so long [vehicle seconds]."""
        end_s = CLOCK.now_s() + duration_s / self._speedup
        while (left_s := end_s - CLOCK.now_s()) > 0.0:
            self._listen_once(left_s)

    def wait(self, done: Callable[[], bool], what: str, patience_s: float = 300.0) -> None:
        """Listen until something has happened."""
        end_s = CLOCK.now_s() + patience_s / self._speedup
        while not done():
            if CLOCK.now_s() > end_s:
                raise SystemExit(f"gave up waiting for {what}")
            self._listen_once(0.1)

    def _listen_once(self, most_s: float) -> None:
        now_s = CLOCK.now_s()
        if self.codec is not None and self.is_heard and now_s >= self._heartbeat_s:
            self._heartbeat_s = now_s + 1.0 / self._speedup
            self._put(self.codec.encode(GroundHeartbeat()))
        if not select.select([self._link], [], [], min(most_s, 0.05))[0]:
            return
        data = self._link.receive()
        for message in self._parser.parse_buffer(data) or ():
            if message.get_type() != "BAD_DATA" and message.get_srcComponent() == 1:
                if self.codec is None:
                    self.codec = MavlinkCodec(message.get_srcSystem())
                self._notes.take(message, "vehicle")
        if self.codec is not None:
            for heard in self.codec.decode(data):
                self._hear(heard.message, now_s)

    def _hear(self, message: Inbound, now_s: float) -> None:
        if isinstance(message, Position):
            self.state.on_position(message)
        else:
            self.state.on_message(message, now_s)
        if isinstance(message, StatusText):
            self.texts.append(message.text)
        if self._transfer is not None and self.codec is not None:
            for answer in self._transfer.on_message(message, now_s):
                self._put(self.codec.encode(answer))

    def upload(self, items: Sequence[MissionItem]) -> None:
        """Put a mission on the vehicle, and read it back."""
        assert self.codec is not None
        self._transfer = transfer = MissionTransfer(MissionPolicy())
        for message in transfer.upload(items, CLOCK.now_s()):
            self._put(self.codec.encode(message))
        self.wait(lambda: transfer.result is not None, "the mission")
        if not isinstance(transfer.result, MissionInForce):
            raise SystemExit(f"{transfer.result}")
        self._transfer = None

    # What the plays are made of.

    def streams(self) -> None:
        """Ask for the reports that the bridge asks for, once a second."""
        for message_id, _ in ((33, Position), *self.flavour.streams):
            self.say(CommandLong(511, (float(message_id), 1e6, 0.0, 0.0, 0.0, 0.0, 0.0)))

    def ready(self) -> None:
        """Wait until the vehicle may be armed."""
        self.wait(lambda: self.flavour.unready(self.state) is None, "a vehicle that is ready")
        self.listen(3.0)

    def mode(self) -> int:
        """The newest."""
        return -1 if self.state.heartbeat is None else self.state.heartbeat.custom_mode

    def rise(self, height_m: float = 10.0) -> None:
        """Arm and take off."""
        self.say(self.flavour.set_commanded_mode())
        self.wait(lambda: self.flavour.is_commanded(self.mode()), "the mode")
        self.say(self.flavour.arm())
        self.wait(lambda: self.state.armed, "motors")
        alt_m, home_alt_m = self.height(height_m), self.height(0.0)
        self.say(self.flavour.takeoff(alt_m, home_alt_m))
        self.wait(
            lambda: (
                self.state.position is not None
                and self.state.position.relative_alt_m > height_m - 0.7
                and self.flavour.is_commanded(self.mode())
            ),
            "height",
        )
        self.listen(3.0)

    def height(self, height_m: float) -> float:
        """Above the sea, of a height above home [m]."""
        position = self.state.position
        assert position is not None
        return position.alt_m - position.relative_alt_m + height_m

    def place(self, north_m: float) -> tuple[float, float]:
        """So far north of here [deg]."""
        position = self.state.position
        assert position is not None
        return position.lat_deg + north_m / METRES_PER_DEGREE, position.lon_deg

    def go(self, north_m: float, height_m: float = 10.0) -> CommandInt:
        """The order to fly there."""
        return self.flavour.reposition(*self.place(north_m), self.height(height_m), 5.0)

    def down(self) -> None:
        """Wait until the vehicle has landed and stopped its motors."""
        self.wait(
            lambda: not self.state.armed and self.state.landed is LandedState.ON_GROUND,
            "the ground",
        )
        self.listen(6.0)


def flight(ground: Ground) -> None:
    """From power-up to the ground: refusals, a target, one beyond the fence, a mission home."""
    if ground.is_px4:  # which is ready within seconds
        ground.say(ground.flavour.arm())
    ground.streams()
    ground.read(*(name for names in ground.flavour.failsafe_names for name in names))
    ground.read("SWARM_SIMULATED", *(each.name for each in ground.flavour.speed_parameters))
    ground.say(ground.flavour.set_commanded_mode())
    ground.wait(lambda: ground.state.position is not None, "a position")
    if ground.flavour.unready(ground.state) is not None:
        ground.listen(8.0)
        ground.say(ground.flavour.arm())
    ground.ready()
    ground.write(*(("NAV_DLL_ACT", 2) if ground.is_px4 else ("FS_GCS_ENABLE", 1.0)))
    if ground.is_px4:
        ground.write("GF_MAX_HOR_DIST", 100.0)
    else:
        for name, value in (("FENCE_TYPE", 2.0), ("FENCE_RADIUS", 100.0), ("FENCE_ENABLE", 1.0)):
            ground.write(name, value)
    ground.listen(3.0)
    ground.rise()
    ground.say(ground.go(20.0))
    ground.listen(12.0)
    ground.say(ground.go(300.0))
    ground.listen(4.0)
    target = ground.place(-10.0)
    ground.upload(MissionPlan(*target, ground.height(12.0), 4.0, 3).items(ground.flavour))
    ground.listen(3.0)
    ground.say(MissionSetCurrent(MissionSeqs(ground.flavour.mission_vehicle_items).speed))
    ground.say(ground.flavour.set_mission_mode())
    ground.wait(lambda: ground.flavour.is_mission(ground.mode()), "the mission")
    ground.listen(5.0)
    ground.down()


def ground_lost(ground: Ground) -> None:
    """Our heartbeats cease in flight, and come again while the vehicle returns."""
    ground.streams()
    ground.ready()
    if ground.is_px4:
        ground.write("NAV_DLL_ACT", 2)
    else:
        ground.write("FS_GCS_ENABLE", 1.0)
    ground.rise()
    ground.say(ground.go(20.0))
    ground.listen(10.0)
    ground.is_heard = False
    ground.wait(lambda: ground.flavour.is_returning(ground.mode()), "the failsafe")
    ground.listen(5.0)
    ground.is_heard = True
    ground.down()


def battery_low(ground: Ground) -> None:
    """The battery runs low in flight."""
    ground.streams()
    ground.ready()
    if ground.is_px4:
        ground.write("COM_LOW_BAT_ACT", 3)
    else:
        ground.write("BATT_LOW_VOLT", 10.8)
        ground.write("BATT_FS_LOW_ACT", 2.0)
    ground.rise()
    ground.say(ground.go(20.0))
    ground.listen(10.0)
    if ground.is_px4:
        ground.write("SIM_BAT_MIN_PCT", 6.0)
    else:
        ground.write("SIM_BATT_VOLTAGE", 10.5)
    ground.wait(lambda: ground.flavour.is_returning(ground.mode()), "the failsafe")
    ground.down()


def gps_lost(ground: Ground) -> None:
    """The receiver sees no satellites any more."""
    ground.streams()
    ground.ready()
    ground.rise()
    if ground.is_px4:
        ground.write("SIM_GPS_USED", 0)
    else:
        ground.write("SIM_GPS1_ENABLE", 0.0)
    ground.wait(lambda: not ground.state.armed, "the ground")
    ground.listen(6.0)


def runway(ground: Ground) -> None:
    """A plane takes off, flies to a target and lands as it was told before."""
    ground.streams()
    ground.read(*(name for names in ground.flavour.failsafe_names for name in names))
    ground.read(*ground.flavour.landing_names)
    ground.ready()
    position = ground.state.position
    assert position is not None
    origin = Origin(position.lat_deg, position.lon_deg, ground.height(0.0))
    landing = RunwayLanding(80.0, math.radians(5.0))
    ground.upload(landing.items(Runway((0.0, 0.0, 0.0), 0.0), origin))
    ground.listen(3.0)
    ground.say(ground.flavour.arm())
    ground.wait(lambda: ground.state.armed, "motors")
    ground.say(ground.flavour.takeoff(ground.height(40.0), ground.height(0.0)))
    ground.wait(lambda: ground.flavour.is_taking_off(ground.mode()), "the take-off")
    ground.wait(lambda: ground.flavour.is_commanded(ground.mode()), "the height")
    ground.listen(5.0)
    target = (*ground.place(300.0), ground.height(0.0) + 45.0, 12.0)
    ground.say(ground.flavour.reposition(*target))
    ground.listen(40.0)
    ground.say(ground.flavour.set_return_mode())
    ground.wait(lambda: ground.flavour.is_returning(ground.mode()), "the return")
    ground.down()


PLAYS: Final = {
    "flight": flight,
    "runway": runway,
    "ground-lost": ground_lost,
    "battery-low": battery_low,
    "gps-lost": gps_lost,
}


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("link")
    parser.add_argument("play", choices=PLAYS)
    parser.add_argument("file", type=Path)
    parser.add_argument("--speedup", type=float, default=1.0)
    asked = parser.parse_args(arguments)
    transport, host, port = asked.link.split(":")
    link: Link = (TcpLink if transport == "tcp" else UdpLink)(host, int(port))
    with asked.file.open("w") as file:
        PLAYS[asked.play](Ground(link, Notes(file, asked.speedup), asked.speedup))


if __name__ == "__main__":
    main()
