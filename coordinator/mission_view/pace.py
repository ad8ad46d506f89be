"""Mission time for an observer whose clock need not run as the mission's does."""

from __future__ import annotations

from swarm.protocol.messages import Body, MissionConfig, PlanEpoch
from swarm.protocol.mission_clock import MissionClock

BASELINE_S = 0.8
"""Two words of one UAV that far apart tell the pace [s of the observer's clock]."""
TOLERANCE = 1.25
"""Within this factor of 1 the two clocks run alike: what differs is the network's delay."""


class SpeedupEstimator:
    """The pace of a mission, as far as its UAVs have told by when they say what time it is."""

    def __init__(self) -> None:
        self.pace = 1.0
        """Mission seconds per second of the observer's clock."""
        self._first: dict[str, tuple[float, float]] = {}
        """Of each UAV: when it first told the mission time, and which it told."""

    def told(self, uav: str, now_s: float, mission_s: float) -> float:
        """The pace, now that ``uav`` says that it is ``mission_s``."""
        first_s, first_mission_s = self._first.setdefault(uav, (now_s, mission_s))
        if mission_s < first_mission_s:  # another flight
            self._first[uav] = now_s, mission_s
        elif now_s - first_s >= BASELINE_S:
            pace = (mission_s - first_mission_s) / (now_s - first_s)
            alike = 1.0 / TOLERANCE <= pace <= TOLERANCE
            self.pace = 1.0 if alike or pace <= 0.0 else pace
        return self.pace


class PacedClock:
    """Mission time against the observer's clock, which the mission's may outrun."""

    def __init__(self) -> None:
        self.pace = 1.0
        """Mission seconds per second of the observer's clock."""
        self._clock = MissionClock()
        """Against ``now_s`` times the pace."""

    @property
    def is_set(self) -> bool:
        """Whether mission time is known."""
        return self._clock.is_set

    def mission_s(self, now_s: float) -> float | None:
        """Mission time [s]; None before the start."""
        return self._clock.mission_s(now_s * self.pace)

    def hear(self, mission_s: float, now_s: float) -> None:
        """Somebody said at some time before ``now_s`` that it was ``mission_s``."""
        self._clock.hear(mission_s, now_s * self.pace)

    def heed(self, news: Body, brief: MissionConfig | None, epoch: PlanEpoch | None) -> None:
        """Forget what was heard when ``news`` briefs for another flight; see `MissionClock`."""
        self._clock.heed(news, brief, epoch)

    def set(self, mission_s: float, now_s: float, pace: float) -> None:
        """It is ``mission_s``, and goes on at ``pace``."""
        self.pace, self._clock = pace, MissionClock()
        self.hear(mission_s, now_s)
