"""How fast a mission's time runs against an onlooker's clock, seen from what UAVs tell.

A mission may be flown at a speed-up that whoever joins it has not been told. Leaves out:
what time it is for those who know it (coordinator.observer).
"""

from __future__ import annotations

__all__ = ["Tempo"]

BASELINE_S = 0.8
"""Two words of one UAV that far apart tell the pace [s of the onlooker's clock]."""
TOLERANCE = 1.25
"""Within this factor of 1 the two clocks run alike: what differs is the network's delay."""


class Tempo:
    """The pace of a mission, as far as its UAVs have told by when they say what time it is."""

    def __init__(self) -> None:
        self.pace = 1.0
        """Mission seconds per second of the onlooker's clock."""
        self._first: dict[str, tuple[float, float]] = {}
        """Of each UAV: when it first told the mission time, and which it told."""

    def told(self, uav: str, now_s: float, mission_s: float) -> float:
        """The pace, now that ``uav`` says that it is ``mission_s``.

        Args:
            uav: who says so.
            now_s: time of the onlooker's clock [s].
            mission_s: mission time [s].
        """
        first_s, first_mission_s = self._first.setdefault(uav, (now_s, mission_s))
        if mission_s < first_mission_s:  # another flight
            self._first[uav] = now_s, mission_s
        elif now_s - first_s >= BASELINE_S:
            pace = (mission_s - first_mission_s) / (now_s - first_s)
            alike = 1.0 / TOLERANCE <= pace <= TOLERANCE
            self.pace = 1.0 if alike or pace <= 0.0 else pace
        return self.pace
