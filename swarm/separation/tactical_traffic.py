"""What one UAV knows of those near it: their last words, how old these are, how far they count.

A word ages: who is not heard is taken to have gone on as it said, or otherwise by as much as it can
have since. A word that contradicts the one before it, by a jump that no UAV can fly, counts for
less; who keeps another one from flying for too long, by moving about in its way, is not believed
for a while. Leaves out: what follows (swarm.separation.tactical) and the bus.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

from swarm.kernels.motions import FloatArray
from swarm.kernels.traffic import PrecedenceNumbers, TrafficNumbers, TrafficTable
from swarm.separation.tactical_motion import (
    COLUMN_STEP_M,
    GRID_M,
    STEP_S,
    Agility,
    Place,
    column_m,
    motion_m,
    stopping_m,
    stray_m,
)
from swarm.separation.tactical_reach import SLACK_M, Cylinder, reach


class Grade(IntEnum):
    """How much a UAV may be asked to give way; the lower goes first."""

    BOUND = 0
    """It can't or must not: serving, landing, climbing, stopped by its operator."""
    FLYING = 1
    FREE = 2
    """It hovers with nothing to do."""


@dataclass(frozen=True, slots=True, order=True)
class Precedence:
    """Who gives way to whom: the greater to the smaller, at equal ones the greater id."""

    grade: Grade
    rank: int
    """Of the priority sequence."""
    depth: int = 0
    """0: its own; else it makes room for one of depth - 1, and goes before all others as that one
    does."""

    @property
    def numbers(self) -> PrecedenceNumbers:
        """As kernels compare it."""
        return int(self.grade), self.rank, self.depth

    @property
    def of_who_makes_room(self) -> Precedence:
        """Of a UAV that makes room for one of this precedence."""
        return Precedence(self.grade, self.rank, min(self.depth + 1, MOST_DEPTH))


MOST_DEPTH = 255


@dataclass(frozen=True, slots=True)
class TrafficWord:
    """What a UAV in the air says of itself to those near it."""

    position_enu_m: Place
    velocity_enu_m_s: Place
    path_enu_m: tuple[Place, ...]
    """Where it is about to fly next, corner by corner; empty: it stops and stays."""
    speed_m_s: float
    """At which it flies that."""
    precedence: Precedence

    def within(self, fastest_m_s: float) -> TrafficWord:
        """The same of a UAV that is no faster than that, as far ahead as others look for it."""
        speed_m_s = math.hypot(*self.velocity_enu_m_s)
        if max(speed_m_s, self.speed_m_s) <= fastest_m_s:
            return self
        share = min(1.0, fastest_m_s / max(speed_m_s, fastest_m_s))
        east, north, up = (share * each for each in self.velocity_enu_m_s)
        told_m_s = min(self.speed_m_s, fastest_m_s)
        return replace(self, velocity_enu_m_s=(east, north, up), speed_m_s=told_m_s)


