"""At which base a vehicle is."""

from __future__ import annotations

import math
from collections.abc import Iterable

from sim.world.motion import Point
from swarm.model import Base

SAME_PLACE_M = 1.0
"""Seen from above, so far from a base a vehicle is at it."""


def base_at(bases: Iterable[Base], place_enu_m: Point) -> Base | None:
    """The base that is nearest to a place [m], seen from above; None if none is there."""

    def away_m(base: Base) -> float:
        return math.dist(base.position_enu_m[:2], place_enu_m[:2])

    nearest = min(bases, key=away_m, default=None)
    return None if nearest is None or away_m(nearest) > SAME_PLACE_M else nearest
