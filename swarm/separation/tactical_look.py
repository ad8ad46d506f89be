"""How closely a UAV has to look at those near it: at each in a decision, and how soon again."""

from __future__ import annotations

import math
from functools import cached_property

from swarm.kernels.motions import FloatArray, least_distance_m
from swarm.separation.tactical_motion import GRID_M, STEP_S
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

    A second, or half of it, if nobody is close for so long, see `free_s`; else a tick.

    Args:
        word: of the own flight, with all its corners.
        picture: those near it.
        rules: of the fleet.
        now_s: now, on the own clock.
        gives_way: whether it may be told otherwise than to fly on.
    """
    long_s = picture.free_s(word, now_s, gives_way=gives_way)
    if long_s is None:
        long_s = free_s(word, picture, rules, now_s, gives_way=gives_way)
    waits_s = rules.beacon_s, rules.beacon_s / 2.0
    return next((wait_s for wait_s in waits_s if wait_s <= long_s), rules.tick_s)


def free_s(
    word: TrafficWord,
    picture: TrafficPicture,
    rules: TrafficRules,
    now_s: float,
    *,
    gives_way: bool,
) -> float:
    """For how long nobody is close: could have to brake if this one waited, or make it brake [s].

    One of two that flies on as it said, for all that the other may do while it is not heard. Looked
    at every `STEP_S` until `beacon_s`, as who brakes before a bend comes elsewhere than who brakes
    behind it. Of two that can't give way neither brakes.

    Args:
        word: of the own flight, with all its corners.
        picture: those near it.
        rules: of the fleet.
        now_s: now, on the own clock.
        gives_way: whether it may be told otherwise than to fly on.
    """
    me, steps = NearbyTrack(word, now_s, rules.tick_s), math.ceil(rules.beacon_s / STEP_S)
    near = [
        track
        for _, track in picture.near(word.position_enu_m, now_s)
        if gives_way or track.word.precedence.grade is not Grade.BOUND
    ]
    for step in range(1, steps + 1):
        then_s = now_s + step * STEP_S
        if any(_may_brake(me, track, then_s, rules) for track in near):
            return (step - 1) * STEP_S
    return rules.beacon_s


def _may_brake(one: NearbyTrack, other: NearbyTrack, then_s: float, rules: TrafficRules) -> bool:
    """Whether either would have to brake before the other, which may have turned meanwhile."""
    asked_m = rules.separation_m + GRID_M + WIDE_M
    halts = one.reach_of_stops(then_s, rules)
    if halts.distance_m(other.reach_of_stops(then_s, rules)) >= asked_m:
        return False
    (some_m, one_stray_m), (others_m, other_stray_m) = (
        track.stops_m(then_s, rules) for track in (one, other)
    )
    strays_m = one_stray_m, other_stray_m
    return any(least_distance_m(some_m, others_m, stray_m) < asked_m for stray_m in strays_m)
