"""Asking before deciding: whether a process knows all that it could know by asking.

Leaves out: when questions are due (swarm.asking), and what the answers are good for.
"""

from __future__ import annotations

import math

from swarm.asking import Asking

__all__ = ["Inquiry"]


class Inquiry:
    """The questions of one process.

    Args:
        gap_s: shortest interval between two of them [s].
        every_s: longest interval; answers may get lost, and with them the only reason to ask.
    """

    def __init__(self, gap_s: float, every_s: float = math.inf) -> None:
        self.unsure = True
        """Whether something may have happened that nobody has told yet: decide nothing."""
        self.ever = False
        """Whether any question has been answered, be it by nobody."""
        self._asking = Asking(gap_s)
        self._every_s = every_s
        self._again_at_s = math.inf
        self._open = 0
        """Questions without an answer."""
        self._outdated = 0
        """Those of them that were asked before the last doubt."""

    def want(self, now_s: float, *, before_deciding: bool = False) -> None:
        """There is a reason to ask.

        Args:
            now_s: now.
            before_deciding: what is known may be old.
        """
        if before_deciding:
            self.unsure, self._outdated = True, self._open
        self._asking.want(now_s)

    def due(self, now_s: float) -> bool:
        """Whether to ask now; True once for each question."""
        if self._again_at_s <= now_s:
            self._asking.want(now_s)
        due = self._asking.due(now_s)
        if due:
            self._open += 1
            self._again_at_s = now_s + self._every_s
        return due

    def answered(self) -> None:
        """A question has been answered by everyone who could."""
        self.ever = True
        if self._open > self._outdated == 0:
            self.unsure = False
        self._open, self._outdated = max(0, self._open - 1), max(0, self._outdated - 1)

    def next_deadline_s(self) -> float | None:
        """When `due` will next be true."""
        wanted_s = self._asking.next_deadline_s()
        if wanted_s is not None:
            return wanted_s
        return None if math.isinf(self._again_at_s) else self._again_at_s
