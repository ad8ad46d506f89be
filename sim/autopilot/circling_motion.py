"""How a simulated plane flies: round bends of one radius, to a circle round its target, and on it.

A way is at most three pieces, all flown at one speed: a bend, a straight line that touches it and
the circle, and the circle itself, clockwise as ArduPlane's are, for as long as nothing else is
ordered (Dubins, L. E. (1957), On Curves of Minimal Length with a Constraint on Average Curvature,
https://doi.org/10.2307/2372560, with the circle for an end). Of a bend to the right and one to the
left the shorter way is taken. One that hovers turns on the spot. Heights change on the way, at a
rate of their own. A plane that needs a runway never hovers: it climbs away from the ground straight
ahead, waits on circles only, and comes down round one, or along a line that touches it. Leaves out:
wind, banking, and the time in which rotors and wings take over from each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.world.motion import IdealMotion, Point

_CLIMB_M_S = 3.0
_NO_WAY_M = 1e-6

_Flat = tuple[float, float]


def _turned(vector: _Flat, angle_rad: float) -> _Flat:
    """To the left [east, north]."""
    east, north = vector
    cosine, sine = math.cos(angle_rad), math.sin(angle_rad)
    return cosine * east - sine * north, sine * east + cosine * north


def _along(start: _Flat, direction: _Flat, way_m: float) -> _Flat:
    return start[0] + way_m * direction[0], start[1] + way_m * direction[1]


@dataclass(frozen=True, slots=True)
class _Bend:
    """Part of a circle, or a straight line where there is no ``turn``."""

    start: _Flat
    heading: _Flat
    length_m: float
    radius_m: float
    turn: int
    """1: to the left, -1: to the right, 0: straight."""

    def at(self, way_m: float) -> tuple[_Flat, _Flat]:
        """Place [m] and heading so far along it."""
        if not self.turn:
            return _along(self.start, self.heading, way_m), self.heading
        centre = _along(self.start, _turned(self.heading, self.turn * math.pi / 2.0), self.radius_m)
        angle_rad = self.turn * way_m / self.radius_m
        east, north = _turned((self.start[0] - centre[0], self.start[1] - centre[1]), angle_rad)
        return (centre[0] + east, centre[1] + north), _turned(self.heading, angle_rad)


def _way(place: _Flat, heading: _Flat | None, target: _Flat, radius_m: float) -> tuple[_Bend, ...]:
    """Bend, line and endless circle round the target; no bend without a heading."""
    away = target[0] - place[0], target[1] - place[1]
    away_m = math.hypot(*away)
    if heading is None:
        if away_m > radius_m:
            line_m = math.sqrt(away_m * away_m - radius_m * radius_m)
            straight = _turned((away[0] / away_m, away[1] / away_m), math.atan2(radius_m, line_m))
            return _closed((), place, straight, line_m, radius_m)
        heading = (0.0, 1.0) if away_m <= _NO_WAY_M else (away[0] / away_m, away[1] / away_m)
    ways = [_bent(place, heading, target, radius_m, turn) for turn in (-1, 1)]
    found = [way for way in ways if way is not None]
    return min(found, key=lambda way: sum(piece.length_m for piece in way[:-1]))


def _bent(
    place: _Flat, heading: _Flat, target: _Flat, radius_m: float, turn: int
) -> tuple[_Bend, ...] | None:
    """The way that begins with that turn; None if there is none."""
    centre = _along(place, _turned(heading, turn * math.pi / 2.0), radius_m)
    away = target[0] - centre[0], target[1] - centre[1]
    away_m = math.hypot(*away)
    across_m = 0.0 if turn < 0 else 2.0 * radius_m
    if away_m < across_m:
        return None
    line_m = math.sqrt(away_m * away_m - across_m * across_m)
    straight = heading
    if away_m > _NO_WAY_M:
        unit = away[0] / away_m, away[1] / away_m
        straight = _turned(unit, math.atan2(across_m, line_m))
    cosine = heading[0] * straight[0] + heading[1] * straight[1]
    sine = heading[0] * straight[1] - heading[1] * straight[0]
    angle_rad = (turn * math.atan2(sine, cosine)) % math.tau
    if math.tau - angle_rad < _NO_WAY_M:
        angle_rad = 0.0
    bend = _Bend(place, heading, angle_rad * radius_m, radius_m, turn)
    return _closed((bend,), bend.at(bend.length_m)[0], straight, line_m, radius_m)


def _closed(
    before: tuple[_Bend, ...], place: _Flat, straight: _Flat, line_m: float, radius_m: float
) -> tuple[_Bend, ...]:
    line = _Bend(place, straight, line_m, radius_m, 0)
    circle = _Bend(_along(place, straight, line_m), straight, math.inf, radius_m, -1)
    return *before, line, circle


class CirclingMotion(IdealMotion):
    """Flies as `IdealMotion` where it hovers, and on wings round the targets of `circle`.

    Args:
        start_enu_m: where it stands [m].
        radius_m: of its bends and circles.
    """

    def __init__(self, start_enu_m: Point, radius_m: float) -> None:
        super().__init__(start_enu_m)
        self._radius_m = radius_m
        self._way: tuple[_Bend, ...] = ()
        """Empty: it hovers."""
        self._speed_m_s = 0.0
        self._began_s = 0.0
        self._began_up_m = start_enu_m[2]
        self._rises_m_s = _CLIMB_M_S
        """At which its height changes."""
        self._level_s = 0.0
        """For how long it does not, at first."""

    def circle(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Leave for the circle round a target at once, and stay on it."""
        (east_m, north_m, up_m), heading = self.position_enu_m(now_s), None
        if self._way:
            heading = self._at(now_s)[1]
        place, target = (east_m, north_m), (target_enu_m[0], target_enu_m[1])
        self._way = _way(place, heading, target, self._radius_m)
        self._speed_m_s, self._began_s, self._began_up_m = speed_m_s, now_s, up_m
        self._rises_m_s, self._level_s = _CLIMB_M_S, 0.0
        self.target_enu_m = target_enu_m
        self.arrives_s = now_s + sum(each.length_m for each in self._way[:-1]) / speed_m_s

    def _at(self, now_s: float) -> tuple[_Flat, _Flat]:
        way_m = max(0.0, now_s - self._began_s) * self._speed_m_s
        for piece in self._way[:-1]:
            if way_m < piece.length_m:
                return piece.at(way_m)
            way_m -= piece.length_m
        return self._way[-1].at(way_m)

    def _rise_m(self, now_s: float) -> float:
        """How far it has come to the height of its target [m]."""
        whole_m = self.target_enu_m[2] - self._began_up_m
        most_m = self._rises_m_s * max(0.0, now_s - self._began_s - self._level_s)
        return math.copysign(min(abs(whole_m), most_m), whole_m)

    def position_enu_m(self, now_s: float) -> Point:
        """Place at that instant [m]."""
        if not self._way:
            return super().position_enu_m(now_s)
        return (*self._at(now_s)[0], self._began_up_m + self._rise_m(now_s))

    def velocity_enu_m_s(self, now_s: float) -> Point:
        """Velocity at that instant [m/s]."""
        if not self._way:
            return super().velocity_enu_m_s(now_s)
        east, north = self._at(now_s)[1]
        whole_m = self.target_enu_m[2] - self._began_up_m
        rises = abs(self._rise_m(now_s)) < abs(whole_m)
        changes = rises and now_s >= self._began_s + self._level_s
        up_m_s = math.copysign(self._rises_m_s, whole_m) if changes else 0.0
        return self._speed_m_s * east, self._speed_m_s * north, up_m_s

    def fly_to(
        self,
        target_enu_m: Point,
        speed_m_s: float,
        now_s: float,
        acceleration_m_s2: float | None = None,
    ) -> None:
        """Straight there, on rotors."""
        self.stop(now_s)
        super().fly_to(target_enu_m, speed_m_s, now_s, acceleration_m_s2)

    def stop(self, now_s: float) -> None:
        """Hover where it is."""
        if self._way:
            self.target_enu_m = self.position_enu_m(now_s)
            self._way, self.arrives_s = (), None
        super().stop(now_s)


