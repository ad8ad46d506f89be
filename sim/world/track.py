"""Where a simulated vehicle truly was, for whoever judges or tells of a flight afterwards.

A track is made of pieces of even acceleration, so that distances of two vehicles follow in closed
form. It knows only flight: what is on the ground is nowhere.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from sim.world.flown_path import MotionPiece
from sim.world.motion import Point, between, minus, plus

_AT_REST: Point = (0.0, 0.0, 0.0)


class Track:
    """The true motion of one vehicle, from lift-off to touch-down, as often as it flies."""

    def __init__(self) -> None:
        self._pieces: list[MotionPiece] = []
        """In order; there are gaps where it stands on the ground."""
        self.flights_s: list[tuple[float, float]] = []
        """Lift-offs and touch-downs [s]; the last one is infinite while it flies."""

    @property
    def airborne(self) -> bool:
        """Whether it flies, or is going to, without an end in sight."""
        return bool(self.flights_s) and self.flights_s[-1][1] == math.inf

    def lift_off(self, place_enu_m: Point, now_s: float) -> None:
        """It is in the air from now on, and stays there until something else is said."""
        self.touch_down(now_s)
        self.flights_s.append((now_s, math.inf))
        self._pieces.append(MotionPiece(now_s, math.inf, place_enu_m))

    def fly(self, pieces: Iterable[MotionPiece], stop_enu_m: Point, now_s: float) -> None:
        """It flies ``pieces`` from now on, then stays at ``stop_enu_m``."""
        if not self.airborne:
            return
        self._cut(now_s)
        flown = list(pieces)
        self._pieces += flown
        ends_s = flown[-1].end_s if flown else now_s
        self._pieces.append(MotionPiece(ends_s, math.inf, stop_enu_m))

    def touch_down(self, at_s: float) -> None:
        """It is on the ground from then on, which may be to come."""
        if not self.flights_s or at_s >= self.flights_s[-1][1]:
            return
        self._cut(at_s)
        begun_s, _ = self.flights_s.pop()
        if at_s > begun_s:
            self.flights_s.append((begun_s, at_s))

    def pieces(self, since_s: float = 0.0, until_s: float = math.inf) -> list[MotionPiece]:
        """Its flight between two instants."""
        return [
            replace(rest, end_s=min(rest.end_s, until_s))
            for rest in (piece.since(since_s) for piece in self._pieces if piece.end_s > since_s)
            if rest.begin_s < until_s
        ]

    def position_enu_m(self, now_s: float) -> Point | None:
        """Place at that instant [m]; None on the ground."""
        for piece in reversed(self._pieces):
            if piece.begin_s <= now_s <= piece.end_s:
                return piece.position_enu_m(now_s)
        return None

    def stood_until(self, at_s: float) -> bool:
        """Whether it was on the ground right before that instant."""
        return self.position_enu_m(math.nextafter(at_s, -math.inf)) is None

    def _cut(self, at_s: float) -> None:
        """Forget what was to come after that."""
        while self._pieces and self._pieces[-1].begin_s >= at_s:
            self._pieces.pop()
        if self._pieces and self._pieces[-1].end_s > at_s:
            self._pieces[-1] = replace(self._pieces[-1], end_s=at_s)


def drifting(pieces: Iterable[MotionPiece], before_m: Point, after_m: Point) -> list[MotionPiece]:
    """``pieces`` as flown by one that is ``before_m`` beside them first and ``after_m`` in the end.

    The offset changes evenly from the beginning of the first to the end of the last; of a way so
    short that no time passes for a clock it is that of its end.
    """
    flown = list(pieces)
    if not flown or (before_m == _AT_REST and after_m == _AT_REST):
        return flown
    begun_s = flown[0].begin_s
    duration_s = flown[-1].end_s - begun_s
    if duration_s == 0.0:
        return [replace(each, place_enu_m=plus(each.place_enu_m, after_m)) for each in flown]
    whole = minus(after_m, before_m)
    drift = (whole[0] / duration_s, whole[1] / duration_s, whole[2] / duration_s)
    return [
        replace(
            piece,
            place_enu_m=plus(
                piece.place_enu_m,
                between(before_m, after_m, (piece.begin_s - begun_s) / duration_s),
            ),
            velocity_enu_m_s=plus(piece.velocity_enu_m_s, drift),
        )
        for piece in flown
    ]
