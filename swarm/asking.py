"""When a process asks everyone for what they know: soon after it wants to, and not too often.

Leaves out: why it wants to (the cores) and how it asks (swarm.shell).
"""

from __future__ import annotations

import math

__all__ = ["Asking"]


class Asking:
    """Gathers wishes to ask into questions at least ``gap_s`` apart.

    Args:
        gap_s: shortest interval between two questions [s].
    """

    def __init__(self, gap_s: float) -> None:
        self._gap_s = gap_s
        self._free_at_s = -math.inf
        self._ask_at_s: float | None = None

    def want(self, now_s: float) -> None:
        """There is a reason to ask; several before the next question are one."""
        if self._ask_at_s is None:
            self._ask_at_s = max(now_s, self._free_at_s)

    def due(self, now_s: float) -> bool:
        """Whether to ask now; True once for each question."""
        if self._ask_at_s is None or now_s < self._ask_at_s:
            return False
        self._ask_at_s = None
        self._free_at_s = now_s + self._gap_s
        return True

    def next_deadline_s(self) -> float | None:
        """When `due` will next be true; None while there is nothing to ask."""
        return self._ask_at_s
