"""Whether what this agent knows is up to date, and when it asks everyone for more.

Its knowledge is old at the start, when its link is back and after it was itself held up.
Until everyone has been asked since, and has had the time to answer, it goes on with the
task it has and decides nothing new. Leaves out: what the answers say (agent.hearing).
"""

from __future__ import annotations

from swarm.asking import Asking
from swarm.config import Timing
from swarm.deadline import earliest
from swarm.events import Ask

__all__ = ["Learning"]


class Learning:
    """The questions of one agent."""

    def __init__(self, timing: Timing) -> None:
        self.ever = False
        """Whether any question has been answered, be it by nobody."""
        self.current = False
        """Whether one has that was asked since the last doubt."""
        self._asking = Asking(timing.ask_gap_s)
        self._ask_s = timing.ask_s
        self._again_at_s: float | None = None
        self._open = 0
        """Questions without an answer."""
        self._outdated = 0
        """Those of them that were asked before the last doubt."""

    def want(self, now_s: float) -> None:
        """Others may have news."""
        self._asking.want(now_s)

    def doubt(self, now_s: float) -> None:
        """What is known is old: nothing is decided before everyone has been asked."""
        self.current, self._outdated = False, self._open
        self._asking.want(now_s)

    def take(self, *, enough: bool) -> None:
        """Answers have come.

        Args:
            enough: whether they are up to date whenever they were asked for.
        """
        self.ever = True
        self.current |= enough or self._open > self._outdated == 0
        self._open, self._outdated = max(0, self._open - 1), max(0, self._outdated - 1)

    def questions(self, now_s: float, *, lacking: bool) -> list[Ask]:
        """The question that is due, if any.

        Args:
            now_s: now.
            lacking: whether something is missing that only others can tell; like a doubt,
                that is asked again and again.
        """
        if self.current and not lacking:
            self._again_at_s = None
        elif self._again_at_s is not None and self._again_at_s <= now_s:
            self._asking.want(now_s)
            self._again_at_s = None  # until that question has been asked
        if not self._asking.due(now_s):
            return []
        self._open += 1
        if lacking or not self.current:
            self._again_at_s = now_s + self._ask_s
        return [Ask()]

    def next_deadline_s(self) -> float | None:
        """When `questions` will next have one."""
        return earliest(self._asking.next_deadline_s(), self._again_at_s)