@dataclass(frozen=True, slots=True)
class TrafficRules:
    """By what the UAVs of a fleet keep apart; the same for all of them.

    Raises:
        ValueError: a number is out of range.
    """

    separation_m: float
    """Least distance of two UAVs in flight."""
    cruise_m_s: float
    """Of the fastest of them."""
    agility: Agility = field(default_factory=Agility)
    position_error_m: float = 1.0
    """A place that is told is no farther from the true one."""
    reaction_s: float = 0.8
    """From a decision until the vehicle does it, at the most."""
    tick_s: float = 0.25
    """Between two decisions, and two words, while somebody is close."""
    beacon_s: float = 1.0
    """Between two words while nobody is, and twice what is between two decisions then."""
    low_m: float = -math.inf
    """No UAV gives way to below this height [m; mission origin]."""
    high_m: float = math.inf
    """Nor to above this one."""

    def __post_init__(self) -> None:
        for name in ("separation_m", "cruise_m_s", "reaction_s", "tick_s", "beacon_s"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be > 0 and finite, not {getattr(self, name)}")
        if not 0.0 <= self.position_error_m < math.inf:
            raise ValueError(f"position_error_m must be >= 0, not {self.position_error_m}")

    @property
    def apart_m(self) -> float:
        """Who gives way sees that it passes no nearer than that."""
        return self.separation_m + _ROOM_M

    @property
    def aside_m(self) -> float:
        """So far it moves out of a way, up, down or to a side: to the next layer."""
        return self.separation_m + max(_LEAST_ASIDE_M, 2.0 * self.position_error_m)

    @property
    def horizon_s(self) -> float:
        """So far ahead it is looked: long enough to stop, and a little more."""
        return self.reaction_s + self.cruise_m_s / self.agility.acceleration_m_s2 + _AHEAD_S

    @property
    def reach_m(self) -> float:
        """Nobody farther away matters within the horizon."""
        return 2.0 * self.cruise_m_s * self.horizon_s + self.apart_m

    @property
    def fastest_m_s(self) -> float:
        """No UAV of the fleet is faster, whatever it says."""
        return _FAST * self.cruise_m_s


_ROOM_M = 1.0
_LEAST_ASIDE_M = 2.0
_AHEAD_S = 4.0

WIDE_M = 0.7
"""Who has given way goes on only where there is so much more room."""
SILENT_S = 3.0
"""Who has said nothing for so long is not expected to give way, nor to have turned meanwhile: the
next words of a turn get lost together less than once in 10^8 turns at 20 % loss."""
FORGET_S = 60.0
"""From then on only what it has claimed keeps others off its way."""
_STANDS_M, _STANDS_S = 5.0, 30.0
"""Who has moved about less for so long stands."""
_IMPLAUSIBLE_S = 10.0
_JUMP_ROOM_M = 5.0
_LATE_S = 1.0
"""A word may come so much later than the one before it."""
_FAST = 1.5
"""A UAV may be that many times as fast as the fastest is told to cruise, as with the wind."""
PATIENCE_S = 60.0
"""Who has kept a UAV from flying for so long, in all, by moving about, is not believed."""
DISBELIEF_S = 300.0
_FORGIVEN = 0.2
"""Share of the time that is taken off what it has cost, once it has cost nothing for a while."""
_GRUDGE_S = 20.0
"""That while: who is stopped rather tries another way for some seconds in between."""
_UPRIGHT_BLAME = 0.5
"""Share of the time that one costs who climbs or lands: it can't do otherwise, and that ends."""
_MOST_COLUMN_M = 300.0
"""Nobody is taken to climb or to land farther than that at once."""


class NearbyTrack:
    """One UAV near this one.

    Args:
        word: its first.
        now_s: when that was heard, on the own clock.
        age_s: how old it was.
    """

    def __init__(self, word: TrafficWord, now_s: float, age_s: float) -> None:
        self.word = word
        self.said_s = now_s - age_s
        """When the last word was said, on the own clock [s]."""
        self.cost_s = 0.0
        """For how long it has kept this UAV from flying, less what is forgiven."""
        self._counted_s = now_s
        self._blamed_s = -math.inf
        self._stood_at_m = word.position_enu_m
        self._moved_s = -math.inf
        """When it was last seen to have moved."""
        self._implausible_until_s = -math.inf
        self._disbelieved_until_s = -math.inf
        self.when_disbelieved: Callable[[float], None] = lambda _: None
        """Is told until when it is not believed any more."""

    def hear(self, word: TrafficWord, now_s: float, age_s: float, rules: TrafficRules) -> None:
        """It says so now."""
        passed_s = max(0.0, now_s - age_s - self.said_s) + _LATE_S
        way_m = rules.fastest_m_s * passed_s + 2.0 * rules.position_error_m + _JUMP_ROOM_M
        if math.dist(word.position_enu_m, self.word.position_enu_m) > way_m:
            self._implausible_until_s = now_s + _IMPLAUSIBLE_S
        if math.dist(word.position_enu_m, self._stood_at_m) > _STANDS_M:
            self._stood_at_m = word.position_enu_m
            self._moved_s = now_s
        self.word, self.said_s = word, now_s - age_s

    def blame(self, now_s: float, seconds: float) -> None:
        """It has kept this UAV from flying for so long; who only stands is not blamed."""
        if now_s - self._moved_s > _STANDS_S:
            return
        self._blamed_s = now_s
        self.cost_s += seconds if self.column_m() is None else _UPRIGHT_BLAME * seconds
        if self.cost_s >= PATIENCE_S:
            self.cost_s = 0.0
            self._disbelieved_until_s = now_s + DISBELIEF_S
            self.when_disbelieved(self._disbelieved_until_s)

    def forgive(self, now_s: float) -> None:
        """Time passes."""
        if self.cost_s == 0.0:
            return
        since_s = max(self._counted_s, self._blamed_s + _GRUDGE_S)
        self.cost_s = max(0.0, self.cost_s - _FORGIVEN * max(0.0, now_s - since_s))
        self._counted_s = now_s

    def is_plausible(self, now_s: float) -> bool:
        """Whether what it has said of late fits together."""
        return now_s >= self._implausible_until_s

    def is_believed(self, now_s: float) -> bool:
        """Whether it counts at all."""
        return now_s >= self._disbelieved_until_s

    def is_silent(self, now_s: float) -> bool:
        """Whether its words stay away."""
        return now_s - self.said_s > SILENT_S

    def expected_m(self, now_s: float, rules: TrafficRules) -> FloatArray:
        """Where it will be at the times of `motion_m` until the horizon, if it does as it said."""
        age_s = max(0.0, now_s - self.said_s)
        word, span_s = self.word, age_s + rules.horizon_s
        way_m = motion_m(
            *(word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m),
            word.speed_m_s,
            rules.agility,
            math.inf,
            span_s,
        )
        samples = 1 + math.ceil(rules.horizon_s / STEP_S)
        return way_m[-samples:]

    def reach_ahead(self, now_s: float, rules: TrafficRules) -> Cylinder:
        """Holds all of `expected_m`."""
        word, age_s = self.word, max(0.0, now_s - self.said_s)
        return reach(
            *(word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s),
            rules.agility,
            age_s + rules.horizon_s,
        )

    @property
    def is_upright(self) -> bool:
        """Whether it climbs or comes down, straight, and can't do otherwise."""
        word = self.word
        if word.precedence.grade is not Grade.BOUND or not word.path_enu_m:
            return False
        return math.dist(word.position_enu_m[:2], word.path_enu_m[-1][:2]) <= _STANDS_M

    @property
    def column(self) -> Cylinder:
        """Holds all of `column_m`, of one that is upright."""
        here, end_up_m = self.word.position_enu_m, self._column_end_m()
        return Cylinder(here, 0.0, min(here[2], end_up_m), max(here[2], end_up_m))

    def column_m(self) -> FloatArray | None:
        """All that it is going to pass straight up or down, as it can't do otherwise; else None."""
        return column_m(self.word.position_enu_m, self._column_end_m()) if self.is_upright else None

    def _column_end_m(self) -> float:
        here_m, end_m = self.word.position_enu_m[2], self.word.path_enu_m[-1][2]
        return min(max(end_m, here_m - _MOST_COLUMN_M), here_m + _MOST_COLUMN_M)

    def stops_m(self, now_s: float, rules: TrafficRules) -> tuple[FloatArray, tuple[float, float]]:
        """Where it may be before it has stopped, however it decides until it hears more.

        Returns:
            Places along the way that it told, and how far from these it may be, see `stray_m`.
        """
        age_s, word = max(0.0, now_s - self.said_s), self.word
        flown = word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s
        way_m = stopping_m(*flown, rules.agility, _drive_s(age_s, rules))
        return way_m, self._stray_m(age_s, rules)

    def reach_of_stops(self, now_s: float, rules: TrafficRules) -> Cylinder:
        """Holds all of `stops_m`, with what it may stray."""
        age_s, word = max(0.0, now_s - self.said_s), self.word
        return reach(
            *(word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s),
            rules.agility,
            _drive_s(age_s, rules),
            brakes=True,
        ).grown(self._stray_m(age_s, rules))

    def _stray_m(self, age_s: float, rules: TrafficRules) -> tuple[float, float]:
        speed_m_s = math.hypot(*self.word.velocity_enu_m_s)
        return stray_m(min(age_s, SILENT_S), speed_m_s, rules.agility)


def _drive_s(age_s: float, rules: TrafficRules) -> float:
    """How long it may have flown on as it said before it brakes, with a word so old."""
    return min(age_s, FORGET_S) + rules.reaction_s + rules.tick_s


class TrafficPicture:
    """All whom one UAV has heard near it.

    Args:
        rules: of the fleet.
        heard_m: who is nearer than that is heard, unless links fail.
    """

    def __init__(self, rules: TrafficRules, heard_m: float) -> None:
        self._rules = rules
        self._heard_m = heard_m
        self._tracks: dict[str, NearbyTrack] = {}
        self._gone: dict[str, NearbyTrack] = {}
        """Who has landed or left: what it has cost still counts when it is back."""
        self._table = TrafficTable(_numbers_of(rules))
        self._numbers: dict[str, int] = {}
        """Under which each is in the table."""
        self._doubts_until_s = -math.inf
        """Until when somebody may not be believed."""

    def hear(self, uav: str, word: TrafficWord, now_s: float, age_s: float) -> bool:
        """Another UAV says so of itself; whether it was not known to be near, or silent.

        Args:
            uav: which.
            word: what it says.
            now_s: now, on the own clock.
            age_s: how old the word is, as far as that is known.
        """
        word = word.within(self._rules.fastest_m_s)
        known = self._tracks.get(uav)
        is_new = known is None or known.is_silent(now_s)
        track = known or self._gone.get(uav)
        if track is None:
            track = NearbyTrack(word, now_s, age_s)
            track.when_disbelieved = self._doubt
        elif now_s - age_s >= track.said_s:
            self._gone.pop(uav, None)
            track.hear(word, now_s, age_s, self._rules)
        else:
            return is_new
        self._tracks[uav] = track
        self._table.hear(
            self._numbers.setdefault(uav, len(self._numbers)),
            *(word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s),
            track.said_s,
            word.precedence.numbers,
        )
        return is_new

    def _doubt(self, until_s: float) -> None:
        self._doubts_until_s = max(self._doubts_until_s, until_s)

    def glance(
        self,
        position_enu_m: Place,
        velocity_enu_m_s: Place,
        path_enu_m: Sequence[Place],
        speed_m_s: float,
        precedence: Precedence,
        now_s: float,
    ) -> bool | None:
        """Whether anybody matters to a UAV that flies so, of whom none is in its way or bars it.

        None: somebody is, or may be, and has to be looked at.

        Args:
            position_enu_m: where it is [m].
            velocity_enu_m_s: how it moves.
            path_enu_m: corners ahead; empty: it hovers, or is about to stop.
            speed_m_s: at which it flies that.
            precedence: its own.
            now_s: now, on the own clock.
        """
        if now_s < self._doubts_until_s:
            return None
        flown = position_enu_m, velocity_enu_m_s, path_enu_m, speed_m_s
        anybody, odd, in_way = self._table.look(*flown, now_s, precedence.numbers)
        return None if odd or in_way else anybody

    def free_s(self, word: TrafficWord, now_s: float, *, gives_way: bool) -> float | None:
        """For how long nobody is close, see `swarm.separation.tactical_look.free_s`.

        None: somebody has to be looked at for that.

        Args:
            word: of the own flight, with all its corners.
            now_s: now, on the own clock.
            gives_way: whether it may be told otherwise than to fly on.
        """
        if now_s < self._doubts_until_s:
            return None
        flown = word.position_enu_m, word.velocity_enu_m_s, word.path_enu_m, word.speed_m_s
        long_s, odd = self._table.free_s(*flown, now_s, gives_way=gives_way)
        return None if odd else long_s

    def place_of(self, uav: str) -> Place | None:
        """Where a UAV said last that it is; None: it is not heard."""
        track = self._tracks.get(uav)
        return None if track is None else track.word.position_enu_m

    def blame(self, uav: str, now_s: float, seconds: float) -> None:
        """It has kept this UAV from taking off, or from landing, for so long."""
        if (track := self._tracks.get(uav)) is not None:
            track.blame(now_s, seconds)

    def forget(self, uav: str) -> None:
        """It has landed, or left."""
        if (track := self._tracks.pop(uav, None)) is not None:
            self._gone[uav] = track
            self._table.forget(self._numbers[uav])

    def near(self, place_m: Place, now_s: float) -> Iterator[tuple[str, NearbyTrack]]:
        """Those who matter to a UAV at that place, in the order of their ids."""
        reach_m, fastest_m_s = self._rules.reach_m, self._rules.fastest_m_s
        near = list[str]()
        for uav, track in list(self._tracks.items()):
            track.forgive(now_s)
            age_s = now_s - track.said_s
            if age_s > FORGET_S:
                self.forget(uav)
            elif math.dist(place_m, track.word.position_enu_m) <= reach_m + fastest_m_s * age_s:
                near.append(uav)
        for uav in sorted(near):
            track = self._tracks[uav]
            if not track.is_believed(now_s):
                continue
            if track.is_silent(now_s) and self._has_left(track, place_m, now_s):
                self.forget(uav)
                continue
            yield uav, track

    def _has_left(self, track: NearbyTrack, place_m: Place, now_s: float) -> bool:
        """Whether it is no wonder that it is not heard: it has flown on, as it said."""
        word, age_s = track.word, max(0.0, now_s - track.said_s)
        fastest_m_s = max(word.speed_m_s, math.hypot(*word.velocity_enu_m_s))
        flown_m = fastest_m_s * (age_s + STEP_S)
        if math.dist(place_m, word.position_enu_m) + flown_m <= self._heard_m:
            return False  # nowhere that it could be by now is so far away
        expected_m = track.expected_m(now_s, self._rules)[0]
        return math.dist(place_m, expected_m.tolist()) > self._heard_m


def _numbers_of(rules: TrafficRules) -> TrafficNumbers:
    return TrafficNumbers(
        separation_m=rules.separation_m,
        apart_m=rules.apart_m,
        reach_m=rules.reach_m,
        fastest_m_s=rules.fastest_m_s,
        acceleration_m_s2=rules.agility.acceleration_m_s2,
        climb_m_s=rules.agility.climb_m_s,
        reaction_s=rules.reaction_s,
        tick_s=rules.tick_s,
        beacon_s=rules.beacon_s,
        horizon_s=rules.horizon_s,
        step_s=STEP_S,
        silent_s=SILENT_S,
        forget_s=FORGET_S,
        grid_m=GRID_M,
        wide_m=WIDE_M,
        slack_m=SLACK_M,
        stands_m=_STANDS_M,
        most_column_m=_MOST_COLUMN_M,
        column_step_m=COLUMN_STEP_M,
    )
