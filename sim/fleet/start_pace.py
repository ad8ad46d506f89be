"""How fast the agents of one run are started: only so many at once that each keeps its links.

To join costs an agent a quarter of a second of processor time. If a hundred do so at once, each has
a fiftieth of a processor, says nothing to the others for longer than they wait for it, is taken for
lost, and asked for.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Sequence
from typing import Final, Protocol

from sim.fleet.child_process import ChildFailedError

AT_ONCE_PER_CORE: Final = 4
"""Processes whose agents join at the same time, for each processor; more would gain nothing."""
PATIENCE_S: Final = 3.0
"""Wall time after which the next one is started although an agent has not joined."""


class Joining(Protocol):
    """A process that has been started."""

    async def ready(self, count: int = 1) -> Sequence[object]:
        """The first ``count`` lines that it says."""
        ...


class StartPace:
    """Starts processes, each as soon as few enough are still joining.

    Args:
        at_once: how many may join at the same time.
        patience_s: how long each of their agents is waited for [wall s].
    """

    def __init__(self, at_once: int, patience_s: float = PATIENCE_S) -> None:
        self._room = asyncio.Semaphore(at_once)
        self._patience_s = patience_s
        self._joining: set[asyncio.Task[None]] = set()

    async def room(self) -> None:
        """Wait until one more may start; follow it by `started`."""
        await self._room.acquire()

    def started(self, child: Joining, agents: int = 1) -> None:
        """``child`` has been started, and says a line as each of its ``agents`` has joined."""
        task = asyncio.get_running_loop().create_task(self._join(child, agents))
        self._joining.add(task)
        task.add_done_callback(self._left)

    def close(self) -> None:
        """Wait for nobody any more."""
        for task in self._joining:
            task.cancel()

    async def _join(self, child: Joining, agents: int) -> None:
        # How it ended is told by whoever watches all processes.
        with contextlib.suppress(TimeoutError, ChildFailedError):
            async with asyncio.timeout(self._patience_s * agents):
                await child.ready(agents)

    def _left(self, task: asyncio.Task[None]) -> None:
        self._joining.discard(task)
        self._room.release()
