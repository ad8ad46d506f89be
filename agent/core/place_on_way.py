"""Where one UAV's vehicle is on its way, as far as that is known.

Words of a vehicle come a few times a second, and right after it was sent off the last one is of
before: of the ground that it is about to leave, say. Leaves out: ways (agent.core.airway).
"""

from __future__ import annotations

import math

from agent.core.interface import Return
from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import ClaimedWay

_UP_M = 2.0
"""Who is no farther below an end of its way is as high as that [m]."""
_BESIDE_M = 5.0
"""Who climbs is no farther from there, seen from above [m]."""
_LANDS_M = 2.0
"""Nor who comes down at home [m]."""


class PlaceOnWay:
    """The place of one vehicle that may be sent off, and told to stop, between two words of it.

    Args:
        patience_s: so long at most an order waits for it to say where it is [s].
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self.enu_m: Point | None = None
        """Where it is, or would be stopped [m; mission origin]; None: nobody knows."""
        self._awaited_since_s = math.inf
        """Since when an order has waited until that is known [s]."""
        self._rises_to_enu_m: Point | None = None
        """Where it comes first from the ground [m]; None: it is in the air, or was not sent off."""

    def tell(self, place_enu_m: Point) -> None:
        """The vehicle says that it is there, which counts once it is where its way begins."""
        top_enu_m = self._rises_to_enu_m
        if top_enu_m is not None:
            below = place_enu_m[2] < top_enu_m[2] - _UP_M
            if below and math.dist(place_enu_m[:2], top_enu_m[:2]) <= _BESIDE_M:
                return
        self.enu_m, self._rises_to_enu_m = place_enu_m, None

    def set_off(self, begins_enu_m: Point, *, from_ground: bool) -> None:
        """It is sent on a way that begins there, where it hovers, or above where it stands."""
        self.enu_m, self._rises_to_enu_m = begins_enu_m, begins_enu_m if from_ground else None

    def is_awaited(self, now_s: float) -> bool:
        """Whether an order has to wait until it is known where it flies."""
        if self.enu_m is not None:
            return False
        self._awaited_since_s = min(self._awaited_since_s, now_s)
        return now_s < self.awaited_until_s

    @property
    def awaited_until_s(self) -> float:
        """Until when it waits at most [s]; endless as long as none does."""
        return self._awaited_since_s + self._patience_s

    def has_flown(self, way: ClaimedWay, home: Return) -> bool:
        """Whether it comes down, or is down, where ``way`` ends, above which ``home`` leads.

        As an earlier life told it to. Who is as high as the end of its way hovers in some layer.
        """
        here, above = self.enu_m, home.via_enu_m
        if here is None or above is None or not (way.flies and way.path_enu_m):
            return False
        end = way.path_enu_m[-1]
        if math.dist(end[:2], above[:2]) > _LANDS_M or here[2] > end[2] - _UP_M:
            return False
        return math.dist(here[:2], end[:2]) <= _LANDS_M

    def land(self) -> None:
        """It is on the ground, wherever it said that it was last."""
        self._rises_to_enu_m = None
