"""The simulated autopilot over real sockets, flown by plain MAVLink clients."""

from __future__ import annotations

import asyncio
import json
import signal
import subprocess
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays, VehicleConfig
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.options import parse_endpoint
from sim.autopilot.server import VehicleServer
from sim.autopilot.vehicle import SimulatedAutopilot
from swarm.runtime.clock import ScaledClock
from tests.process.programs import Swarm

pytestmark = pytest.mark.sitl
TIMEOUT_S = 20.0
SPEEDUP = 20.0


class Client:
    """A ground station on a stream or datagram link."""

    def __init__(self, write: Callable[[bytes], None]) -> None:
        self.mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
        self.mav.robust_parsing = True
        self.heard: asyncio.Queue[Any] = asyncio.Queue()
        self._write = write

    def feed(self, data: bytes) -> None:
        for message in self.mav.parse_buffer(data) or ():
            self.heard.put_nowait(message)

    def send(self, message: Any) -> None:
        self._write(message.pack(self.mav))

    async def until(self, name: str, **fields: Any) -> Any:
        """Wait for a message with those fields."""
        async with asyncio.timeout(TIMEOUT_S):
            while True:
                message = await self.heard.get()
                if message.get_type() == name and all(
                    getattr(message, field) == value for field, value in fields.items()
                ):
                    return message

    async def command(self, command: int, *params: float) -> int:
        filled = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(1, 1, command, 0, *filled))
        ack = await self.until("COMMAND_ACK", command=command)
        return int(ack.result)


@asynccontextmanager
async def serving(listen: str) -> AsyncIterator[VehicleServer]:
    clock = ScaledClock(SPEEDUP)
    config = VehicleConfig(1, cruise_m_s=5.0, delays=Delays(0.5, 0.5, 1.0, 1.5))
    vehicle = SimulatedAutopilot(config, ArduCopterModel(), clock.now_s())
    server = VehicleServer(vehicle, parse_endpoint(listen), clock)
    await server.start()
    try:
        yield server
    finally:
        await server.close()


class _Datagrams(asyncio.DatagramProtocol):
    def __init__(self) -> None:
        self.client: Client | None = None

    def datagram_received(self, data: bytes, addr: Any) -> None:
        if self.client is None:
            raise AssertionError("received before connected")
        self.client.feed(data)


@asynccontextmanager
async def connected(url: str) -> AsyncIterator[Client]:
    name, host, port = url.split(":")
    if name == "tcp":
        reader, writer = await asyncio.open_connection(host, int(port))
        client = Client(writer.write)

        async def read() -> None:
            while data := await reader.read(4096):
                client.feed(data)

        reading = asyncio.create_task(read())
        try:
            yield client
        finally:
            reading.cancel()
            writer.close()
            await asyncio.gather(reading, writer.wait_closed(), return_exceptions=True)
    else:
        protocol = _Datagrams()
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: protocol, remote_addr=(host, int(port))
        )
        client = protocol.client = Client(transport.sendto)
        client.send(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3))
        try:
            yield client
        finally:
            transport.close()


async def fly(client: Client) -> None:
    """Take off, go somewhere, come home."""
    await client.until("HEARTBEAT", system_status=3)
    position = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT
    assert await client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, position, 100_000) == 0
    assert await client.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 4) == 0
    await client.until("HEARTBEAT", custom_mode=4)
    await client.until("GLOBAL_POSITION_INT", alt=488_000)
    for _ in range(500):
        if await client.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1) == 0:
            break
        await asyncio.sleep(0.01)
    assert await client.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 5.0) == 0
    hover = await client.until("GLOBAL_POSITION_INT", relative_alt=5000, vz=0)
    client.send(
        mavlink.MAVLink_command_int_message(
            1, 1, 6, mavlink.MAV_CMD_DO_REPOSITION, 0, 0, -1, 1, 0, 0, hover.lat + 900, hover.lon, 5
        )
    )
    assert (await client.until("COMMAND_ACK")).result == 0
    await client.until("GLOBAL_POSITION_INT", lat=hover.lat + 900, vx=0, vy=0)
    assert await client.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == 0
    await client.until("STATUSTEXT", text="Disarming motors")


