"""Bridge and simulated autopilot with a shared key, and others without it, through sockets."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import (
    Arrived,
    GoTo,
    Home,
    MotorsRun,
    NotReady,
    Return,
    ReturnBegun,
    Telemetry,
    VehicleReady,
    VehicleReport,
)
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.vehicle.config import BridgeConfig
from agent.vehicle.signing import SigningKey
from sim.autopilot.config import VehicleConfig
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.options import Endpoint, Transport
from sim.autopilot.server import VehicleServer
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.runtime.clock import ScaledClock
from tests.sitl.test_bridge_link import until
from tests.support.bridge_flight import ORIGIN, START

pytestmark = pytest.mark.sitl

SPEEDUP = 20.0
CONFIG = BridgeConfig(1, ORIGIN, position_rate_hz=20.0).for_speedup(SPEEDUP)
KEY = SigningKey(bytes(range(32)))
LAND_NOW = mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 9, 0, 0, 0, 0, 0)


class Fleet:
    """One simulated vehicle, and the bridge that flies it."""

    def __init__(
        self,
        machine: SimulatedAutopilot,
        server: VehicleServer,
        key: SigningKey | None,
        clock: ScaledClock,
    ) -> None:
        self.machine = machine
        self.server = server
        self.reports: list[VehicleReport] = []
        self.bridge = MavlinkVehicle(CONFIG, server.url, clock, self.reports.append, key=key)

    @property
    def news(self) -> list[VehicleReport]:
        return [r for r in self.reports if not isinstance(r, Telemetry | NotReady)]


@asynccontextmanager
async def fleet(
    transport: Transport, vehicle_key: SigningKey | None, bridge_key: SigningKey | None
) -> AsyncIterator[Fleet]:
    clock = ScaledClock(SPEEDUP)
    machine = SimulatedAutopilot(
        VehicleConfig(1, start_enu_m=(5.0, 0.0, 0.0), origin=ORIGIN),
        ArduCopterModel(),
        clock.now_s(),
    )
    secret = None if vehicle_key is None else vehicle_key.secret
    endpoint = Endpoint(transport, "127.0.0.1", 0)
    server = VehicleServer(machine, endpoint, clock, signing_secret=secret)
    await server.start()
    one = Fleet(machine, server, bridge_key, clock)
    try:
        await one.bridge.start()
        yield one
    finally:
        await one.bridge.close()
        await server.close()


@pytest.mark.parametrize("transport", [Transport.TCP, Transport.UDP_IN])
def test_signed_mission_is_flown_and_a_station_without_the_key_is_not_heard(
    transport: Transport,
) -> None:
    async def scenario() -> None:
        async with fleet(transport, KEY, KEY) as one:
            one.bridge.order(START)
            await until(lambda: VehicleReady() in one.reports)
            stranger = Stranger()
            async with stranger.connected(one.server):
                one.bridge.order(GoTo(1, (5.0, 40.0, 10.0)))
                while Arrived(1) not in one.reports:
                    stranger.say(LAND_NOW)
                    await asyncio.sleep(0.02)
            one.bridge.order(Return("done"))
            await until(lambda: Home() in one.reports)
            flown = [VehicleReady(), Arrived(1), ReturnBegun(), Home()]
            assert one.news == [MotorsRun(ours=True), *flown]
            assert "COMMAND_ACK" not in stranger.heard
            assert "unsigned" not in one.bridge.dropped

    asyncio.run(scenario())


class Stranger(asyncio.DatagramProtocol, asyncio.Protocol):
    """A ground station without the key, on a connection of its own."""

    def __init__(self) -> None:
        self.heard: list[str] = []
        self._mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self._mav.robust_parsing = True
        self._write: Callable[[bytes], None] | None = None

    @asynccontextmanager
    async def connected(self, server: VehicleServer) -> AsyncIterator[None]:
        kind, host, port = server.url.split(":")
        loop = asyncio.get_running_loop()
        transport: asyncio.BaseTransport
        if kind == "tcp":
            stream, _ = await loop.create_connection(lambda: self, host, int(port))
            transport, self._write = stream, stream.write
        else:
            socket, _ = await loop.create_datagram_endpoint(
                lambda: self, remote_addr=(host, int(port))
            )
            transport, self._write = socket, socket.sendto
        try:
            yield
        finally:
            transport.close()

    def say(self, message: mavlink.MAVLink_message) -> None:
        assert self._write is not None
        self._write(bytes(message.pack(self._mav)))

    def data_received(self, data: bytes) -> None:
        self.heard += [m.get_type() for m in self._mav.parse_buffer(data) or ()]

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        self.data_received(data)


def test_a_vehicle_without_the_key_is_not_believed() -> None:
    async def scenario() -> None:
        async with fleet(Transport.TCP, None, KEY) as one:
            one.bridge.order(START)
            reason = "heard only frames that are not to be believed: unsigned"
            await until(lambda: NotReady(reason) in one.reports)
            assert list(one.bridge.dropped) == ["unsigned"]
            assert one.news == []
            assert not one.machine.pilot.armed

    asyncio.run(scenario())


def test_a_bridge_without_the_key_hears_a_signed_vehicle_is_not_heard_and_says_why(
    capsys: pytest.CaptureFixture[str],
) -> None:
    async def scenario() -> None:
        async with fleet(Transport.TCP, KEY, None) as one:
            one.bridge.order(START)
            deaf = NotReady("setting GUIDED refused (no answer), trying again")
            await until(lambda: deaf in one.reports)
            assert one.server.garbage > 0

    asyncio.run(scenario())
    assert capsys.readouterr().err.count("the vehicle signs, and may obey nobody who does not") == 1
