"""Tells a service manager that this process is ready, alive and leaving, as sd_notify(3) has it.

systemd names a datagram socket in NOTIFY_SOCKET and, where the unit asks for a watchdog, its
interval in WATCHDOG_USEC. Signs of life come from the event loop: one that hangs sends none, and
the process is killed and started anew. Where no manager listens, nothing happens. Leaves
out: what the manager does about it (the units beside `swarm.install`).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import AsyncIterator, Mapping
from typing import Final

__all__ = ["SERVICE", "Service"]

SEND_LIMIT_S: Final = 0.05
"""How long a manager that does not read may hold the event loop up."""
UNWATCHED_S: Final = 20.0
"""Stands in for the watchdog's interval where the unit has none."""


class Service:
    """What this process tells whoever supervises it.

    Args:
        environment: of the process; read when something is told.
        pid: of the process: what was meant for its parent is none of its business.
    """

    def __init__(self, environment: Mapping[str, str], pid: int | None = None) -> None:
        self._environment = environment
        self._pid = pid
        self._ready = self._leaving = False
        self._status = ""

    @property
    def supervised(self) -> bool:
        """Whether a manager listens, which may start this process again when it ends."""
        return bool(self._environment.get("NOTIFY_SOCKET"))

    def waiting(self, status: str) -> None:
        """The process is not ready yet, for this reason."""
        self._say(status)

    def ready(self, status: str) -> None:
        """The process is up, and does what it is for."""
        self._ready = True
        self._say(status, "READY=1")

    def stopping(self) -> None:
        """The process was told to leave, and is about to."""
        self._leaving = True
        self._say("leaving", "STOPPING=1")

    @contextlib.asynccontextmanager
    async def beating(self) -> AsyncIterator[None]:
        """Show, while the context lasts, that the event loop turns."""
        if not self.supervised:
            yield
            return
        beats = asyncio.get_running_loop().create_task(self._beat())
        try:
            yield
        finally:
            beats.cancel()
            await asyncio.gather(beats, return_exceptions=True)

    async def _beat(self) -> None:
        watched_s = self._watched_s()
        interval_s = UNWATCHED_S if watched_s is None else watched_s
        while True:
            lines = [] if watched_s is None else ["WATCHDOG=1"]
            if self._ready:
                lines.append("READY=1")  # again, should the manager have missed it
            elif not self._leaving:
                # The watchdog sleeps until then: without a sign for so long the start has failed.
                lines.append(f"EXTEND_TIMEOUT_USEC={round(interval_s * 1e6)}")
            self._send(*lines)
            await asyncio.sleep(interval_s / 2)

    def _watched_s(self) -> float | None:
        """The watchdog's interval; None when this process is not watched."""
        meant = self._environment.get("WATCHDOG_PID")
        own = str(os.getpid() if self._pid is None else self._pid)
        text = self._environment.get("WATCHDOG_USEC", "")
        if (meant is not None and meant != own) or not (text.isascii() and text.isdigit()):
            return None
        return int(text) / 1e6 or None

    def _say(self, status: str, *lines: str) -> None:
        if lines or status != self._status:
            self._status = status
            self._send(f"STATUS={' '.join(status.split())}", *lines)

    def _send(self, *lines: str) -> None:
        address = self._environment.get("NOTIFY_SOCKET")
        if not address or not lines:
            return
        if address.startswith("@"):
            address = "\0" + address[1:]  # of the abstract namespace
        # A manager that cannot be told is no reason to fail.
        with (
            contextlib.suppress(OSError),
            socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as channel,
        ):
            channel.settimeout(SEND_LIMIT_S)
            channel.sendto("\n".join(lines).encode(), address)


SERVICE: Final = Service(os.environ)
"""That of this process."""
