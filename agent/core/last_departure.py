"""How long one UAV may wait for a way: as long as its battery lasts until it is home by it.

Who can't wait any longer lands where it hovers. Leaves out: where ways are (agent.core.fleet_air)
and asking for them (agent.core.airway).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from agent.core.mission_view import MissionView
from agent.core.wish import Wish
from agent.core.zone_stay import ZoneStay
from swarm.allocation.problem import rest_to_rest_s
from swarm.protocol.fields import Point
from swarm.protocol.messages import UavSpec
from swarm.separation.shifted import length_m

LEAVES_ZONE_S = 5.0
"""How long it waits for a way out of a zone that is drawn over it before it lands there [s]."""
PATIENT_S = 300.0
"""How long one whose battery has no end waits for its way home before it lands where it is [s]."""
_TRIES = 2.0
"""How long it asks for a way home at least, in intervals at which it asks anew."""
_OF_RESERVE = 0.5
"""Share of the reserve that a wait for the way home may use up."""
_MOST_OF_RESERVE = 0.75
"""Share of it that the wait and a climb on the way may use up together."""
_ALL_OF_RESERVE = 0.9
"""Who would have used up more of it when it is home lands where it is, whatever it has tried."""


class LastDeparture:
    """Until when one UAV can set off, by its battery.

    Args:
        mission_view: what it knows of itself and the mission.
        zone_stay: how long it has been in a zone.
    """

    def __init__(self, mission_view: MissionView, zone_stay: ZoneStay) -> None:
        self.sortie_end_s: Callable[[], float] = lambda: math.inf
        """By when it must have landed, its reserve kept [s mission time]."""
        self.drain_frac: Callable[[], float] = lambda: 1.0
        """How many times as fast as planned its battery drains, as far as it knows."""
        self._mission_view = mission_view
        self._zone_stay = zone_stay

    def must_land(self, wish: Wish, retry_s: float) -> bool:
        """Whether it can't wait any longer for a way home, or out of a zone.

        Args:
            wish: for a way, wherever it leads.
            retry_s: how long it takes until it looks again [s].
        """
        if self._zone_stay.lasts_s(wish.corners_enu_m[0]) > LEAVES_ZONE_S:
            return True
        if wish.task is not None:
            return False
        waited_s = self._mission_view.now_s - wish.since_s
        has_tried = waited_s > _TRIES * retry_s
        late = self._mission_s + retry_s > self._until_s(wish, _OF_RESERVE)
        return (late and has_tried) or self._mission_s > self._until_s(wish, _ALL_OF_RESERVE)

    def ends_too_late(self, wish: Wish) -> bool:
        """Whether its way, set off on now, would end when it must have landed already."""
        me = self._mission_view.me
        return me is not None and self._mission_s + _way_s(wish, me) > self._end_s

    def can_fly(self, wish: Wish, path_enu_m: Sequence[Point]) -> bool:
        """Whether its battery lasts for a way home that climbs into another layer first."""
        me = self._mission_view.me
        if me is None or wish.task is not None:
            return True
        upright_m = [math.dist(a, b) for a, b in pairwise(path_enu_m) if a[:2] == b[:2]]
        if not upright_m:
            return True
        climbs_s = rest_to_rest_s(
            np.array(upright_m), me.speed_m_s, me.acceleration_m_s2 or math.inf
        )
        return self._mission_s + float(climbs_s.sum()) <= self._until_s(wish, _MOST_OF_RESERVE)

    def _until_s(self, wish: Wish, share: float) -> float:
        """When it sets off on its way if that uses up such a ``share`` of its reserve [s]."""
        me, end_s = self._mission_view.me, self._end_s
        if me is None or me.endurance_s is None or math.isinf(end_s):
            # By the own clock: who knows of no mission any more has no other.
            return self._mission_s + wish.since_s + PATIENT_S - self._mission_view.now_s
        reserve_s = me.reserve_frac * me.endurance_s / self.drain_frac()
        return end_s + share * reserve_s - _way_s(wish, me)

    @property
    def _end_s(self) -> float:
        """By when it must have landed [s mission time].

        Before a mission is known to have begun no time passes: what its charge still lasts counts
        from now; infinite where nobody tells it.
        """
        me, told = self._mission_view.me, self._mission_view.telemetry
        if self._mission_view.clock.is_set or me is None or me.endurance_s is None:
            return self.sortie_end_s()
        if told is None or told.battery_frac is None:
            return math.inf
        left_s = (told.battery_frac - me.reserve_frac) * me.endurance_s / self.drain_frac()
        return self._mission_s + left_s

    @property
    def _mission_s(self) -> float:
        return self._mission_view.mission_s(self._mission_view.now_s)


def _way_s(wish: Wish, me: UavSpec) -> float:
    """How long that way takes [s]."""
    if wish.takes_s is not None:
        return wish.takes_s
    return length_m(wish.corners_enu_m) / me.speed_m_s
