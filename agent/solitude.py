"""How long an agent has been without the bus, and when that is too long.

Only the own link counts: whom else it reaches is another matter (agent.peers). Leaves
out: going home for it (agent.core).
"""

from __future__ import annotations

__all__ = ["Solitude"]


class Solitude:
    """The own link to the bus, as far as its loss is a reason to go home.

    Args:
        patience_s: how long it may be down; None for as long as it likes.
    """

    def __init__(self, patience_s: float | None) -> None:
        self.patience_s = patience_s
        self._too_long_at_s: float | None = None

    def link(self, up: bool, now_s: float) -> None:
        """The own link came up or went down."""
        if up or self.patience_s is None:
            self._too_long_at_s = None
        elif self._too_long_at_s is None:
            self._too_long_at_s = now_s + self.patience_s

    def too_long(self, now_s: float) -> bool:
        """Whether it has been down for that long; told once."""
        if self._too_long_at_s is None or now_s < self._too_long_at_s:
            return False
        self._too_long_at_s = None
        return True

    def next_deadline_s(self) -> float | None:
        """When it will have been down for too long."""
        return self._too_long_at_s
