"""Ground stations that are shown vehicles, through real sockets."""

from __future__ import annotations

import asyncio
import socket
from collections import defaultdict
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import replace
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Refused, ReturnAdvised, VehicleReady, VehicleReport
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.links.station_links import StationLinks
from agent.vehicle.config import ONBOARD_COMPUTER, BridgeConfig, UdpOutAddress
from agent.vehicle.signing import SigningKey
from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.options import Endpoint, Transport
from sim.autopilot.server import VehicleServer
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.runtime.clock import ScaledClock
from swarm.runtime.errors import InputError
from tests.sitl.test_bridge_link import Server, free_port, until
from tests.support.bridge_flight import ORIGIN, START

pytestmark = pytest.mark.sitl

SPEEDUP = 5.0
READY_LIMIT_S = 200.0
"""The runner's own limit may go off in a callback, of which the loop makes a line in the log."""
CONFIG = BridgeConfig(1, ORIGIN, position_rate_hz=20.0).for_speedup(SPEEDUP)
KEY = SigningKey(bytes(range(32)))


class GroundStation:
    """Listens at one UDP port for everybody.

    Reads all that has come whenever it is its turn: what waits beyond a socket's buffer is lost.
    """

    def __init__(self) -> None:
        self.datagrams: list[bytes] = []
        """Of vehicles."""
        self.beside: list[bytes] = []
        """Of their agents."""
        self.senders: set[tuple[str, int]] = set()
        self._socket: socket.socket | None = None

    def listen(self, family: socket.AddressFamily = socket.AF_INET) -> int:
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(("::1" if family == socket.AF_INET6 else "127.0.0.1", 0))
        asyncio.get_running_loop().add_reader(self._socket, self._read)
        port: int = self._socket.getsockname()[1]
        return port

    def _read(self) -> None:
        assert self._socket is not None
        with suppress(BlockingIOError):
            while True:
                data, sender = self._socket.recvfrom(2048)
                self.senders.add(sender)
                if data[0] == 0xFD and data[6] == ONBOARD_COMPUTER:  # what agents say themselves
                    self.beside.append(data)
                else:
                    self.datagrams.append(data)

    def say(self, data: bytes) -> None:
        assert self._socket is not None
        for sender in self.senders:
            self._socket.sendto(data, sender)

    def messages(self) -> dict[int, set[str]]:
        """Names of the messages heard, by system id; every datagram is one frame."""
        names: dict[int, set[str]] = defaultdict(set)
        parser = mavlink.MAVLink(None)
        for datagram in self.datagrams:
            message = parser.decode(bytearray(datagram))
            names[datagram[5]].add(message.get_type())  # of unknown ones the dialect tells no id
        return names

    def close(self) -> None:
        assert self._socket is not None
        self._read()
        asyncio.get_running_loop().remove_reader(self._socket)
        self._socket.close()


@asynccontextmanager
async def flown(
    system_id: int, forward: list[str], clock: ScaledClock, key: SigningKey | None = None
) -> AsyncIterator[tuple[MavlinkVehicle, list[VehicleReport]]]:
    """A simulated vehicle and its bridge, under way to its start."""
    machine = SimulatedAutopilot(
        VehicleConfig(system_id, origin=ORIGIN), ArduCopterModel(), clock.now_s()
    )
    endpoint = Endpoint(Transport.TCP, "127.0.0.1", 0)
    secret = None if key is None else key.secret
    server = VehicleServer(machine, endpoint, clock, signing_secret=secret)
    await server.start()
    reports: list[VehicleReport] = []
    config = replace(CONFIG, system_id=system_id)
    vehicle = MavlinkVehicle(config, server.url, clock, reports.append, key=key, forward=forward)
    try:
        await vehicle.start()
        vehicle.order(START)
        yield vehicle, reports
    finally:
        await vehicle.close()
        await server.close()


def is_ready(reports: list[VehicleReport]) -> bool:
    """Whether a vehicle has reported that it is; it must not have given up, wherever."""
    given_up = [report for report in reports if isinstance(report, Refused | ReturnAdvised)]
    assert not given_up
    return VehicleReady() in reports


@pytest.mark.parametrize("key", [None, KEY])
def test_two_vehicles_are_shown_to_one_ground_station_which_commands_neither(
    key: SigningKey | None,
) -> None:
    async def scenario() -> None:
        station, clock = GroundStation(), ScaledClock(SPEEDUP)
        forward = [f"udp:127.0.0.1:{station.listen()}"]
        async with AsyncExitStack() as stack:
            one, one_reports = await stack.enter_async_context(flown(3, forward, clock, key))
            two, two_reports = await stack.enter_async_context(flown(7, forward, clock, key))
            orders = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
            land = mavlink.MAVLink_command_long_message(3, 1, 176, 0, 1, 9, 0, 0, 0, 0, 0)
            async with asyncio.timeout(READY_LIMIT_S):
                while not all([is_ready(one_reports), is_ready(two_reports)]):
                    station.say(bytes(land.pack(orders)))
                    await asyncio.sleep(0.02)
            assert not one.dropped
            assert not two.dropped
        station.close()
        heard = station.messages()
        assert set(heard) == {3, 7}
        for names in heard.values():
            assert {"HEARTBEAT", "GLOBAL_POSITION_INT", "COMMAND_ACK"} <= names
        everything = station.datagrams + station.beside
        assert all((datagram[2] == 1) is (key is not None) for datagram in everything)
        assert {datagram[5] for datagram in station.beside} == {3, 7}

    asyncio.run(scenario())


