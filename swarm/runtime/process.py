"""Run one daemon until it is done or told to stop, and end the process for good.

It is told by a signal, or by the end of standard input when its parent is gone (``--lifeline``).
Where a service manager listens, it is told that the process is ready, alive and leaving, as
sd_notify(3) has it.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import sys
import threading
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from concurrent.futures import Future
from typing import Any, Final, NoReturn, TypeVar

from swarm.runtime import garbage
from swarm.runtime.errors import EXIT_INTERRUPTED

STDIN_FD = 0
CHUNK_BYTES = 4096


async def parent_gone(fd: int = STDIN_FD) -> None:
    """Return when ``fd``, standard input unless told otherwise, is at its end.

    What arrives before the end is read and thrown away. No thread is used, so an
    unfinished wait never delays the exit of the process. The descriptor stays in
    blocking mode: the parent may share it. A file that cannot be waited for, such
    as ``/dev/null``, a regular file or a closed descriptor, has no writer whose
    end could be noticed: it counts as ended.
    """
    loop = asyncio.get_running_loop()
    ended = loop.create_future()

    def on_readable() -> None:
        try:
            chunk = os.read(fd, CHUNK_BYTES)
        except (BlockingIOError, InterruptedError):
            return  # somebody else made it non-blocking and was faster
        except OSError:
            chunk = b""  # hung up terminal, closed descriptor
        if not chunk:
            loop.remove_reader(fd)
            if not ended.done():
                ended.set_result(None)

    try:
        loop.add_reader(fd, on_readable)
    except (OSError, ValueError):
        return
    try:
        await ended
    finally:
        loop.remove_reader(fd)


SEND_LIMIT_S: Final = 0.05
"""How long a manager that does not read may hold the event loop up."""
UNWATCHED_S: Final = 20.0
"""Stands in for the watchdog's interval where the unit has none."""


class ServiceNotifier:
    """What this process tells whoever supervises it, by its environment.

    What that says of a process with another ``pid``, such as the parent, is passed over.
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


SERVICE_NOTIFIER: Final = ServiceNotifier(os.environ)
"""That of this process."""


T = TypeVar("T")

EXIT_STOPPED = 0
"""Status after SIGTERM or the end of the lifeline: the daemon did what it was told."""

INSIST_AFTER_S = 1.0
"""A second SIGINT kills from this long after the first: sooner it is likely the same Ctrl-C,
passed on by the parent as well as by the terminal."""


class StopRequest:
    """Whether, and how, this process was told to stop."""

    def __init__(self) -> None:
        self._told = asyncio.Event()
        self.exit_status: int | None = None
        """Status to exit with; `None` while nobody has asked to stop."""

    def request(self, exit_status: int) -> None:
        """Ask to stop; only the first request counts."""
        if self.exit_status is None:
            self.exit_status = exit_status
            self._told.set()
            SERVICE_NOTIFIER.stopping()

    async def wait(self) -> int:
        """Return the exit status as soon as somebody asks to stop."""
        await self._told.wait()
        assert self.exit_status is not None  # noqa: S101 - set together with the event
        return self.exit_status


@contextlib.asynccontextmanager
async def stop_requests(*, lifeline: bool) -> AsyncIterator[StopRequest]:
    """Turn SIGINT, SIGTERM and, if asked, the end of standard input into a `StopRequest`.

    For daemons that have something to finish first, such as bringing a vehicle
    home. Use from the main thread. The first SIGINT asks; another one, a second or
    more later, kills. A service manager, if there is one, is shown meanwhile that the
    event loop turns. What has been imported by then stays.
    """
    garbage.end_start()
    loop = asyncio.get_running_loop()
    stop = StopRequest()
    sigint_before = signal.getsignal(signal.SIGINT)

    def on_sigint() -> None:
        stop.request(EXIT_INTERRUPTED)
        loop.call_later(INSIST_AFTER_S, insist)

    def insist() -> None:
        loop.remove_signal_handler(signal.SIGINT)
        signal.signal(signal.SIGINT, signal.SIG_DFL)

    async def watch_parent() -> None:
        await parent_gone()
        stop.request(EXIT_STOPPED)

    loop.add_signal_handler(signal.SIGINT, on_sigint)
    loop.add_signal_handler(signal.SIGTERM, stop.request, EXIT_STOPPED)
    watch = asyncio.create_task(watch_parent()) if lifeline else None
    try:
        async with SERVICE_NOTIFIER.beating():
            yield stop
    finally:
        if watch is not None:
            watch.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await watch
        loop.remove_signal_handler(signal.SIGTERM)
        loop.remove_signal_handler(signal.SIGINT)
        signal.signal(signal.SIGINT, sigint_before)


async def run_until_stopped(work: Coroutine[Any, Any, int], *, lifeline: bool = False) -> int:
    """Run ``work`` to its end, or cancel it on SIGINT, SIGTERM or the parent's end.

    ``work`` cleans up in ``finally``. With ``lifeline`` the end of standard input counts as the
    parent's end.

    Returns:
        What ``work`` returned if it ended by itself, else `EXIT_STOPPED` or `EXIT_INTERRUPTED`.

    Raises:
        Exception: whatever ``work`` raised, also while cleaning up.
    """
    async with stop_requests(lifeline=lifeline) as stop:
        running = asyncio.ensure_future(work)
        told = asyncio.ensure_future(stop.wait())
        try:
            await asyncio.wait({running, told}, return_when=asyncio.FIRST_COMPLETED)
            if running.done():
                return running.result()
            running.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await running
            return told.result()
        finally:
            for task in (running, told):
                task.cancel()
            await asyncio.gather(running, told, return_exceptions=True)


_background: set[threading.Thread] = set()


def call_in_background(call: Callable[[], T], name: str) -> Future[T]:
    """Make a call that may hang, on a thread of its own for which the exit does not wait.

    Whoever starts such calls ends the process by `leave`.
    """
    outcome: Future[T] = Future()
    outcome.set_running_or_notify_cancel()

    def run() -> None:
        try:
            result = call()
        except BaseException as fault:  # noqa: BLE001 - whoever waits for the outcome raises it
            outcome.set_exception(fault)
        else:
            outcome.set_result(result)
        finally:
            _background.discard(threading.current_thread())

    thread = threading.Thread(target=run, name=name, daemon=True)
    _background.add(thread)
    thread.start()
    return outcome


def leave(exit_status: int) -> NoReturn:
    """End the process; with `call_in_background` calls still hanging, without tidying up.

    A thread that comes back from native code while the interpreter takes itself
    apart aborts the process, and its exit status with it (measured: status 134).
    """
    if any(thread.is_alive() for thread in list(_background)):
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(exit_status)
    sys.exit(exit_status)
