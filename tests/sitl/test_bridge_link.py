"""Links over real sockets and a pseudo-terminal, and a vehicle flown through one."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import os
import pty
import socket
from collections.abc import AsyncIterator, Callable, Coroutine, Hashable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import ParamSpec

import pytest
from structlog.testing import capture_logs

from agent.core.interface import (
    Arrived,
    FlightLimits,
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
from agent.links.link import ByteLink, open_link
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.vehicle.config import BridgeConfig, parse_link
from swarm.runtime.clock import ScaledClock
from tests.support.bridge_flight import ORIGIN, START
from tests.support.fake_copter import INTERVAL, FakeCopter

pytestmark = pytest.mark.sitl

PATIENCE_S = 10.0
P = ParamSpec("P")


class Listener:
    """Remembers what a link reports."""

    def __init__(self) -> None:
        self.ups = 0
        self.downs = 0
        self.data = b""
        self.sources: list[Hashable] = []

    def link_up(self) -> None:
        self.ups += 1

    def link_down(self) -> None:
        self.downs += 1

    def received(self, data: bytes, source: Hashable | None = None) -> None:
        self.data += data
        if source is not None:
            self.sources.append(source)


def in_loop(test: Callable[P, Coroutine[None, None, None]]) -> Callable[P, None]:
    """Run a test in a loop of its own."""

    @functools.wraps(test)
    def run(*args: P.args, **kwargs: P.kwargs) -> None:
        asyncio.run(test(*args, **kwargs))

    return run


async def until(condition: Callable[[], bool]) -> None:
    """Wait for ``condition``, with a deadline."""
    for _ in range(round(PATIENCE_S / 0.005)):
        if condition():
            return
        await asyncio.sleep(0.005)
    raise AssertionError(f"not within {PATIENCE_S} s")


@asynccontextmanager
async def opened(url: str, listener: Listener) -> AsyncIterator[ByteLink]:
    link = open_link(parse_link(url), listener)
    link.start()
    try:
        yield link
    finally:
        await link.close()
        await link.close()


def free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Server:
    """A TCP server with one connection at a time."""

    def __init__(self) -> None:
        self.data = b""
        self.writer: asyncio.StreamWriter | None = None
        self._server: asyncio.Server | None = None

    async def listen(self, port: int = 0) -> int:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", port)
        bound: int = self._server.sockets[0].getsockname()[1]
        return bound

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writer = writer
        try:
            while data := await reader.read(4096):
                self.data += data
        except ConnectionError:
            pass
        finally:
            writer.close()

    def hang_up(self) -> None:
        """Reset the connection, as a killed process does."""
        assert self.writer is not None
        self.writer.transport.abort()
        self.writer = None

    async def stop(self) -> None:
        assert self._server is not None
        self._server.close()
        if self.writer is not None:
            self.writer.close()
        await self._server.wait_closed()


@in_loop
async def test_tcp_link_carries_bytes_both_ways_and_survives_a_reset() -> None:
    server, listener = Server(), Listener()
    port = await server.listen()
    async with opened(f"tcp:127.0.0.1:{port}", listener) as link:
        await until(lambda: server.writer is not None and listener.ups == 1)
        link.send(b"ping")
        await until(lambda: server.data == b"ping")
        assert server.writer is not None
        server.writer.write(b"pong")
        await until(lambda: listener.data == b"pong")

        server.hang_up()
        await until(lambda: listener.downs == 1)
        link.send(b"lost")
        await until(lambda: listener.ups == 2 and server.writer is not None)
        link.send(b"again")
        await until(lambda: server.data == b"pingagain")
        assert link.counts.unsent_bytes == 4
    assert listener.downs == 2
    await server.stop()


@in_loop
async def test_tcp_link_waits_for_a_server_that_starts_later() -> None:
    server, listener = Server(), Listener()
    port = free_port(socket.SOCK_STREAM)
    async with opened(f"tcp:127.0.0.1:{port}", listener):
        await asyncio.sleep(0.15)
        assert listener.ups == 0
        await server.listen(port)
        await until(lambda: listener.ups == 1)
    await server.stop()


class Deaf(asyncio.Protocol):
    """A peer that never reads."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        transport.pause_reading()
        self.transport = transport


