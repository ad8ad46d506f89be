"""Which corner of a path a vehicle is told to fly to: the next is told before it stops there.

A vehicle that is told another place in flight brakes along its old way while it gathers speed on
the new one, both with its acceleration: so it bends round the corner on a parabola. The nearer to
the corner it is told, the slower it has become and the less it cuts. It is told as early as
corners are cut by no more than is allowed, and no zone is touched by that bend, nor by the
straight way that a vehicle without inertia would take.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from agent.vehicle.zone_guard import ZoneGuard
from swarm.protocol.fields import Point

_STEPS = 8
"""Places on a bend at which it is looked at."""

_SLOW_M_S = 0.1


class FlightPath:
    """One path under way.

    Args:
        points_enu_m: corners, then where to stop [m; mission origin].
        corner_m: how far corners may be cut [m].
        acceleration_m_s2: with which the vehicle brakes and speeds up.
        guard: the zones on the way.
    """

    def __init__(
        self,
        points_enu_m: Sequence[Point],
        corner_m: float,
        acceleration_m_s2: float,
        guard: ZoneGuard,
    ) -> None:
        self._points = tuple(points_enu_m)
        self._corner_m = corner_m
        self._acceleration_m_s2 = acceleration_m_s2
        self._guard = guard
        self._aim = 0
        self._passing: list[Point] = []
        """Corners turned away from before they were passed: they count until they are."""

    @property
    def aim_enu_m(self) -> Point:
        """Where to fly to now [m]."""
        return self._points[self._aim]

    @property
    def is_last(self) -> bool:
        """Whether that is the end of the path."""
        return self._aim == len(self._points) - 1

    def advance(self, place_enu_m: Point, velocity_enu_m_s: Point, reached_m: float) -> bool:
        """Turn to a corner farther on, if it is time; whether it was.

        Args:
            place_enu_m: where the vehicle is [m].
            velocity_enu_m_s: how it flies.
            reached_m: a corner that near is reached, however it is flown [m].
        """
        before = self._aim
        self._passing = [
            corner for corner in self._passing if _is_ahead(corner, place_enu_m, velocity_enu_m_s)
        ]
        while not self.is_last:
            near = math.dist(place_enu_m, self.aim_enu_m) <= reached_m
            if not near and not self._bends_well(place_enu_m, velocity_enu_m_s, before):
                break
            self._passing.append(self.aim_enu_m)
            self._aim += 1
        return self._aim > before

    def _bends_well(self, place: Point, velocity: Point, first: int) -> bool:
        """Whether turning to the corner after the aim leaves out none by more than is allowed."""
        bend = self._bend(place, velocity, self._points[first], self._points[self._aim + 1])
        skipped = (*self._passing, self.aim_enu_m)
        cut_m = max(_distance_m(corner, bend) for corner in skipped)
        if cut_m > self._corner_m:
            return False
        # Whatever else is flown lies between the bend and the straight way.
        return self._guard.clear((place, bend[-1])) and self._guard.clear(bend)

    def _bend(self, place: Point, velocity: Point, corner: Point, there: Point) -> list[Point]:
        """What is flown if the vehicle is told to go ``there`` now, on its way to ``corner``."""
        speed_m_s = math.hypot(*velocity)
        if speed_m_s <= _SLOW_M_S:
            return [place, there]
        brakes_m = speed_m_s**2 / (2.0 * self._acceleration_m_s2)
        brakes_m = min(brakes_m, math.dist(place, corner))
        stop = _plus(place, velocity, brakes_m / speed_m_s)
        away_m = math.dist(stop, there)
        onward = tuple(b - a for a, b in zip(stop, there, strict=True))
        gains_m = min(brakes_m, away_m)
        bend = []
        for step in range(_STEPS + 1):
            share = step / _STEPS
            back = _plus(stop, velocity, -((1.0 - share) ** 2) * brakes_m / speed_m_s)
            bend.append(_plus(back, onward, share**2 * gains_m / away_m if away_m else 0.0))
        return [*bend, there]


def _plus(point: Point, direction: Sequence[float], times: float) -> Point:
    east, north, up = direction
    return point[0] + times * east, point[1] + times * north, point[2] + times * up


def _is_ahead(corner: Point, place: Point, velocity: Point) -> bool:
    return sum(v * (c - p) for v, c, p in zip(velocity, corner, place, strict=True)) > 0.0


def _distance_m(point: Point, line: Sequence[Point]) -> float:
    return min(_from_piece_m(point, a, b) for a, b in pairwise(line))


def _from_piece_m(point: Point, begin: Point, end: Point) -> float:
    way = tuple(b - a for a, b in zip(begin, end, strict=True))
    length2 = sum(each * each for each in way)
    along = sum((p - a) * w for p, a, w in zip(point, begin, way, strict=True))
    share = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
    return math.dist(point, _plus(begin, way, share))
