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

    def now_s(self) -> float:
        """Virtual time [s]."""
        return self._now_s

    def at(self, time_s: float, callback: Callable[[], None]) -> None:
        """Run ``callback`` at ``time_s``; what is already past runs next, now."""
        when_s = max(time_s, self._now_s)
        heapq.heappush(self._heap, (when_s, next(self._numbers), callback))

    def run(self, until_s: float) -> bool:
        """Run until nothing is left (True) or time would pass ``until_s`` (False)."""
        while self._heap:
            if self._heap[0][0] > until_s:
                return False
            self._now_s, _, callback = heapq.heappop(self._heap)
            callback()
        return True
