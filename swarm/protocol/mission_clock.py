"""What time it is in the mission, by what others have said of it.

A word under way only makes mission time seem earlier than it is, so of the last few words the
one that makes it latest is nearest the truth: the clock filter of NTP (RFC 5905, section 10),
with one way to go instead of two.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from swarm.protocol.messages import Body, MissionConfig, MissionPhase, PlanEpoch

WORDS_KEPT: Final = 8
"""As many as NTP keeps. A word from the future is forgotten after that many others."""
NOISE_S: Final = 1e-3
"""The clock is not moved for less: that much is rounding, or of no consequence."""
SKEW_S: Final = 1.0
"""The clock is put back only by more than the skew that takes no task from anybody: words that
were all a little late must not move it to and fro."""


class MissionClock:
    """The mission time of one process, which moves with its own clock."""

    def __init__(self) -> None:
        self._ahead_s: float | None = None
        """Mission time less time of the own clock; None while mission time is not known."""
        self._words_s: deque[float] = deque(maxlen=WORDS_KEPT)
        """The same, by the last words heard."""

    @property
    def is_set(self) -> bool:
        """Whether mission time is known."""
        return self._ahead_s is not None

    def mission_s(self, now_s: float) -> float | None:
        """Mission time [s]; None while it is not known."""
        return None if self._ahead_s is None else now_s + self._ahead_s

    def hear(self, mission_s: float, now_s: float) -> float:
        """Somebody said at some time before now that it was ``mission_s``.

        It is put forward at once, and back only when none of the last words bears it out.

        Returns:
            By how much the clock was put forward [s], negative if back; 0 when it was set.
        """
        self._words_s.append(mission_s - now_s)
        latest_s = max(self._words_s)
        if self._ahead_s is None:
            self._ahead_s = latest_s
            return 0.0
        change_s = latest_s - self._ahead_s
        unconfirmed = len(self._words_s) == WORDS_KEPT and change_s < -SKEW_S
        if not (change_s > NOISE_S or unconfirmed):
            return 0.0
        self._ahead_s = latest_s
        return change_s

    def heed(self, news: Body, brief: MissionConfig | None, epoch: PlanEpoch | None) -> None:
        """Forget what was heard when ``news`` briefs for another flight.

        But for the last word, if a mission runs: who is in charge of the new flight has said so
        before (`Replica.is_premature`), and with it what time it is. ``brief`` is the one before,
        ``epoch`` the one in force.
        """
        if not isinstance(news, MissionConfig) or brief is None or news.run == brief.run:
            return
        runs = epoch is not None and epoch.phase is MissionPhase.RUNNING
        last_s = self._words_s[-1] if runs and self._words_s else None
        self._words_s.clear()
        self._ahead_s = last_s
        if last_s is not None:
            self._words_s.append(last_s)
