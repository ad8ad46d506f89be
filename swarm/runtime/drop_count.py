"""Counts with what a codec drops what was dropped before anything was read of it, or afterwards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

from swarm.bus.admission import TOO_MANY, AdmissionControl
from swarm.bus.port import Inbox
from swarm.protocol.registers import NO_ROOM

if TYPE_CHECKING:
    from structlog.typing import FilteringBoundLogger


class DropCount:
    """Of one process.

    Args:
        inbox: drops what is too much.
        admission: refuses what need not be read.
        left_out: how many registers the core has had no room for so far.
        dropped: by reason, where all of it is counted.
        log: is told once that others say more than there is room for.
    """

    def __init__(
        self,
        inbox: Inbox,
        admission: AdmissionControl,
        left_out: Callable[[], int],
        dropped: Counter[str],
        log: FilteringBoundLogger,
    ) -> None:
        self._inbox = inbox
        self._admission = admission
        self._left_out = left_out
        self._dropped = dropped
        self._log = log
        self._counted: Counter[str] = Counter()
        """What is counted there already."""

    def take(self) -> None:
        """Count what has been dropped since."""
        gone, refused, left_out = self._inbox.dropped, self._admission.refused, self._left_out()
        if gone or refused or left_out:
            counts = Counter(dict(refused))  # copied at once: others may count on meanwhile
            counts[TOO_MANY] += gone
            counts[NO_ROOM] = max(left_out, self._counted[NO_ROOM])
            news = counts - self._counted
            if news[NO_ROOM] and not self._counted[NO_ROOM]:
                self._log.warning("others say more than there is room for", left_out=left_out)
            self._dropped.update(news)
            self._counted = counts
