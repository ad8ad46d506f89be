"""Virtual time: a queue of things to do, and the clock that follows it.

Leaves out: what is done (sim.world).
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable

__all__ = ["EventQueue"]


class EventQueue:
    """Runs callbacks in order of their time; equal times in order of scheduling."""

    def __init__(self) -> None:
        self._heap: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._now_s = 0.0
        self._stopped = False

    def now_s(self) -> float:
        """Virtual time [s]."""
        return self._now_s

    def at(self, time_s: float, callback: Callable[[], None]) -> None:
        """Run ``callback`` at ``time_s``; what is already past runs next, now."""
        when_s = max(time_s, self._now_s)
        heapq.heappush(self._heap, (when_s, next(self._numbers), callback))

    def after(self, delay_s: float, callback: Callable[[], None]) -> None:
        """Run ``callback`` in ``delay_s``."""
        self.at(self._now_s + delay_s, callback)

    def stop(self) -> None:
        """Run nothing more."""
        self._stopped = True

    def run(self, until_s: float) -> bool:
        """Run until nothing is left (True), or time would pass ``until_s`` or `stop` (False)."""
        heap = self._heap
        while heap:
            if self._stopped or heap[0][0] > until_s:
                return False
            self._now_s, _, callback = heapq.heappop(heap)
            callback()
        return True