async def _flight(listen: str) -> None:
    async with serving(listen) as server, connected(server.url) as client:
        await fly(client)


@pytest.mark.parametrize("listen", ["tcp:127.0.0.1:0", "udpin:127.0.0.1:0"])
def test_whole_flight_over_a_socket(listen: str) -> None:
    asyncio.run(_flight(listen))


def test_vehicle_that_sends_first_is_flown_too() -> None:
    async def flight() -> None:
        peers: list[Any] = []

        class Listening(_Datagrams):
            def datagram_received(self, data: bytes, addr: Any) -> None:
                peers[:] = [addr]
                super().datagram_received(data, addr)

        protocol = Listening()
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: protocol, local_addr=("127.0.0.1", 0)
        )
        protocol.client = Client(lambda data: transport.sendto(data, peers[0]))
        port = transport.get_extra_info("sockname")[1]
        try:
            async with serving(f"udpout:127.0.0.1:{port}") as server:
                assert server.url == f"udpin:127.0.0.1:{port}"
                await fly(protocol.client)
        finally:
            transport.close()

    asyncio.run(flight())


@pytest.mark.parametrize("listen", ["tcp:127.0.0.1:0", "udpin:127.0.0.1:0"])
def test_several_ground_stations_get_what_each_asked_for(listen: str) -> None:
    async def talk() -> None:
        async with (
            serving(listen) as server,
            connected(server.url) as first,
            connected(server.url) as second,
        ):
            attitude = mavlink.MAVLINK_MSG_ID_ATTITUDE
            assert await first.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, attitude, 1e5) == 0
            await first.until("ATTITUDE")
            for _ in range(5):
                message = await second.until("HEARTBEAT")
                assert message.get_srcSystem() == 1
            assert second.heard.empty() or second.heard.get_nowait().get_type() != "ATTITUDE"
            assert await second.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 5) == 0
            await first.until("HEARTBEAT", custom_mode=5)

    asyncio.run(talk())


@pytest.mark.parametrize("listen", ["tcp:127.0.0.1:0", "udpin:127.0.0.1:0"])
def test_garbage_on_a_socket_disturbs_nobody(listen: str) -> None:
    async def talk() -> None:
        async with serving(listen) as server, connected(server.url) as client:
            await client.until("HEARTBEAT")
            for _ in range(20):
                client._write(bytes(range(250)))
            assert await client.command(mavlink.MAV_CMD_GET_HOME_POSITION) in (0, 4)
            assert server.garbage > 0

    asyncio.run(talk())


def test_client_that_hangs_up_is_forgotten_and_can_come_back() -> None:
    async def talk() -> None:
        async with serving("tcp:127.0.0.1:0") as server:
            for _ in range(3):
                async with connected(server.url) as client:
                    await client.until("HEARTBEAT")
            vehicle = server.vehicle
            assert isinstance(vehicle, SimulatedAutopilot)
            for _ in range(100):
                if not vehicle._streams.channels:
                    break
                await asyncio.sleep(0.01)
            assert not vehicle._streams.channels

    asyncio.run(talk())


SCENARIO = """
schema = 1
name = "two"
[mission]
horizon_s = 10.0
[[uav]]
id = "a"
position_m = [0.0, 0.0]
speed_m_s = 4.0
[[uav]]
id = "b"
position_m = [5.0, 0.0]
speed_m_s = 5.0
[[task]]
id = "t1"
position_m = [1.0, 10.0]
value = 5.0
"""
Started = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Started]:
    """Start `swarm autopilot` on a small scenario; no process outlives the test."""
    scenario = tmp_path / "two.toml"
    scenario.write_text(SCENARIO)
    processes: list[subprocess.Popen[str]] = []

    def begin(*options: str) -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        words = ["autopilot", str(scenario), *options]
        process = Swarm(words, stdin=pipe, stdout=pipe, stderr=pipe)
        processes.append(process)
        return process

    yield begin
    for process in processes:
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def ready_lines(process: subprocess.Popen[str], count: int) -> list[dict[str, Any]]:
    assert process.stdout is not None
    return [json.loads(process.stdout.readline()) for _ in range(count)]


