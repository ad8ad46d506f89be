"""Links that break, fall silent or cannot be opened at first, over real sockets."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from agent.core.interface import GoTo, HandedOver, VehicleReady, VehicleReport
from agent.links.link import ByteLink, open_link
from agent.links.mavlink_vehicle import MavlinkVehicle
from agent.vehicle.config import BridgeConfig, TcpAddress, UdpOutAddress, parse_link
from swarm.runtime.clock import ScaledClock
from tests.sitl.test_bridge_link import (
    PATIENCE_S,
    Listener,
    ServedCopter,
    Server,
    free_port,
    in_loop,
    opened,
    until,
)
from tests.support.bridge_flight import ORIGIN, START

pytestmark = pytest.mark.sitl


@asynccontextmanager
async def impatient(url: str, listener: Listener, silence_s: float) -> AsyncIterator[ByteLink]:
    link = open_link(parse_link(url), listener, silence_s=silence_s)
    link.start()
    try:
        yield link
    finally:
        await link.close()


async def up(listener: Listener, times: int = 1) -> None:
    await until(lambda: listener.ups == times)


async def down(listener: Listener, times: int) -> None:
    await until(lambda: listener.downs == times)


async def heard(listener: Listener, size: int) -> None:
    await until(lambda: len(listener.data) == size)


@in_loop
async def test_server_that_accepts_and_says_nothing_is_dialled_again() -> None:
    server, listener = Server(), Listener()
    port = await server.listen()
    async with impatient(f"tcp:127.0.0.1:{port}", listener, 0.1):
        await until(lambda: listener.ups >= 3)
    assert listener.downs == listener.ups
    await server.stop()


@in_loop
async def test_server_that_speaks_now_and_then_is_left_alone() -> None:
    server, listener = Server(), Listener()
    port = await server.listen()
    async with impatient(f"tcp:127.0.0.1:{port}", listener, 0.5):
        await until(lambda: server.writer is not None)
        assert server.writer is not None
        for _ in range(20):
            server.writer.write(b"heartbeat")
            await asyncio.sleep(0.05)
        assert (listener.ups, listener.downs) == (1, 0)
    await server.stop()


@in_loop
async def test_vehicle_behind_a_half_open_connection_is_handed_over_and_heard_again() -> None:
    speedup = 20.0
    clock = ScaledClock(speedup)
    served = ServedCopter(clock)
    port = await served.listen()
    reports: list[VehicleReport] = []
    config = BridgeConfig(1, ORIGIN, silence_timeout_s=10.0, position_rate_hz=20.0)
    vehicle = MavlinkVehicle(config, f"tcp:127.0.0.1:{port}", clock, reports.append)
    try:
        await vehicle.start()
        vehicle.order(START)
        await until(lambda: VehicleReady() in reports)
        vehicle.order(GoTo(1, (5.0, 500.0, 10.0)))
        served.cut_silently()
        silent = HandedOver("nothing heard for 10 s")
        await until(lambda: silent in reports)
        before = len(reports)
        await until(lambda: len(reports) > before)
    finally:
        await vehicle.close()
        await served.stop()
    assert [r for r in reports if isinstance(r, HandedOver)] == [silent]


class Stalled:
    """A server that accepts connections and reads nothing of them until it is told to."""

    def __init__(self) -> None:
        self._listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        self._listening.bind(("127.0.0.1", 0))
        self._listening.listen()
        self._listening.setblocking(False)
        self.url = f"tcp:127.0.0.1:{self._listening.getsockname()[1]}"
        self.accepted: list[socket.socket] = []

    async def accept(self) -> None:
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(PATIENCE_S):
            self.accepted.append((await loop.sock_accept(self._listening))[0])

    async def read_first(self) -> bytes:
        """All that the first connection ever delivers."""
        data = b""
        async with asyncio.timeout(PATIENCE_S):
            with contextlib.suppress(ConnectionError):
                while more := await asyncio.get_running_loop().sock_recv(self.accepted[0], 65_536):
                    data += more
        return data

    def stop(self) -> None:
        for each in (self._listening, *self.accepted):
            each.close()


FILLER, OLD_ORDER = bytes(32_768), b"old order"


@in_loop
async def test_what_a_stalled_connection_holds_is_not_delivered_once_it_is_given_up() -> None:
    server, listener = Stalled(), Listener()
    async with opened(server.url, listener) as link:
        await server.accept()
        await up(listener)
        for word in (FILLER, OLD_ORDER):
            link.send(word)
        link.discard()
        await up(listener, 2)
        assert listener.downs == 1
        assert link.counts.unsent == 0
        assert OLD_ORDER not in await server.read_first()
    server.stop()


@in_loop
async def test_what_a_stalled_connection_holds_is_not_delivered_once_it_is_closed() -> None:
    server, listener = Stalled(), Listener()
    async with opened(server.url, listener) as link:
        await server.accept()
        await up(listener)
        for word in (FILLER, OLD_ORDER):
            link.send(word)
    assert OLD_ORDER not in await server.read_first()
    server.stop()


@in_loop
async def test_link_that_holds_nothing_stays_open_when_it_is_to_discard() -> None:
    server, listener = Server(), Listener()
    port = await server.listen()
    async with opened(f"tcp:127.0.0.1:{port}", listener) as link:
        await up(listener)
        link.send(b"order")
        await until(lambda: server.data == b"order")
        link.discard()
        await asyncio.sleep(0.05)
        assert (listener.ups, listener.downs) == (1, 0)
    await server.stop()


@in_loop
async def test_what_a_serial_port_has_not_sent_is_discarded() -> None:
    far, near = pty.openpty()
    os.set_blocking(far, False)
    listener = Listener()
    async with opened(f"serial:{os.ttyname(near)}:57600", listener) as link:
        await up(listener)
        sent = 0
        while link.counts.unsent == 0:
            link.send(bytes(512))
            sent += 512
        link.discard()
        assert (listener.ups, listener.downs) == (1, 0)
        received = 0
        with contextlib.suppress(BlockingIOError):
            while data := os.read(far, 65_536):
                received += len(data)
        assert received < sent - 512
    os.close(far)
    os.close(near)


@in_loop
async def test_silent_connection_is_given_up_with_the_vehicle() -> None:
    speedup = 20.0
    clock = ScaledClock(speedup)
    served = ServedCopter(clock)
    port = await served.listen()
    reports: list[VehicleReport] = []
    config = BridgeConfig(1, ORIGIN, silence_timeout_s=60.0, position_rate_hz=20.0)
    vehicle = MavlinkVehicle(config, f"tcp:127.0.0.1:{port}", clock, reports.append)
    try:
        await vehicle.start()
        vehicle.order(START)
        await until(lambda: VehicleReady() in reports)
        served.cut_silently()
        await until(lambda: any(isinstance(each, HandedOver) for each in reports))
        handed_over_s = clock.now_s()
        await until(lambda: served.connected)
        assert clock.now_s() - handed_over_s < 0.5 * config.silence_timeout_s
    finally:
        await vehicle.close()
        await served.stop()


class Names:
    """A resolver in whose place tests can say which names there are."""

    def __init__(self, loop: asyncio.AbstractEventLoop, name: str) -> None:
        self.asked = 0
        self.known = False
        self._name = name
        self._ask = loop.getaddrinfo

    async def getaddrinfo(self, host: str, port: int, **how: Any) -> Any:
        assert host == self._name
        self.asked += 1
        if not self.known:
            raise socket.gaierror(socket.EAI_NONAME, "Name or service not known")
        return await self._ask("127.0.0.1", port, **how)

    async def asked_more_than(self, times: int) -> None:
        await until(lambda: self.asked > times)


@in_loop
async def test_host_that_becomes_known_later_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = asyncio.get_running_loop()
    names = Names(loop, "drone.local")
    monkeypatch.setattr(loop, "getaddrinfo", names.getaddrinfo)
    server = Server()
    port = await server.listen()
    for address in (TcpAddress("drone.local", port), UdpOutAddress("drone.local", port)):
        listener = Listener()
        names.known = False
        before = names.asked
        async with opened(str(address), listener):
            await names.asked_more_than(before)
            assert listener.ups == 0
            names.known = True
            await up(listener)
    await server.stop()


@in_loop
async def test_links_speak_ip_version_6() -> None:
    listener, server = Listener(), await asyncio.start_server(_echo, "::1", 0)
    port = server.sockets[0].getsockname()[1]
    async with opened(f"tcp:[::1]:{port}", listener) as link:
        await until(lambda: listener.ups == 1)
        link.send(b"ping")
        await until(lambda: listener.data == b"ping")
    server.close()
    await server.wait_closed()

    here, there, port = Listener(), Listener(), free_port(socket.SOCK_DGRAM)
    async with opened(f"udpin:[::1]:{port}", here) as waiting:
        await until(lambda: here.ups == 1)
        async with opened(f"udpout:[::1]:{port}", there) as calling:
            await until(lambda: there.ups == 1)
            calling.send(b"ping")
            await until(lambda: here.data == b"ping")
            waiting.answer(here.sources[0])
            waiting.send(b"pong")
            await until(lambda: there.data == b"pong")


async def _echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(100):
        writer.write(data)
    writer.close()


@in_loop
async def test_port_that_another_process_holds_is_waited_for() -> None:
    port, listener = free_port(socket.SOCK_DGRAM), Listener()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("127.0.0.1", port))
        async with opened(f"udpin:127.0.0.1:{port}", listener):
            await asyncio.sleep(0.15)
            assert listener.ups == 0
            holder.close()
            await until(lambda: listener.ups == 1)


@in_loop
async def test_serial_device_that_is_plugged_in_again_is_opened_again(tmp_path: Path) -> None:
    listener, device = Listener(), tmp_path / "ttyACM0"
    async with opened(f"serial:{device}:115200", listener) as link:
        for plugged in (1, 2):
            far, near = pty.openpty()
            device.symlink_to(os.ttyname(near))
            os.close(near)
            await up(listener, plugged)
            link.send(b"ping")
            assert os.read(far, 100) == b"ping"
            os.close(far)
            device.unlink()
            await down(listener, plugged)


@in_loop
async def test_why_a_link_does_not_open_is_told_once(capsys: pytest.CaptureFixture[str]) -> None:
    port, listener = free_port(socket.SOCK_STREAM), Listener()
    said: list[str] = []

    def told() -> list[str]:
        said.extend(capsys.readouterr().err.splitlines())
        return [line for line in said if "does not open" in line]

    async with opened(f"tcp:127.0.0.1:{port}", listener):
        await until(lambda: bool(told()))
        await asyncio.sleep(0.5)  # in which it is tried again
    lines = told()
    assert len(lines) == 1
    assert "Connect call failed" in lines[0]
