"""Whether this process itself was held up: stopped, starved, or its machine asleep.

A process that comes to its own deadline much too late has not looked for as long:
what others did meanwhile is still unread, so their silence proves nothing, and its own
knowledge is old. Leaves out: what a core makes of that.
"""

from __future__ import annotations

__all__ = ["Pulse"]


class Pulse:
    """Compares when a step comes with when it was to come at the latest.

    Args:
        limit_s: a deadline missed by more than this is no mere delay [s].
    """

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._deadline_s: float | None = None

    def promise(self, deadline_s: float | None) -> None:
        """After a step: the next one comes by then; None if there is no need for one."""
        self._deadline_s = deadline_s

    def late(self, now_s: float) -> bool:
        """At the start of a step: whether the promised deadline is long past."""
        return self._deadline_s is not None and now_s - self._deadline_s > self._limit_s
