"""The fence that a run draws around its mission.

Leaves out: what a UAV does at its fence (agent.mavlink.guards).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coordinator.briefing import FlightLayers
from swarm.model import Mission

__all__ = ["Fence", "fence_around"]

_RADIUS_FACTOR = 1.2
_RADIUS_MARGIN_M = 200.0
_HEIGHT_MARGIN_M = 50.0
_MOST_RADIUS_M = 1e6
_MOST_HEIGHT_M = 1e5
"""What `swarm agent` takes."""


@dataclass(frozen=True, slots=True)
class Fence:
    """Of the UAVs of a run, around the mission's origin."""

    radius_m: float
    height_m: float
    """Above the origin, and below it."""

    def to_agent(self) -> list[str]:
        """Arguments of an agent."""
        return ["--fence-radius-m", repr(self.radius_m), "--fence-height-m", repr(self.height_m)]


def fence_around(
    mission: Mission, radius_m: float | None = None, height_m: float | None = None
) -> Fence:
    """A fence with room for every start and every task, pop-ups included.

    Args:
        mission: the scenario, flown in the height layers of a coordinator.
        radius_m: where it is to be instead; None: a fifth and 200 m beyond the farthest place.
        height_m: the same; None: 50 m beyond the highest layer above the highest place, or
            beyond the lowest place.
    """
    places = [uav.position_enu_m for uav in mission.uavs]
    places += [task.position_enu_m for task in mission.tasks]
    farthest_m = max((math.hypot(east_m, north_m) for east_m, north_m, _ in places), default=0.0)
    heights_m = [up_m for _, _, up_m in places] or [0.0]
    layer_m = FlightLayers().layer_m(max(0, len(mission.uavs) - 1))
    extent_m = max(max(heights_m) + layer_m, -min(heights_m))
    return Fence(
        radius_m or min(_RADIUS_FACTOR * farthest_m + _RADIUS_MARGIN_M, _MOST_RADIUS_M),
        height_m or min(extent_m + _HEIGHT_MARGIN_M, _MOST_HEIGHT_M),
    )
