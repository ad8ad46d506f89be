"""Looks on at a mission from before it is there until everybody has left it.

Leaves out: how what is known is shown (coordinator.view.live, coordinator.status.cli).
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from typing import Protocol

from coordinator.desertion import deserted
from coordinator.joining import onlooking
from coordinator.observer import Observer
from coordinator.status.onlooker import Onlooker, only_mission
from swarm.bus.config import BusConfig
from swarm.bus.port import Bus
from swarm.bus.zenoh_bus import open_zenoh_bus
from swarm.clock import ScaledClock
from swarm.config import Timing
from swarm.errors import SwarmError

__all__ = ["Shows", "watch"]

FRAME_S = 0.2
"""Wall time between two pictures."""
FOREVER_S = 1e9
"""As long as it takes."""


class Shows(Protocol):
    """Who shows what is known; called in the loop's thread."""

    def wait(self, text: str) -> None:
        """There is nothing to show yet, and ``text`` says what is waited for."""
        ...

    def update(self, observer: Observer, now_s: float) -> None:
        """Show what ``observer`` knows at ``now_s``."""
        ...


async def watch(
    mission: str | None,
    config: BusConfig,
    timing: Timing,
    clock: ScaledClock,
    shows: Shows,
    *,
    patience_s: float | None,
) -> None:
    """Show a mission until it is over and nobody is there any more.

    Args:
        mission: its name; None for that of the keys, or the only one there is.
        config: how to reach the others.
        timing: timers, in the seconds of ``clock``.
        clock: of the onlooker.
        shows: what is known, a few times a second.
        patience_s: how long to wait for the bus, and then for the mission [wall s]; None
            for as long as it takes.

    Raises:
        BusError: the bus cannot be reached, or not in that time.
        SwarmError: there is no mission in that time.
        InputError: none is named, and there are several.
    """
    limit_s = FOREVER_S if patience_s is None else patience_s
    shows.wait(f"waiting for {config.place}")
    bus = await open_zenoh_bus(config, timeout_s=limit_s)
    try:
        shows.wait(f"waiting for {'a mission' if mission is None else f'mission {mission}'}")
        name = mission or config.mission or await only_mission(bus, limit_s)
        await _look_on(name, bus, timing, clock, shows, limit_s)
    finally:
        bus.close()


async def _look_on(
    mission: str, bus: Bus, timing: Timing, clock: ScaledClock, shows: Shows, limit_s: float
) -> None:
    onlooker = Onlooker(mission, timing, None)
    observer = onlooker.observer
    shell = onlooking(onlooker, bus, clock, mission, "status")
    looking = asyncio.get_running_loop().create_task(shell.run())
    give_up_at_s = clock.now_s() + limit_s * clock.speedup
    deserted_at_s = math.inf
    try:
        while True:
            now_s = clock.now_s()
            if onlooker.known:
                shows.update(observer, now_s)
            elif now_s >= give_up_at_s:
                raise SwarmError(onlooker.lack)
            else:
                shows.wait(f"waiting for mission {mission}: {onlooker.lack.partition(': ')[2]}")
            # Tokens may come a little later than what others know.
            left = deserted(observer)
            deserted_at_s = min(deserted_at_s, now_s) if left else math.inf
            if now_s - deserted_at_s >= timing.relink_grace_s:
                return
            if await _ends(looking, FRAME_S):
                return
    finally:
        looking.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await looking


async def _ends(looking: asyncio.Task[int], within_s: float) -> bool:
    """Whether the shell ends in that time, which it does only by a fault; raises that."""
    await asyncio.wait({looking}, timeout=within_s)
    return looking.done() and looking.result() is not None