@pytest.mark.parametrize(
    ("end", "status"),
    [
        (lambda process: process.send_signal(signal.SIGTERM), 0),
        (lambda process: process.send_signal(signal.SIGINT), 130),
        (lambda process: process.stdin.close(), 0),
    ],
)
def test_command_says_where_its_vehicles_are_and_ends_when_told(
    start: Started, end: Callable[[Any], None], status: int
) -> None:
    process = start("--speedup", "10", "--lifeline")
    lines = ready_lines(process, 2)
    assert [(line["uav"], line["system_id"]) for line in lines] == [("a", 1), ("b", 2)]

    async def hear(url: str, system_id: int) -> None:
        async with connected(url) as client:
            assert (await client.until("HEARTBEAT")).get_srcSystem() == system_id

    for line in lines:
        asyncio.run(hear(line["url"], line["system_id"]))
    end(process)
    assert process.wait(TIMEOUT_S) == status


def test_command_serves_one_uav_under_another_system_id(start: Started) -> None:
    process = start("--uav", "b", "--listen", "udpin:127.0.0.1:0", "--system-id", "42", "--json")
    [line] = ready_lines(process, 1)

    assert (line["uav"], line["system_id"]) == ("b", 42)
    assert line["url"].startswith("udpout:127.0.0.1:")
    process.terminate()
    assert process.wait(TIMEOUT_S) == 0
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.read() == process.stderr.read() == ""


def test_command_gives_its_vehicles_the_faults_and_physics_asked_for(start: Started) -> None:
    process = start(
        *("--fault", "a:wrong-id@0", "--fault", "b:silent@0+2", "--acceleration-m-s2", "2"),
        *("--wind-m-s", "1,-1", "--gust-m-s", "2", "--seed", "3", "--endurance-s", "600"),
        *("--battery-failsafe", "--position-failsafe-s", "5"),
    )
    first, second = ready_lines(process, 2)

    async def id_heard(url: str) -> int:
        async with connected(url) as client:
            heartbeat = await client.until("HEARTBEAT")
            return int(heartbeat.get_srcSystem())

    assert asyncio.run(id_heard(first["url"])) == 2
    assert asyncio.run(id_heard(second["url"])) == 2


@pytest.mark.parametrize(("flavour", "autopilot"), [("ardupilot", 3), ("px4", 12)])
def test_command_flies_the_firmware_it_is_told(
    start: Started, flavour: str, autopilot: int
) -> None:
    process = start("--uav", "a", "--flavour", flavour)
    [line] = ready_lines(process, 1)

    async def hear() -> None:
        async with connected(line["url"]) as client:
            assert (await client.until("HEARTBEAT")).autopilot == autopilot

    asyncio.run(hear())


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--uav", "c"], "--uav: no UAV 'c'; the scenario has a, b"),
        (["--listen", "tcp:x"], "--listen: 'tcp:x' is no endpoint; write tcp:HOST:PORT"),
        (["--listen", "tcp:192.0.2.1:5760"], "--listen: tcp:192.0.2.1:5760: cannot be opened"),
        (["--listen", "tcp:127.0.0.1:65535"], "--listen: tcp:127.0.0.1:65536: cannot be opened"),
        (
            ["--fault", "a:explode@3"],
            "--fault: a:explode@3: no kind of fault 'explode'; write",
        ),
        (["--fault", "c:stuck@3"], "--fault: c:stuck@3: no UAV 'c'; the scenario has a, b"),
        (["--wind-m-s", "6,0"], "--wind-m-s: a: 6 m/s is too much for a vehicle of 6 m/s"),
        (["--wind-m-s", "west"], "--wind-m-s: west: no wind; write EAST,NORTH"),
        (["--endurance-s", "inf"], "--endurance-s: inf is no number to go by"),
    ],
)
def test_wrong_usage_is_one_clear_line(start: Started, options: list[str], complaint: str) -> None:
    process = start(*options)
    _, errors = process.communicate(timeout=TIMEOUT_S)

    assert process.returncode == 2
    [line] = errors.splitlines()
    assert line.startswith(complaint)