@in_loop
async def test_peer_that_does_not_read_costs_bytes_but_never_blocks() -> None:
    deaf, listener = Deaf(), Listener()
    loop = asyncio.get_running_loop()
    server = await loop.create_server(lambda: deaf, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    async with opened(f"tcp:127.0.0.1:{port}", listener) as link:
        await until(lambda: listener.ups == 1)
        for _ in range(4000):
            link.send(bytes(4096))
        assert link.counts.unsent_bytes > 0
    deaf.transport.abort()
    server.close()
    await server.wait_closed()


@in_loop
async def test_udp_links_speak_to_each_other() -> None:
    port = free_port(socket.SOCK_DGRAM)
    here, there = Listener(), Listener()
    async with opened(f"udpin:127.0.0.1:{port}", here) as waiting:
        await until(lambda: here.ups == 1)
        waiting.send(b"nobody is there yet")
        assert waiting.counts.unsent_bytes == 19
        async with opened(f"udpout:127.0.0.1:{port}", there) as calling:
            await until(lambda: there.ups == 1)
            calling.send(b"ping")
            await until(lambda: here.data == b"ping")
            waiting.answer(here.sources[0])
            waiting.send(b"pong")
            await until(lambda: there.data == b"pong")


@in_loop
async def test_listening_link_answers_whom_it_is_told_to() -> None:
    port = free_port(socket.SOCK_DGRAM)
    listener = Listener()
    async with opened(f"udpin:127.0.0.1:{port}", listener) as waiting:
        await until(lambda: listener.ups == 1)
        first, second = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
        with first, second:
            for peer in (first, second):
                peer.setblocking(False)
                peer.connect(("127.0.0.1", port))
            first.send(b"mine")
            await until(lambda: listener.data == b"mine")
            waiting.send(b"nobody has been named yet")
            waiting.answer(first.getsockname())
            second.send(b"stranger")
            await until(lambda: listener.data == b"minestranger")
            waiting.send(b"answer")
            loop = asyncio.get_running_loop()
            assert await asyncio.wait_for(loop.sock_recv(first, 100), PATIENCE_S) == b"answer"
            assert listener.sources == [first.getsockname(), second.getsockname()]
            assert waiting.counts.unsent_bytes == 25


@in_loop
async def test_a_stranger_at_the_port_keeps_no_vehicle_from_its_agent() -> None:
    port, reports = free_port(socket.SOCK_DGRAM), list[VehicleReport]()
    config = BridgeConfig(1, ORIGIN, position_rate_hz=50.0)
    vehicle = MavlinkVehicle(config, f"udpin:127.0.0.1:{port}", ScaledClock(1.0), reports.append)
    await vehicle.start()
    copter = FakeCopter(ORIGIN)
    loop = asyncio.get_running_loop()
    stranger, own = (socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2))
    with stranger, own:
        for each in (stranger, own):
            each.setblocking(False)
            each.connect(("127.0.0.1", port))
        await until(lambda: vehicle.bridge.contact.link_up)
        stranger.send(b"the first")

        async def fly() -> None:
            while True:
                stranger.send(b"x")
                for data in copter.advance(loop.time()):
                    own.send(data)
                with contextlib.suppress(BlockingIOError):
                    for data in copter.receive(own.recv(4096), loop.time()):
                        own.send(data)
                await asyncio.sleep(0.01)

        flight = loop.create_task(fly())
        try:
            vehicle.order(START)
            await until(lambda: bool(copter.commands(INTERVAL)))
            await until(lambda: any(isinstance(each, Telemetry) for each in reports))
        finally:
            flight.cancel()
            await vehicle.close()
        with pytest.raises(BlockingIOError):
            stranger.recv(4096)
        assert vehicle.dropped["from strangers"] > 0


@in_loop
async def test_udp_peer_that_is_not_there_yet_is_no_error() -> None:
    port = free_port(socket.SOCK_DGRAM)
    listener, late = Listener(), Listener()
    async with opened(f"udpout:127.0.0.1:{port}", listener) as link:
        await until(lambda: listener.ups == 1)
        for _ in range(5):
            link.send(b"anybody?")
            await asyncio.sleep(0.02)
        async with opened(f"udpin:127.0.0.1:{port}", late):
            await until(lambda: late.ups == 1)
            link.send(b"here")
            await until(lambda: late.data == b"here")
        assert listener.downs == 0


@in_loop
async def test_serial_link_carries_raw_bytes_and_notices_an_unplugged_device() -> None:
    far, near = pty.openpty()
    listener = Listener()
    async with opened(f"serial:{os.ttyname(near)}:115200", listener) as link:
        os.close(near)
        await until(lambda: listener.ups == 1)
        every_byte = bytes(range(256))
        link.send(every_byte)
        assert os.read(far, 4096) == every_byte
        os.write(far, every_byte)
        await until(lambda: listener.data == every_byte)
        os.close(far)
        await until(lambda: listener.downs == 1)
        link.send(b"gone")
        assert link.counts.unsent_bytes == 4


