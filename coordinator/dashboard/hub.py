"""Looks twice a second, and lets everyone who is connected know."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from coordinator.dashboard.baseline import Baseline
from coordinator.dashboard.feed import Feed
from coordinator.planner.options import after_time
from swarm.runtime.clock import SystemClock
from swarm.runtime.log import get_logger
from swarm.runtime.process import call_in_background

LOOK_S = 0.5
"""Wall time between two looks."""
SOONEST_S = 0.05
"""Wall time between two looks at least, whoever asks for one."""
BOUND_S = 3.0
"""Wall time after which the search for a bound ends."""


@dataclass(slots=True)
class Hub:
    """One feed and all who follow it; `run` keeps it going."""

    feed: Feed
    clients: int = 0
    """Connections that follow the feed."""
    ended: str | None = None
    """Why nothing more will come; None while something may."""
    deserted: asyncio.Event = field(default_factory=asyncio.Event)
    """Set while nobody follows the feed."""
    _turn: asyncio.Event = field(default_factory=asyncio.Event)
    """Set at the next look, or the end, and replaced."""
    _wanted: asyncio.Event = field(default_factory=asyncio.Event)
    """Somebody wants a look soon."""
    _bounding: asyncio.Task[None] | None = None

    def __post_init__(self) -> None:
        self.deserted.set()

    async def run(self) -> None:
        """Look again and again, until cancelled."""
        try:
            while self.ended is None:
                self.feed.look()
                self._look_for_a_bound()
                self._let_know()
                await asyncio.sleep(SOONEST_S)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(LOOK_S - SOONEST_S):
                        await self._wanted.wait()
                self._wanted.clear()
        finally:
            if self._bounding is not None:
                self._bounding.cancel()

    @contextlib.contextmanager
    def following(self) -> Iterator[None]:
        """Somebody follows the feed while the context lasts."""
        self.clients += 1
        self.deserted.clear()
        try:
            yield
        finally:
            self.clients -= 1
            if self.clients == 0:
                self.deserted.set()

    def nudge(self) -> None:
        """Look soon: something has just happened."""
        self._wanted.set()

    def end(self, reason: str) -> None:
        """Let everyone know that nothing more will come."""
        self.ended = reason
        self._let_know()

    async def after(self, seq: int | None) -> None:
        """Wait for a look after number ``seq``, or for the end."""
        while self.ended is None and (self.feed.seq == 0 or self.feed.seq == seq):
            await self._turn.wait()

    def _let_know(self) -> None:
        turn, self._turn = self._turn, asyncio.Event()
        turn.set()

    def _look_for_a_bound(self) -> None:
        measure = self.feed.measure
        if measure is None or measure.sought or self._bounding is not None:
            return
        measure.sought = True
        self._bounding = asyncio.get_running_loop().create_task(self._bound(measure))

    async def _bound(self, measure: Baseline) -> None:
        stop = after_time(SystemClock(), BOUND_S)
        # On a thread that does not hold the process up when it is told to end.
        work = call_in_background(lambda: measure.work_out(stop), "bound")
        try:
            bound = await asyncio.wrap_future(work)
            measure.bound = bound if math.isfinite(bound) else None
        except Exception as fault:  # noqa: BLE001 - the page does without
            problem = f"{type(fault).__name__}: {fault}"
            get_logger("dashboard").warning("no upper bound", problem=problem)
        self._bounding = None
