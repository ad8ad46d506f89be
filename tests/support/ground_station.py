"""A ground station for one simulated vehicle, in virtual time and without sockets."""

from __future__ import annotations

from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.codec import ChannelCodec
from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import Connected, MavlinkReceived, TimeAdvanced, VehicleEvent
from sim.autopilot.faults import VehicleFault
from sim.autopilot.faulty_vehicle import FaultyAutopilot
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.model.frames import wgs84_from_enu

STABILIZE, AUTO, GUIDED, LOITER, RTL, LAND = 0, 3, 4, 5, 6, 9
ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4


class GroundStation:
    """Speaks to a vehicle in frames, as a link would carry them, and keeps what it says."""

    def __init__(
        self,
        vehicle: SimulatedAutopilot,
        channel: int = 0,
        now_s: float = 0.0,
        faults: tuple[VehicleFault, ...] = (),
        component_id: int = 190,
    ) -> None:
        self.vehicle = vehicle
        self._machine = FaultyAutopilot(vehicle, faults, now_s) if faults else vehicle
        self.now_s = now_s
        self.heard: list[Any] = []
        """Messages of the vehicle on this channel, oldest first."""
        self.heard_s: list[float] = []
        """When each was heard."""
        self._channel = channel
        self._outgoing = ChannelCodec(255, component_id, datagrams=False)
        self._to_vehicle = ChannelCodec(vehicle.config.system_id, 1, datagrams=False)
        self._to_ground = ChannelCodec(255, component_id, datagrams=False)
        self.step(Connected(channel))

    def step(self, event: VehicleEvent) -> list[Any]:
        """Let the vehicle take a step now; what it says on this channel."""
        said: list[Any] = []
        for send in self._machine.step(event, self.now_s):
            if send.channel in (None, self._channel):
                frame = self._to_vehicle.encode(send.message, send.system_id)
                said += self._to_ground.decode(frame)
        self.heard += said
        self.heard_s += [self.now_s] * len(said)
        return said

    def send(self, message: Any) -> list[Any]:
        """Say something; what the vehicle answers at once."""
        [decoded] = ChannelCodec(0, 0, datagrams=True).decode(self._outgoing.encode(message))
        return self.step(MavlinkReceived(self._channel, decoded))

    def wait(self, duration_s: float) -> list[Any]:
        """Let time pass, calling the vehicle when it asks for it."""
        end_s = self.now_s + duration_s
        said: list[Any] = []
        while (deadline_s := self._machine.next_deadline_s()) <= end_s:
            self.now_s = max(self.now_s, deadline_s)
            said += self.step(TimeAdvanced())
        self.now_s = end_s
        return said + self.step(TimeAdvanced())

    def command(self, command: int, *params: float) -> int:
        """Send a COMMAND_LONG; the result in its acknowledgement."""
        filled = [*params, *[0.0] * (7 - len(params))]
        answer = self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled))
        return the_result(answer)

    def command_int(
        self, command: int, frame: int, x: int, y: int, z: float, *params: float
    ) -> int:
        """Send a COMMAND_INT; the result in its acknowledgement."""
        filled = [*params, *[0.0] * (4 - len(params))]
        answer = self.send(
            mavlink.MAVLink_command_int_message(1, 1, frame, command, 0, 0, *filled, x, y, z)
        )
        return the_result(answer)

    def set_mode(self, custom_mode: int, sub_mode: int = 0) -> int:
        """Ask for a mode."""
        return self.command(mavlink.MAV_CMD_DO_SET_MODE, 1, custom_mode, sub_mode)

    def arm(self) -> int:
        """Ask for the motors."""
        return self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1)

    def reposition(
        self, east_m: float, north_m: float, height_m: float, change_mode: bool = True
    ) -> int:
        """Ask to fly to a place, its height above home."""
        lat_e7, lon_e7 = self.place_e7(east_m, north_m)
        return self.command_int(
            mavlink.MAV_CMD_DO_REPOSITION,
            mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            lat_e7,
            lon_e7,
            height_m,
            -1.0,
            float(change_mode),
        )

    def place_e7(self, east_m: float, north_m: float) -> tuple[int, int]:
        """Latitude and longitude on the wire of a place in the vehicle's local frame."""
        origin = self.vehicle.config.origin
        lat_deg, lon_deg, _ = wgs84_from_enu(origin, (east_m, north_m, 0.0))
        return round(lat_deg * 1e7), round(lon_deg * 1e7)

    def take_off(self, height_m: float = 10.0) -> None:
        """Wait until the vehicle is ready, then bring it to a hover."""
        self.wait(5.0)
        assert self.set_mode(GUIDED) == ACCEPTED
        assert self.arm() == ACCEPTED
        assert self.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, height_m) == ACCEPTED
        self.wait(self.vehicle.config.spool_up_s + height_m / 2.5 + 0.1)

    def upload(self, *items: Any) -> int:
        """Upload a mission the vehicle asks for item by item; the type of its MISSION_ACK."""
        answer = self.send(mavlink.MAVLink_mission_count_message(1, 1, len(items)))
        while not (acks := only(answer, "MISSION_ACK")):
            [request] = only(answer, "MISSION_REQUEST") + only(answer, "MISSION_REQUEST_INT")
            answer = self.send(items[request.seq])
        return acks[0].type  # type: ignore[no-any-return]  # generated code

    def item(
        self,
        seq: int,
        east_m: float = 0.0,
        north_m: float = 0.0,
        height_m: float = 12.0,
        *,
        command: int = mavlink.MAV_CMD_NAV_WAYPOINT,
        params: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
        frame: int = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
    ) -> Any:
        """A mission item."""
        lat_e7, lon_e7 = self.place_e7(east_m, north_m)
        return mavlink.MAVLink_mission_item_int_message(
            1, 1, seq, frame, command, 0, 1, *params, lat_e7, lon_e7, height_m
        )

    @property
    def position_enu_m(self) -> tuple[float, float, float]:
        """Where the vehicle really is."""
        return self.vehicle.pilot.position_enu_m(self.now_s)

    def texts(self) -> list[str]:
        """Everything the vehicle has said to people."""
        return [message.text for message in only(self.heard, "STATUSTEXT")]


def ground_station(flavour: FirmwareModel | None = None, **config: Any) -> GroundStation:
    """A ground station connected to a vehicle (ArduCopterModel) that has just been powered up."""
    settings = VehicleConfig(**{"system_id": 1, "spool_up_s": 0.0, **config})
    return GroundStation(SimulatedAutopilot(settings, flavour or ArduCopterModel(), 0.0))


def only(messages: list[Any], name: str) -> list[Any]:
    """The messages of that name."""
    return [message for message in messages if message.get_type() == name]


def the(messages: list[Any], name: str) -> Any:
    """The one message of that name."""
    [message] = only(messages, name)
    return message


def the_result(messages: list[Any]) -> int:
    """The result in the acknowledgement, which may come more than once."""
    [result] = {message.result for message in only(messages, "COMMAND_ACK")}
    return int(result)