class RunwayMotion(CirclingMotion):
    """Never hovers: takes off straight ahead, and lands round a circle or along a line.

    Args:
        start_enu_m: where it stands [m].
        radius_m: of its bends and circles.
        heading_rad: in which it stands, clockwise from north.
        speed_m_s: at which it takes off, comes down and waits.
    """

    def __init__(
        self, start_enu_m: Point, radius_m: float, heading_rad: float, speed_m_s: float
    ) -> None:
        super().__init__(start_enu_m, radius_m)
        self._stands: _Flat = math.sin(heading_rad), math.cos(heading_rad)
        self._own_m_s = speed_m_s
        self._lands = False
        """It stands at the end of this way."""

    def circle(self, target_enu_m: Point, speed_m_s: float, now_s: float) -> None:
        """Leave for the circle round a target at once, and stay on it."""
        self._lands = False
        super().circle(target_enu_m, speed_m_s, now_s)

    def fly_to(
        self,
        target_enu_m: Point,
        speed_m_s: float,
        now_s: float,
        acceleration_m_s2: float | None = None,
    ) -> None:
        """Change its height at that speed: from the ground straight ahead, else on a circle.

        Lower it comes down for good.
        """
        del acceleration_m_s2
        east_m, north_m, up_m = self.position_enu_m(now_s)
        whole_m = target_enu_m[2] - up_m
        if self._way:
            self.circle(target_enu_m, self._own_m_s, now_s)
        else:
            line = _Bend((east_m, north_m), self._stands, math.inf, self._radius_m, 0)
            self._way, self._speed_m_s = (line,), self._own_m_s
            self._began_s, self._began_up_m, self._level_s = now_s, up_m, 0.0
            self.target_enu_m = target_enu_m
        self._rises_m_s, self._lands = speed_m_s, whole_m < 0.0
        self.arrives_s = now_s + abs(whole_m) / speed_m_s

    def glide(self, target_enu_m: Point, now_s: float) -> None:
        """Leave the circle where its tangent leads to a place, and come down on that line."""
        up_m = self.position_enu_m(now_s)[2]
        place, heading = self._at(now_s)
        bent = _bent_to(place, heading, (target_enu_m[0], target_enu_m[1]), self._radius_m)
        self._way, self._speed_m_s, self._lands = bent, self._own_m_s, True
        self._began_s, self._began_up_m, self.target_enu_m = now_s, up_m, target_enu_m
        bend_m, line_m = (piece.length_m for piece in bent)
        self._level_s = bend_m / self._own_m_s
        self._rises_m_s = abs(target_enu_m[2] - up_m) * self._own_m_s / line_m
        self.arrives_s = now_s + (bend_m + line_m) / self._own_m_s

    def climb_to(self, target_enu_m: Point, now_s: float) -> None:
        """To the circle round a target, and round it until the height is right."""
        rise_m = abs(target_enu_m[2] - self.position_enu_m(now_s)[2])
        self.circle(target_enu_m, self._own_m_s, now_s)
        reached_s = now_s if self.arrives_s is None else self.arrives_s
        self.arrives_s = max(reached_s, now_s + rise_m / self._rises_m_s)

    def stop(self, now_s: float) -> None:
        """Circle where it is; or stand there, if it has come down."""
        place_enu_m = self.position_enu_m(now_s)
        if self._way and not self._lands:
            self.circle(place_enu_m, self._own_m_s, now_s)
            self.arrives_s = None
            return
        if self._way:
            self._stands = self._at(now_s)[1]
        self._way = ()
        self.target_enu_m, self.arrives_s = place_enu_m, None


def _bent_to(place: _Flat, heading: _Flat, target: _Flat, radius_m: float) -> tuple[_Bend, _Bend]:
    """To the right on its circle until the target is straight ahead, then there."""
    centre = _along(place, _turned(heading, -math.pi / 2.0), radius_m)
    away = target[0] - centre[0], target[1] - centre[1]
    away_m = max(math.hypot(*away), radius_m + _NO_WAY_M)
    line_m = math.sqrt(away_m * away_m - radius_m * radius_m)
    straight = _turned((away[0] / away_m, away[1] / away_m), -math.atan2(radius_m, line_m))
    cosine = heading[0] * straight[0] + heading[1] * straight[1]
    sine = heading[0] * straight[1] - heading[1] * straight[0]
    angle_rad = (-math.atan2(sine, cosine)) % math.tau
    bend = _Bend(place, heading, angle_rad * radius_m, radius_m, -1)
    return bend, _Bend(bend.at(bend.length_m)[0], straight, line_m, radius_m, 0)
