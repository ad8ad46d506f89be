"""What a process tells its service manager, heard at a real datagram socket."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from swarm.runtime.process import ServiceNotifier

PID = 4321
INTERVAL_S = 0.02


class Manager:
    """Hears what its services say."""

    def __init__(self, address: str) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(address.replace("@", "\0", 1))
        self._socket.setblocking(False)
        self.environment = {
            "NOTIFY_SOCKET": address,
            "WATCHDOG_PID": str(PID),
            "WATCHDOG_USEC": str(round(INTERVAL_S * 1e6)),
        }

    def close(self) -> None:
        self._socket.close()

    def heard(self) -> list[str]:
        """Every message since the last call."""
        messages = []
        while True:
            try:
                messages.append(self._socket.recv(4096).decode())
            except BlockingIOError:
                return messages

    async def next(self) -> str:
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(10.0):
            return (await loop.sock_recv(self._socket, 4096)).decode()


@pytest.fixture
def manager(tmp_path: Path) -> Iterator[Manager]:
    listening = Manager(str(tmp_path / "notify"))
    yield listening
    listening.close()


def test_ready_waiting_and_leaving_are_told(manager: Manager) -> None:
    service = ServiceNotifier(manager.environment, PID)
    service.waiting("no bus yet:\nrefused")
    service.ready("on the bus")
    service.stopping()

    assert manager.heard() == [
        "STATUS=no bus yet: refused",
        "STATUS=on the bus\nREADY=1",
        "STATUS=leaving\nSTOPPING=1",
    ]


def test_the_same_reason_to_wait_is_told_once(manager: Manager) -> None:
    service = ServiceNotifier(manager.environment, PID)
    for _ in range(3):
        service.waiting("no bus yet")

    assert manager.heard() == ["STATUS=no bus yet"]


def test_event_loop_that_turns_shows_it_and_prolongs_the_start_until_ready(
    manager: Manager,
) -> None:
    async def life() -> list[str]:
        service = ServiceNotifier(manager.environment, PID)
        async with service.beating():
            heard = [await manager.next(), await manager.next()]
            service.ready("up")
            heard += [await manager.next(), await manager.next()]
            service.stopping()
            heard += [await manager.next()]
        assert asyncio.all_tasks() == {asyncio.current_task()}  # nothing beats any more
        return heard

    starting = f"WATCHDOG=1\nEXTEND_TIMEOUT_USEC={round(INTERVAL_S * 1e6)}"
    assert asyncio.run(life()) == [
        starting,
        starting,
        "STATUS=up\nREADY=1",
        "WATCHDOG=1\nREADY=1",
        "STATUS=leaving\nSTOPPING=1",
    ]


def test_watchdog_of_the_parent_gets_no_sign_of_life(manager: Manager) -> None:
    async def life() -> str:
        async with ServiceNotifier(manager.environment, PID + 1).beating():
            return await manager.next()

    assert asyncio.run(life()) == "EXTEND_TIMEOUT_USEC=20000000"


def test_abstract_addresses_are_reached() -> None:
    manager = Manager(f"@peckorder-test-{id(object())}")
    try:
        ServiceNotifier(manager.environment, PID).ready("up")
        assert manager.heard() == ["STATUS=up\nREADY=1"]
    finally:
        manager.close()


@pytest.mark.parametrize("address", ["/nowhere/at/all", "x" * 300])
def test_manager_that_cannot_be_told_is_no_failure(address: str) -> None:
    ServiceNotifier({"NOTIFY_SOCKET": address}).ready("up")


def test_manager_that_does_not_read_holds_nothing_up(manager: Manager) -> None:
    service = ServiceNotifier(manager.environment, PID)
    queue = int(Path("/proc/sys/net/unix/max_dgram_qlen").read_text())
    for number in range(queue + 3):
        service.waiting(str(number))

    assert len(manager.heard()) <= queue + 1


def test_without_a_manager_nothing_is_said() -> None:
    async def life() -> bool:
        service = ServiceNotifier({})
        async with service.beating():
            service.ready("up")
            service.stopping()
        return service.supervised

    assert not asyncio.run(life())