@in_loop
async def test_serial_device_that_is_missing_is_waited_for() -> None:
    listener = Listener()
    async with opened("serial:/dev/does-not-exist:57600", listener):
        await asyncio.sleep(0.2)
    assert (listener.ups, listener.downs) == (0, 0)


@in_loop
async def test_any_baud_rate_that_the_driver_takes_will_do() -> None:
    far, near = pty.openpty()
    listener = Listener()
    async with opened(f"serial:{os.ttyname(near)}:420000", listener) as link:  # as of ExpressLRS
        os.close(near)
        await until(lambda: listener.ups == 1)
        link.send(b"told")
        assert os.read(far, 4096) == b"told"
    os.close(far)


@in_loop
async def test_a_port_is_opened_by_one_link_only() -> None:
    far, near = pty.openpty()
    first, second = Listener(), Listener()
    async with opened(f"serial:{os.ttyname(near)}:115200", first):
        await until(lambda: first.ups == 1)
        async with opened(f"serial:{os.ttyname(near)}:115200", second):
            await asyncio.sleep(0.2)
            assert second.ups == 0
    os.close(near)
    os.close(far)


@in_loop
async def test_what_is_no_serial_port_is_named(tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("")
    listener = Listener()
    with capture_logs() as logs:
        async with opened(f"serial:{tmp_path / 'notes'}:57600", listener):
            await until(lambda: any("notes" in str(line) for line in logs))
    assert listener.ups == 0


class ServedCopter(asyncio.Protocol):
    """The fake vehicle behind a TCP port, on the same clock as its bridge."""

    def __init__(self, clock: ScaledClock) -> None:
        self.copter = FakeCopter(ORIGIN)
        self.copter.now_s = clock.now_s()
        self.copter.power_on(clock.now_s())
        self._clock = clock
        self._transport: asyncio.Transport | None = None
        self._server: asyncio.Server | None = None
        self._flying: asyncio.Task[None] | None = None

    async def listen(self) -> int:
        loop = asyncio.get_running_loop()
        self._flying = loop.create_task(self._fly())
        self._server = await loop.create_server(lambda: self, "127.0.0.1", 0)
        port: int = self._server.sockets[0].getsockname()[1]
        return port

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        self._say(self.copter.receive(data, self._clock.now_s()))

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None

    @property
    def connected(self) -> bool:
        """Whether there is a connection that is served."""
        return self._transport is not None

    def cut_silently(self) -> None:
        """Say nothing more on this connection, which stays open; only a new one is served."""
        self._transport = None

    def _say(self, frames: list[bytes]) -> None:
        if self._transport is not None:
            self._transport.writelines(frames)

    async def _fly(self) -> None:
        while True:
            self._say(self.copter.advance(self._clock.now_s()))
            await asyncio.sleep(0.002)

    async def stop(self) -> None:
        assert self._server is not None
        assert self._flying is not None
        self._flying.cancel()
        self._server.close()
        await until(lambda: self._transport is None)
        await self._server.wait_closed()


@in_loop
async def test_vehicle_is_flown_through_a_socket_from_preparation_to_landing() -> None:
    speedup = 20.0
    clock = ScaledClock(speedup)
    served = ServedCopter(clock)
    port = await served.listen()
    reports: list[VehicleReport] = []

    def on_report(report: VehicleReport) -> None:
        """Orders given from inside a report are carried out in order."""
        reports.append(report)
        match report:
            case VehicleReady():
                vehicle.order(GoTo(1, (5.0, 20.0, 10.0)))
            case Arrived(1):
                vehicle.order(GoTo(2, (25.0, 20.0, 10.0)))
            case Arrived(2):
                vehicle.order(Return("done"))
            case _:
                pass

    config = BridgeConfig(1, ORIGIN, position_rate_hz=50.0).for_speedup(speedup)
    vehicle = MavlinkVehicle(config, f"tcp:127.0.0.1:{port}", clock, on_report)
    try:
        await vehicle.start()
        vehicle.order(START)
        await until(lambda: Home() in reports)
    finally:
        await vehicle.close()
        await served.stop()
    others = [r for r in reports if not isinstance(r, Telemetry | NotReady | FlightLimits)]
    flown = [VehicleReady(), Arrived(1), Arrived(2), ReturnBegun(), Home()]
    assert others == [MotorsRun(ours=True), *flown]
    assert any(isinstance(report, FlightLimits) for report in reports)
    assert not served.copter.armed