def test_frames_are_shown_as_they_came_and_only_the_vehicles() -> None:
    async def scenario() -> None:
        station, other, server = GroundStation(), GroundStation(), Server()
        forward = [
            f"udp:127.0.0.1:{station.listen()}",
            f"udp:[::1]:{other.listen(socket.AF_INET6)}",
        ]
        url = f"tcp:127.0.0.1:{await server.listen()}"
        vehicle = MavlinkVehicle(CONFIG, url, ScaledClock(1.0), _nobody, forward=forward)
        try:
            await vehicle.start()
            await until(lambda: server.writer is not None)
            assert server.writer is not None
            server.writer.writelines([b"noise", *VEHICLES[:2], STRANGERS, *VEHICLES[2:]])
            await until(lambda: len(station.datagrams) + len(other.datagrams) >= 2 * len(VEHICLES))
        finally:
            await vehicle.close()
            await server.stop()
            station.close()
            other.close()
        assert station.datagrams == other.datagrams == VEHICLES

    asyncio.run(scenario())


def _nobody(report: VehicleReport) -> None:
    pass


def _frame(message: Any, system: int = 1, component: int = 1, *, v1: bool = False) -> bytes:
    mav = mavlink.MAVLink(None, srcSystem=system, srcComponent=component)
    return bytes(message.pack(mav, force_mavlink1=v1))


def _unknown() -> bytes:
    return b"\xfd" + bytes([3, 0, 0, 9, 1, 1]) + (60_000).to_bytes(3, "little") + b"abcCC"


_REACHED = mavlink.MAVLink_mission_item_reached_message(4)
VEHICLES = [
    _frame(_REACHED),
    _unknown(),
    _frame(_REACHED, component=154),
    _frame(_REACHED, v1=True),
]
STRANGERS = _frame(_REACHED, system=2)


def test_a_ground_station_that_is_not_there_costs_nothing_but_a_count() -> None:
    async def scenario() -> None:
        gone = UdpOutAddress("127.0.0.1", free_port(socket.SOCK_DGRAM))
        nowhere = UdpOutAddress("no-such-host.invalid", 14550)
        forwarding = StationLinks([gone, nowhere], 1, ScaledClock(1.0))
        assert forwarding
        forwarding.start()
        try:
            for _ in range(20):
                forwarding.show([b"frame"])
                await asyncio.sleep(0.01)
            await until(lambda: forwarding.dropped > 20)
        finally:
            await forwarding.close()
            await forwarding.close()

    asyncio.run(scenario())


def test_a_ground_station_that_starts_later_is_shown_the_vehicle() -> None:
    async def scenario() -> None:
        port = free_port(socket.SOCK_DGRAM)
        address = UdpOutAddress("127.0.0.1", port)
        forwarding = StationLinks([address], 1, ScaledClock(1.0))
        forwarding.start()
        loop = asyncio.get_running_loop()
        try:
            for _ in range(5):
                forwarding.show([b"early"])
                await asyncio.sleep(0.01)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as late:
                late.bind(("127.0.0.1", port))
                late.setblocking(False)
                # The refusal of an early datagram may cost the next one.
                forwarding.show([b"now", b"now"])
                async with asyncio.timeout(5.0):
                    while await loop.sock_recv(late, 100) != b"now":
                        pass  # its agent's heartbeat
        finally:
            await forwarding.close()

    asyncio.run(scenario())


def test_without_ground_stations_nothing_is_kept() -> None:
    async def scenario() -> None:
        vehicle = MavlinkVehicle(CONFIG, "tcp:127.0.0.1:1", ScaledClock(1.0), _nobody)
        vehicle.received(b"".join(VEHICLES))
        assert vehicle.bridge.codec.take_frames() == []
        await vehicle.close()

    asyncio.run(scenario())


def test_a_wrong_address_is_refused_at_once() -> None:
    with pytest.raises(InputError, match="'tcp' is no kind of link; give udp:HOST:PORT"):
        MavlinkVehicle(
            CONFIG, "tcp:127.0.0.1:1", ScaledClock(1.0), _nobody, forward=["tcp:127.0.0.1:14550"]
        )
