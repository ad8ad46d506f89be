"""How closely a UAV has to look at those near it: at each in a decision, and how soon again."""

from __future__ import annotations

import math
from functools import cached_property

from swarm.kernels.motions import FloatArray
from swarm.separation.tactical_motion import stray_m
from swarm.separation.tactical_reach import Cylinder, reach
from swarm.separation.tactical_traffic import (
    WIDE_M,
    Grade,
    NearbyTrack,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)


class Other:
    """Another UAV, as it counts in one decision: what is asked for of it is worked out then."""

    def __init__(
        self, uav: str, track: NearbyTrack, now_s: float, rules: TrafficRules, *, goes_first: bool
    ) -> None:
        self.uav, self.track, self.goes_first = uav, track, goes_first
        self._now_s, self._rules = now_s, rules

    @cached_property
    def ahead(self) -> Cylinder:
        """Round `expected_m`."""
        return self.track.reach_ahead(self._now_s, self._rules)

    @cached_property
    def expected_m(self) -> FloatArray:
        """Where it will be, if it does as it said."""
        return self.track.expected_m(self._now_s, self._rules)

    @cached_property
    def column_m(self) -> FloatArray | None:
        """What it passes straight up or down, whenever."""
        return self.track.column_m()

    @cached_property
    def halts(self) -> Cylinder:
        """Round `stops_m`, and what it may stray from these."""
        return self.track.reach_of_stops(self._now_s, self._rules)

    @cached_property
    def stops_m(self) -> tuple[FloatArray, tuple[float, float]]:
        """Places, and how far from these it may be."""
        return self.track.stops_m(self._now_s, self._rules)


def pace_s(
    word: TrafficWord,
    picture: TrafficPicture,
    rules: TrafficRules,
    now_s: float,
    *,
    gives_way: bool,
) -> float:
    """How long the next decision and the next word can wait after the last one [s].

    A tick where a second more or less could make somebody brake: if one of two flew on for so much
    longer, and was not heard for so much longer. Of two that can't give way neither brakes.

    Args:
        word: of the own flight.
        picture: those near it.
        rules: of the fleet.
        now_s: now, on the own clock.
        gives_way: whether it may be told otherwise than to fly on.
    """
    is_close = picture.is_close(word, now_s, gives_way=gives_way)
    if is_close is not None:
        return rules.tick_s if is_close else rules.beacon_s
    age_s = rules.beacon_s + rules.tick_s
    mine = reach(
        *(word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s),
        rules.agility,
        age_s + rules.reaction_s,
        brakes=True,
    ).grown(stray_m(age_s, math.hypot(*word.velocity_enu_m_s), rules.agility))
    for _, track in picture.near(word.position_enu_m, now_s):
        if gives_way or track.word.precedence.grade is not Grade.BOUND:
            theirs = track.reach_of_stops(now_s, rules, later_s=rules.beacon_s)
            if mine.distance_m(theirs) < rules.apart_m + WIDE_M:
                return rules.tick_s
    return rules.beacon_s
