"""How far a UAV may get within some seconds, for much less than its motion costs.

Most of those that hear each other fly in different layers, or too far away. That settles it, and no
motion has to be sampled.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from swarm.separation.tactical_motion import STEP_S, Agility, Place

SLACK_M = 0.3
"""What samples of a motion may be higher or lower than by this reckoning."""


@dataclass(frozen=True, slots=True)
class Cylinder:
    """An upright cylinder that holds all places of a motion."""

    centre_m: Place
    """Where it begins."""
    radius_m: float
    low_m: float
    high_m: float

    def distance_m(self, other: Cylinder) -> float:
        """From any place in the one to any in the other, at the least [m]."""
        (east_m, north_m, _), (other_east_m, other_north_m, _) = self.centre_m, other.centre_m
        flat_m = math.hypot(east_m - other_east_m, north_m - other_north_m)
        flat_m = max(0.0, flat_m - self.radius_m - other.radius_m)
        return math.hypot(flat_m, max(0.0, self.low_m - other.high_m, other.low_m - self.high_m))

    def grown(self, stray_m: tuple[float, float]) -> Cylinder:
        """The same of one that may be so far beside that, flat and upright [m]."""
        flat_m, upright_m = stray_m
        radius_m = self.radius_m + flat_m
        return Cylinder(self.centre_m, radius_m, self.low_m - upright_m, self.high_m + upright_m)


def reach(
    position_m: Place,
    velocity_m_s: Place,
    path_m: Sequence[Place],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
    *,
    brakes: bool = False,
) -> Cylinder:
    """Where a UAV may be that flies its path for so long, and then stops there or ``brakes``.

    Args:
        position_m: where it is.
        velocity_m_s: how it moves.
        path_m: corners to fly through, the last to stop at; empty: it brakes at once.
        speed_m_s: cruise speed.
        agility: how it speeds up, brakes and climbs.
        drive_s: how long it flies on, not less than 0.
        brakes: whether it brakes after that, as in `motion_m`.
    """
    fast_m_s = math.hypot(*velocity_m_s)
    far_m = agility.stop_m(fast_m_s)
    if path_m:
        fast_m_s = max(fast_m_s, speed_m_s)
        far_m = fast_m_s * drive_s + (agility.stop_m(fast_m_s) if brakes else 0.0)
    far_m += fast_m_s * STEP_S  # a motion is driven by whole steps
    low_m = high_m = position_m[2]
    rise_m_s, here_m = abs(velocity_m_s[2]), position_m
    for corner_m in path_m:
        low_m, high_m = min(low_m, corner_m[2]), max(high_m, corner_m[2])
        if (steep_m := abs(corner_m[2] - here_m[2])) > 0.0:
            pace_m_s = speed_m_s * steep_m / math.dist(here_m, corner_m)
            rise_m_s = max(rise_m_s, min(pace_m_s, agility.climb_m_s))
        here_m = corner_m
    # Until it has turned into the next piece it may still rise or sink as on the one before.
    over_m = rise_m_s * 2.0 * fast_m_s / agility.acceleration_m_s2 + SLACK_M
    return Cylinder(position_m, far_m + SLACK_M, low_m - over_m, high_m + over_m)
