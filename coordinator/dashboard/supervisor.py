"""Keeps a `swarm dashboard` running as a child, for a process that has more important things to do.

Whatever becomes of the child, nothing of it reaches its parent: it is started again, ever later,
and however the parent ends, the child sees the end of its standard input and leaves.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import tempfile
from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager
from pathlib import Path

from coordinator.dashboard.access import OPTION, ServeAddress
from swarm.bus.connection import ConnectionOptions
from swarm.runtime.errors import Fault, InputError
from swarm.runtime.log import get_logger

FIRST_PAUSE_S = 1.0
"""Wall time before the child is started again; doubles from one end to the next."""
LONGEST_PAUSE_S = 30.0
SOUND_S = 60.0
"""A child that has lived this long was sound: the pauses begin anew."""
LEAVE_S = 3.0
"""Wall time the child may take to leave; then it is killed."""


def supervised_dashboard(
    place: ServeAddress | None,
    mission: str,
    seat: ConnectionOptions,
    *,
    speedup: float,
) -> AbstractAsyncContextManager[None]:
    """A dashboard of ``mission`` while the context lasts, on the bus of its parent.

    ``seat`` is the parent's: of a coordinator's keys the page can only look on. There is none
    where ``place`` is None.

    Raises:
        InputError: the bus is a mesh, in which it would need an endpoint of its own.
    """
    if place is None:
        return contextlib.nullcontext()
    if seat.bus == "mesh":
        problem = "in a mesh a dashboard needs an endpoint of its own"
        remedy = "start it by: swarm dashboard --bus mesh --listen ENDPOINT --connect ENDPOINT ..."
        raise InputError(Fault(OPTION, "", problem, remedy))
    arguments = ["--mission", mission, "--speedup", repr(speedup), *seat.arguments()]
    return _shown(place, arguments)


@contextlib.asynccontextmanager
async def _shown(place: ServeAddress, arguments: Sequence[str]) -> AsyncIterator[None]:
    with tempfile.TemporaryDirectory(prefix="peckorder-", ignore_cleanup_errors=True) as folder:
        async with supervised([*place.arguments(Path(folder)), *arguments]):
            yield


@contextlib.asynccontextmanager
async def supervised(arguments: Sequence[str]) -> AsyncIterator[None]:
    """Keep a dashboard with these arguments while the context lasts; it is gone afterwards."""
    keeper = asyncio.get_running_loop().create_task(_supervise(arguments))
    try:
        yield
    finally:
        keeper.cancel()
        await asyncio.gather(keeper, return_exceptions=True)


async def _supervise(arguments: Sequence[str]) -> None:
    log, loop = get_logger("dashboard"), asyncio.get_running_loop()
    pause_s = FIRST_PAUSE_S
    while True:
        since_s = loop.time()
        try:
            ended = f"ended with exit status {await _run(arguments)}"
        except OSError as error:
            ended = f"could not be started: {error.strerror or error}"
        pause_s = FIRST_PAUSE_S if loop.time() - since_s >= SOUND_S else pause_s
        log.warning("the dashboard is started again", it=ended, in_s=pause_s)
        await asyncio.sleep(pause_s)
        pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)


async def _run(arguments: Sequence[str]) -> int:
    """One life of the child; its exit status."""
    child = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "swarm", "dashboard", *arguments, "--lifeline"),
        stdin=asyncio.subprocess.PIPE,
        # A service manager supervises the parent alone.
        env={name: value for name, value in os.environ.items() if name != "NOTIFY_SOCKET"},
        stdout=asyncio.subprocess.DEVNULL,  # that is for the parent's results
        start_new_session=True,
    )
    try:
        return await child.wait()
    finally:
        if child.stdin is not None:
            child.stdin.close()
        if child.returncode is None:
            with contextlib.suppress(ProcessLookupError):
                child.terminate()
            try:
                async with asyncio.timeout(LEAVE_S):
                    await child.wait()
            except TimeoutError:
                child.kill()
                await child.wait()
