"""How closely a UAV has to look at those near it: at each in a decision, and how soon again."""

from __future__ import annotations

from functools import cached_property

from swarm.kernels.motions import FloatArray, least_distance_m
from swarm.separation.tactical_motion import GRID_M
from swarm.separation.tactical_reach import Cylinder
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

    A second, or half of it, unless somebody is close for so long, see `is_close`; else a tick.

    Args:
        word: of the own flight.
        picture: those near it.
        rules: of the fleet.
        now_s: now, on the own clock.
        gives_way: whether it may be told otherwise than to fly on.
    """
    for wait_s in (rules.beacon_s, rules.beacon_s / 2.0):
        close = picture.is_close(word, now_s, wait_s, gives_way=gives_way)
        if close is None:
            close = is_close(word, picture, rules, now_s, wait_s, gives_way=gives_way)
        if not close:
            return wait_s
    return rules.tick_s


def is_close(
    word: TrafficWord,
    picture: TrafficPicture,
    rules: TrafficRules,
    now_s: float,
    wait_s: float,
    *,
    gives_way: bool,
) -> bool:
    """Whether it could make somebody brake to wait for so long.

    One of two that flies on as it said, for all that the other may do while it is not heard for so
    much longer. Of two that can't give way neither brakes.

    Args:
        word: of the own flight.
        picture: those near it.
        rules: of the fleet.
        now_s: now, on the own clock.
        wait_s: until the next decision and the next word.
        gives_way: whether it may be told otherwise than to fly on.
    """
    asked_m = rules.separation_m + GRID_M + WIDE_M
    me = NearbyTrack(word, now_s, rules.tick_s)
    mine = me.reach_of_stops(now_s, rules, wait_s)
    near = [
        track
        for _, track in picture.near(word.position_enu_m, now_s)
        if (gives_way or track.word.precedence.grade is not Grade.BOUND)
        and mine.distance_m(track.reach_of_stops(now_s, rules, wait_s)) < asked_m
    ]
    my_stops_m, my_stray_m = me.stops_m(now_s, rules, wait_s)
    for track in near:
        stops_m, stray_m = track.stops_m(now_s, rules, wait_s)
        if any(least_distance_m(my_stops_m, stops_m, by) < asked_m for by in (my_stray_m, stray_m)):
            return True
    return False
