"""Run one daemon until it is done or told to stop, and end the process for good.

Leaves out: starting and watching other processes (sim.launch).
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
import threading
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import Future
from typing import Any, NoReturn, TypeVar

from swarm.lifeline import parent_gone
from swarm.watchdog import SERVICE

__all__ = [
    "EXIT_INTERRUPTED",
    "EXIT_STOPPED",
    "StopRequest",
    "call_in_background",
    "leave",
    "run_until_stopped",
    "stop_requests",
]

T = TypeVar("T")

EXIT_STOPPED = 0
"""Status after SIGTERM or the end of the lifeline: the daemon did what it was told."""
EXIT_INTERRUPTED = 130
"""Status after SIGINT, as shells have it: 128 + 2."""

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
            SERVICE.stopping()

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
    event loop turns (swarm.watchdog).
    """
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
        async with SERVICE.beating():
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

    Args:
        work: the daemon; returns its exit status and cleans up in ``finally``.
        lifeline: also stop when standard input ends.

    Returns:
        What ``work`` returned if it ended by itself, else `EXIT_STOPPED` or
        `EXIT_INTERRUPTED`. Use it as ``raise typer.Exit(asyncio.run(run_until_stopped(...)))``.

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
