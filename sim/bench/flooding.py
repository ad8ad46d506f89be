"""A hostile agent with valid keys beside a run: it floods from the mission's beginning to its end.

Leaves out: what it says (sim.chaos.torrent).
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

from sim.launch.process import Child, Setting
from sim.launch.run import Run
from swarm.wire.messages import EpochPhase

__all__ = ["HOSTILE", "Poured", "flooded"]

HOSTILE = "hostile"
"""Its name among the UAVs of the keys; the mission has no such UAV."""
_LIMIT_S = 86_400.0
"""A run gives up long before that."""


@dataclass(slots=True)
class Poured:
    """What a flood came to, as far as has been told."""

    sent: int = 0
    """Messages it has handed over, whether its router still hears it or has shut it out."""
    wall_s: float = 0.0
    """In so many seconds."""

    @property
    def rate_hz(self) -> float:
        """Messages a second."""
        return self.sent / self.wall_s if self.wall_s > 0.0 else 0.0

    def hear(self, _name: str, line: str) -> None:
        """Take note of a line of the hostile process."""
        with contextlib.suppress(ValueError, KeyError, TypeError):
            said = json.loads(line)
            self.sent, self.wall_s = int(said["sent"]), float(said["wall_s"])


@contextlib.asynccontextmanager
async def flooded(run: Run, rate_hz: float) -> AsyncIterator[Poured]:
    """Flood ``run``, which has routers and keys for `HOSTILE`, as long as its mission lasts.

    Args:
        run: just started.
        rate_hz: messages a second that the hostile process tries to send.
    """
    poured = Poured()
    pouring = asyncio.get_running_loop().create_task(_pour(run, rate_hz, poured))
    try:
        yield poured
    finally:
        pouring.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await pouring


async def _pour(run: Run, rate_hz: float, poured: Poured) -> None:
    keys, layout = run.launch.options.keys, run.launch.layout
    if keys is None or not layout.routers:
        raise ValueError("only a run with keys and routers is flooded")
    command = [
        *(sys.executable, "-m", "sim.chaos.torrent"),
        *("--keys", str(keys.of_seat(HOSTILE)), "--mission", run.launch.mission.name),
        *("--connect", layout.endpoint(layout.routers[0]), "--rate-hz", repr(rate_hz)),
        *(word for uav in run.launch.mission.uavs for word in ("--other", uav.id)),
    ]
    child = Child(HOSTILE, command, setting=Setting(Path.cwd(), {}), on_log=poured.hear)
    observer, clock = run.observer, run.clock
    await run.until(
        lambda: observer.mission_s(clock.now_s()) is not None, limit_s=_LIMIT_S, what="the start"
    )
    try:
        await child.start()
        await run.until(
            lambda: observer.phase is EpochPhase.ENDED, limit_s=_LIMIT_S, what="the end"
        )
    finally:
        await child.stop()
