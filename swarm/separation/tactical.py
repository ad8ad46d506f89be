"""Who gives way in the air, and how: decided by each for itself, alike by all who know the same.

Two layers. *Giving way*: a UAV looks ahead, and where it would come too near to one of higher
precedence it slows, stops, flies on higher or lower, or moves aside. *Braking*: whatever its
precedence, it moves only as long as it can still stop short of wherever another may be before that
one has stopped, be its last word old. The first keeps flights smooth, the second keeps them apart;
why this ends, and never in a deadlock, is in README.md. Pure: no clock, no chance, no I/O.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from swarm.kernels.motions import least_distance_m
from swarm.separation.tactical_advice import Advice, Maneuver, OwnFlight
from swarm.separation.tactical_look import Other, pace_s
from swarm.separation.tactical_motion import (
    GRID_M,
    Place,
    least_meeting_m,
    motion_m,
    round_m,
    stop_place_m,
    stopping_m,
)
from swarm.separation.tactical_reach import reach
from swarm.separation.tactical_traffic import (
    SILENT_S,
    WIDE_M,
    Grade,
    NearbyTrack,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)


@dataclass(frozen=True, slots=True)
class _Option:
    maneuver: Maneuver
    path_enu_m: tuple[Place, ...]
    speed_m_s: float
    label: str


Clear = Callable[[Sequence[Place]], bool]

_SLOW = 0.5
_CLEAR_S = 1.0
"""Who has given way or braked goes on once there has been room for so long."""
_HELD_S = 5.0
"""Who has stood for so long rather flies on higher or lower."""
_STUCK_S = 8.0
"""Who has stood for so long before one that should give way takes it to stay there."""
_TRY_S = 4.0
"""A way that is barred for so long is left for another."""
_LEFT_S = 12.0
_STANDS_M = 1.0
"""Who flies no farther within the horizon stands."""
_NEAR_M = 2.0
"""A corner of a detour that near has been flown."""


class TacticalResolver:
    """Keeps one UAV apart from those near it.

    Args:
        uav: its id.
        rules: of the fleet.
        clear: whether a path keeps away from zones, the ground and the fence.
    """

    def __init__(self, uav: str, rules: TrafficRules, clear: Clear = lambda _path_m: True) -> None:
        self._uav = uav
        self._rules = rules
        self._clear = clear
        self._advice = Advice(Maneuver.KEEP)
        self._option: _Option | None = None
        self._in_way_s = -math.inf
        """When somebody was in its own way last."""
        self._stood_since_s: float | None = None
        self._braked_since_s: float | None = None
        self._brakes_until_s = -math.inf
        self._decided_s = -math.inf
        self._since_s = -math.inf
        """When it began to decide: it had not for a while, as on the ground."""
        self._borrowed: Precedence | None = None
        """Of the one for whom it makes room."""
        self._left: dict[str, float] = {}
        """Ways that were barred, and until when they are left alone."""
        self._obstinate: dict[str, float] = {}
        """Who has not given way, and until when that is taken to stay so."""

    @property
    def advice(self) -> Advice:
        """The last."""
        return self._advice

    def word(self, own: OwnFlight) -> TrafficWord:
        """What those near it have to know."""
        flown = self._flown(own)
        return replace(flown, path_enu_m=flown.path_enu_m[:MOST_CORNERS])

    def _flown(self, own: OwnFlight) -> TrafficWord:
        """The same with all its corners."""
        option, told = self._option, own.precedence
        path_m: tuple[Place, ...] = own.path_enu_m
        speed_m_s = own.speed_m_s
        if option is not None and own.gives_way:
            path_m, speed_m_s = option.path_enu_m, option.speed_m_s
            told = self._borrowed or told
        return TrafficWord(own.position_enu_m, own.velocity_enu_m_s, path_m, speed_m_s, told)

    def decide(self, own: OwnFlight, picture: TrafficPicture, now_s: float) -> Advice:
        """What to do until the next decision, which comes as soon as `pace_s` says.

        Args:
            own: its flight.
            picture: those near it.
            now_s: now, on the own clock.
        """
        passed_s, self._decided_s = now_s - self._decided_s, now_s
        if passed_s > SILENT_S:
            self._since_s, passed_s = now_s, 0.0
        if not own.gives_way:
            self._end()
            return self._advice
        if self._keeps_on(own, picture, now_s):
            return self._advice
        others = [
            self._look(own, uav, track, now_s)
            for uav, track in picture.near(own.position_enu_m, now_s)
        ]
        if not others:
            self._end()
            return self._advice
        if own.path_enu_m:
            self._blame(others, passed_s, now_s)
        option, because_of = self._choose(own, others, now_s)
        barred_by = self._barred_by(own, option, others, wide=self._advice.braked)
        if barred_by is not None:
            self._brakes_until_s = now_s + _CLEAR_S
        elif now_s < self._brakes_until_s and option.path_enu_m:
            barred_by = self._advice.because_of
        self._adopt(own, option, because_of, barred_by, others, now_s)
        return self._advice

    def _keeps_on(self, own: OwnFlight, picture: TrafficPicture, now_s: float) -> bool:
        """Whether it flies on as it did, as nobody is in its way: mostly that is soon seen."""
        option = self._option
        if self._advice.stands or (option is not None and option.maneuver is not Maneuver.KEEP):
            return False
        if now_s < self._brakes_until_s or any(until > now_s for until in self._obstinate.values()):
            return False
        anybody = picture.glance(
            *(own.position_enu_m, own.velocity_enu_m_s, own.path_enu_m, own.speed_m_s),
            self._borrowed or own.precedence,
            now_s,
        )
        if anybody:
            keep = _Option(Maneuver.KEEP, own.path_enu_m, own.speed_m_s, "keep")
            self._adopt(own, keep, None, None, (), now_s)
        elif anybody is False:
            self._end()
        return anybody is not None

    def pace_s(self, own: OwnFlight, picture: TrafficPicture, now_s: float) -> float:
        """How long the next decision and the next word can wait after the last one [s].

        A tick where it gives way, and as long as it may not have been heard; else see `pace_s`.
        """
        gives_way = self._advice.braked or self._advice.maneuver is not Maneuver.KEEP
        if gives_way or now_s - self._since_s < SILENT_S:
            return self._rules.tick_s
        return pace_s(self._flown(own), picture, self._rules, now_s, gives_way=own.gives_way)

    # -- those near it ------------------------------------------------------------------

    def _look(self, own: OwnFlight, uav: str, track: NearbyTrack, now_s: float) -> Other:
        mine = self._borrowed or own.precedence
        theirs = track.word.precedence
        silent = track.is_silent(now_s) or self._obstinate.get(uav, -math.inf) > now_s
        first = track.is_plausible(now_s) and (
            silent or (theirs, uav) < (mine, self._uav) or theirs.grade is Grade.BOUND
        )
        return Other(uav, track, now_s, self._rules, goes_first=first)

    def _blame(self, others: Sequence[Other], passed_s: float, now_s: float) -> None:
        """Count who has kept this UAV from flying its way since the last decision."""
        if not self._advice.stands and self._advice.maneuver is not Maneuver.ASIDE:
            return
        for other in others:
            if other.uav == self._advice.because_of:
                other.track.blame(now_s, passed_s)

    # -- giving way ---------------------------------------------------------------------

    def _choose(
        self, own: OwnFlight, others: Sequence[Other], now_s: float
    ) -> tuple[_Option, str | None]:
        """What it would do, and who is the reason."""
        keep = _Option(Maneuver.KEEP, own.path_enu_m, own.speed_m_s, "keep")
        now = self._current(own)
        in_way = self._in_way(own, keep, others, wide=now is not None)
        if in_way is None and now is not None:
            in_way = self._barred_by(own, keep, others, wide=True)
        if in_way is not None:
            self._in_way_s = now_s
        elif now is None or now_s - self._in_way_s >= _CLEAR_S:
            return keep, None
        if now is not None and self._left.get(now.label, -math.inf) <= now_s:
            idles = now.maneuver in (Maneuver.HOLD, Maneuver.ASIDE)
            waits = idles and self._has_stood(now_s) and own.path_enu_m
            if not waits and (
                self._in_way(own, now, others) is None or self._gets_out(now, others)
            ):
                return now, self._advice.because_of or in_way
        options = [
            option
            for option in self._options(own, others, in_way, now_s)
            if self._left.get(option.label, -math.inf) <= now_s and self._is_clear(own, option)
        ]
        for option in options:
            if self._in_way(own, option, others) is None:
                return option, in_way or self._advice.because_of
        for option in options:
            if self._gets_out(option, others):
                return option, in_way or self._advice.because_of
        hold = _Option(Maneuver.HOLD, (), own.speed_m_s, "hold")
        return hold, in_way or self._advice.because_of

    def _gets_out(self, option: _Option, others: Sequence[Other]) -> bool:
        """Whether it waits off the ways of all who go first, though they come before it is there.

        They brake for it; that they would fly on at once is no reason to stay in their way.
        """
        if option.maneuver is not Maneuver.ASIDE:
            return False
        end_m = np.array(option.path_enu_m[-1:])
        return all(
            least_distance_m(end_m, way_m) >= self._rules.apart_m
            for other in others
            if other.goes_first
            for way_m in (other.expected_m, other.column_m)
            if way_m is not None
        )

    def _has_stood(self, now_s: float) -> bool:
        return self._stood_since_s is not None and now_s - self._stood_since_s >= _HELD_S

    def _current(self, own: OwnFlight) -> _Option | None:
        """The maneuver under way, without the corners that have been flown."""
        option = self._option
        if option is None or option.maneuver is Maneuver.KEEP:
            return None
        if option.maneuver is Maneuver.SLOW:
            return _Option(Maneuver.SLOW, own.path_enu_m, option.speed_m_s, option.label)
        path_m = option.path_enu_m
        while len(path_m) > 1 and math.dist(path_m[0], own.position_enu_m) <= _NEAR_M:
            path_m = path_m[1:]
        return _Option(option.maneuver, path_m, option.speed_m_s, option.label)

    def _options(
        self, own: OwnFlight, others: Sequence[Other], in_way: str | None, now_s: float
    ) -> Iterator[_Option]:
        """What it may do instead of flying on, the least first."""
        speed_m_s, hold = own.speed_m_s, _Option(Maneuver.HOLD, (), own.speed_m_s, "hold")
        moves = own.position_enu_m, own.velocity_enu_m_s
        stop_m = stop_place_m(*moves, self._rules.reaction_s, self._rules.agility)
        if own.path_enu_m:
            yield _Option(Maneuver.SLOW, own.path_enu_m, _SLOW * speed_m_s, "slow")
            over = [*self._over(own, stop_m), *self._round(own, stop_m, others, in_way)]
            if self._has_stood(now_s):
                yield from over
                yield hold
            else:
                yield hold
                yield from over
        else:
            yield hold
        threat = next((other for other in others if other.uav == in_way), None)
        for label, place_m in self._places_aside(stop_m, threat):
            yield _Option(Maneuver.ASIDE, (place_m,), speed_m_s, label)

    def _over(self, own: OwnFlight, stop_m: Place) -> list[_Option]:
        """To the end of its way, so much higher or lower."""
        options = []
        for label, rise_m in self._rises():
            first_m = (stop_m[0], stop_m[1], stop_m[2] + rise_m)
            corners = [(east, north, first_m[2]) for east, north, _ in own.path_enu_m]
            path_m = (first_m, *corners, own.path_enu_m[-1])
            if self._is_within(path_m[:1]):
                options.append(_Option(Maneuver.OVER, path_m, own.speed_m_s, f"over {label}"))
        return options

    def _round(
        self, own: OwnFlight, stop_m: Place, others: Sequence[Other], in_way: str | None
    ) -> Iterator[_Option]:
        """Past one that stands in its way on a side, where it can't fly higher or lower."""
        for other in others:
            if other.uav != in_way:
                continue
            here_m, there_m = other.expected_m[0], other.expected_m[-1]
            if math.dist(here_m, there_m) < _STANDS_M:
                sides = round_m(stop_m, here_m, self._rules.aside_m)
                for label, corners in zip(("right", "left"), sides, strict=False):
                    path_m = (*corners, *own.path_enu_m)
                    yield _Option(Maneuver.OVER, path_m, own.speed_m_s, f"round {label}")

    def _rises(self) -> list[tuple[str, float]]:
        aside_m = self._rules.aside_m
        return [(f"{share:+d}", share * aside_m) for share in (1, -1, 2, -2)]

    def _places_aside(self, stop_m: Place, threat: Other | None) -> Iterator[tuple[str, Place]]:
        """Where it could wait: up, down, and beside the way of the one that comes."""
        for label, rise_m in self._rises():
            place_m = (stop_m[0], stop_m[1], stop_m[2] + rise_m)
            if self._is_within((place_m,)):
                yield f"aside {label}", place_m
        east, north = _heading(threat)
        aside_m = self._rules.aside_m
        for label, side in (("right", 1.0), ("left", -1.0), ("far right", 2.0), ("far left", -2.0)):
            beside_m = side * aside_m
            place_m = stop_m[0] + beside_m * north, stop_m[1] - beside_m * east, stop_m[2]
            yield f"aside {label}", place_m

    def _is_within(self, path_m: Sequence[Place]) -> bool:
        return all(self._rules.low_m <= up <= self._rules.high_m for _, _, up in path_m)

    def _is_clear(self, own: OwnFlight, option: _Option) -> bool:
        """Whether nothing but UAVs is in the way of a maneuver, nor of what follows it."""
        if option.maneuver not in (Maneuver.OVER, Maneuver.ASIDE):
            return True
        path_m = (own.position_enu_m, *option.path_enu_m)
        if option.maneuver is Maneuver.ASIDE:
            path_m = (*path_m, *own.path_enu_m[:1])
        return self._clear(path_m)

    def _in_way(
        self, own: OwnFlight, option: _Option, others: Sequence[Other], *, wide: bool = False
    ) -> str | None:
        """To whom it would come too near that goes first; None: to nobody."""
        rules = self._rules
        flown = own.position_enu_m, own.velocity_enu_m_s, option.path_enu_m, option.speed_m_s
        asked_m = rules.apart_m + (WIDE_M if wide else 0.0)
        mine = reach(*flown, rules.agility, rules.horizon_s)
        near = [
            other
            for other in others
            if other.goes_first
            and (
                mine.distance_m(other.ahead) < asked_m
                or (other.track.is_upright and mine.distance_m(other.track.column) < asked_m)
            )
        ]
        if not near:
            return None
        way_m = motion_m(*flown, rules.agility, math.inf, rules.horizon_s)
        for other in near:
            # Who is nearer already comes no nearer.
            here_m = math.dist(way_m[0], other.expected_m[0]) - GRID_M
            if least_meeting_m(way_m, other.expected_m) < min(asked_m, here_m):
                return other.uav
            if other.column_m is not None:
                here_m = least_distance_m(way_m[:1], other.column_m) - GRID_M
                if least_distance_m(way_m, other.column_m) < min(asked_m, here_m):
                    return other.uav
        return None

    # -- braking ------------------------------------------------------------------------

    def _barred_by(
        self, own: OwnFlight, option: _Option, others: Sequence[Other], *, wide: bool
    ) -> str | None:
        """Before whom it has to brake, as it could not stop short of it any more a tick later."""
        rules = self._rules
        if not option.path_enu_m:
            return None
        drive_s = rules.tick_s + rules.reaction_s
        flown = own.position_enu_m, own.velocity_enu_m_s, option.path_enu_m, option.speed_m_s
        asked_m = rules.separation_m + GRID_M + (WIDE_M if wide else 0.0)
        mine = reach(*flown, rules.agility, drive_s, brakes=True)
        near = [other for other in others if mine.distance_m(other.halts) < asked_m]
        if not near:
            return None
        way_m = stopping_m(*flown, rules.agility, drive_s)
        for other in near:
            stops_m, stray = other.stops_m
            if least_distance_m(way_m, stops_m, stray) >= asked_m:
                continue
            # Who is nearer already comes no nearer.
            inside = least_distance_m(way_m[:1], stops_m, stray) < asked_m
            here_m = least_distance_m(way_m[:1], stops_m) - GRID_M
            if not inside or least_distance_m(way_m, stops_m) < here_m:
                return other.uav
        return None

    # -- what comes of it -----------------------------------------------------------------

    def _adopt(
        self,
        own: OwnFlight,
        option: _Option,
        because_of: str | None,
        barred_by: str | None,
        others: Sequence[Other],
        now_s: float,
    ) -> None:
        before = self._option
        if before is None or before.label != option.label:
            self._braked_since_s = None
        self._option = option
        braked = barred_by is not None
        self._braked_since_s = (self._braked_since_s or now_s) if braked else None
        if barred_by is not None and self._braked_since_s is not None:
            self._give_up_waiting(option, barred_by, now_s - self._braked_since_s, now_s)
        reason = next((other for other in others if other.uav == because_of), None)
        makes_room = option.maneuver in (Maneuver.OVER, Maneuver.ASIDE)
        if not makes_room:
            self._borrowed = None
        elif reason is not None and reason.goes_first:
            lent = reason.track.word.precedence.of_who_makes_room
            self._borrowed = lent if lent < own.precedence else None
        slowed_m_s = option.speed_m_s if option.maneuver is Maneuver.SLOW else None
        path_m = option.path_enu_m if makes_room else ()
        whom = barred_by if braked else because_of
        self._advice = Advice(option.maneuver, path_m, slowed_m_s, whom, braked)
        aside = option.maneuver is Maneuver.ASIDE and (
            math.dist(own.position_enu_m, option.path_enu_m[-1]) <= _NEAR_M
        )
        if (self._advice.stands or aside) and own.path_enu_m:
            self._stood_since_s = now_s if self._stood_since_s is None else self._stood_since_s
        else:
            self._stood_since_s = None

    def _give_up_waiting(
        self, option: _Option, barred_by: str, waited_s: float, now_s: float
    ) -> None:
        """Who is barred for long tries another way."""
        self._left = {label: until for label, until in self._left.items() if until > now_s}
        self._obstinate = {uav: until for uav, until in self._obstinate.items() if until > now_s}
        if option.maneuver in (Maneuver.OVER, Maneuver.ASIDE):
            if waited_s >= _TRY_S:
                self._left[option.label] = now_s + _LEFT_S
        elif waited_s >= _STUCK_S:
            self._obstinate[barred_by] = now_s + _LEFT_S

    def _end(self) -> None:
        """Nobody is near."""
        self._advice, self._option = Advice(Maneuver.KEEP), None
        self._stood_since_s = self._braked_since_s = None
        self._borrowed = None
        self._left.clear()
        self._obstinate.clear()


MOST_CORNERS = 4
"""Of its way ahead a UAV tells no more."""


def _heading(threat: Other | None) -> tuple[float, float]:
    """Which way another one is about to fly: east and north of a unit vector."""
    if threat is not None:
        east, north = (threat.expected_m[-1] - threat.expected_m[0])[:2].tolist()
        length = math.hypot(east, north)
        if length > 1.0:
            return east / length, north / length
    return 1.0, 0.0
