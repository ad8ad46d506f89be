"""A way along corners as a function of time, and the pieces of even acceleration it is made of.

Leaves out: how long it takes (swarm.allocation.legs.flight).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, replace

from sim.world.motion import IdealMotion, Point, Ramps, between, minus

_AT_REST: Point = (0.0, 0.0, 0.0)
_LEAST_S = 1e-12
"""Shorter pieces are none: ramps that end where cruising begins [s]."""


@dataclass(frozen=True, slots=True)
class MotionPiece:
    """Flight with even acceleration from one instant to another."""

    begin_s: float
    end_s: float
    """Infinite of the last one, until something else comes."""
    place_enu_m: Point
    """At its beginning."""
    velocity_enu_m_s: Point = _AT_REST
    """At its beginning."""
    acceleration_enu_m_s2: Point = _AT_REST

    def position_enu_m(self, now_s: float) -> Point:
        """Place at an instant between its beginning and its end [m]."""
        east_m, north_m, up_m = (
            place + at_s * (velocity + 0.5 * at_s * acceleration)
            for at_s in (now_s - self.begin_s,)
            for place, velocity, acceleration in zip(
                self.place_enu_m, self.velocity_enu_m_s, self.acceleration_enu_m_s2, strict=True
            )
        )
        return east_m, north_m, up_m

    def since(self, now_s: float) -> MotionPiece:
        """The rest of it."""
        if now_s <= self.begin_s:
            return self
        at_s = now_s - self.begin_s
        east_m_s, north_m_s, up_m_s = (
            velocity + at_s * acceleration
            for velocity, acceleration in zip(
                self.velocity_enu_m_s, self.acceleration_enu_m_s2, strict=True
            )
        )
        place = self.position_enu_m(now_s)
        return replace(
            self, begin_s=now_s, place_enu_m=place, velocity_enu_m_s=(east_m_s, north_m_s, up_m_s)
        )


@dataclass(frozen=True, slots=True)
class FlownPath:
    """A way along corners, flown through without stopping, as a function of time."""

    corners_enu_m: tuple[Point, ...]
    """Both ends included; two at least."""
    shares: tuple[float, ...]
    """Of the whole way at each corner, from 0 to 1."""
    duration_s: float
    ramps: Ramps | None = None
    """How speed changes, in their own time and length; None: evenly flown."""

    @classmethod
    def of(cls, motion: IdealMotion) -> FlownPath:
        """The straight way that ``motion`` was told to fly last; without one, none."""
        duration_s = 0.0 if motion.arrives_s is None else motion.arrives_s - motion.leaves_s
        ends = (motion.start_enu_m, motion.target_enu_m)
        return cls(ends, (0.0, 1.0), duration_s, motion.ramps)

    def lasting(self, duration_s: float) -> FlownPath:
        """The same way in another time."""
        return replace(self, duration_s=duration_s)

    def share(self, at_s: float) -> float:
        """What share of the way is flown after a time."""
        if at_s >= self.duration_s:
            return 1.0
        share = max(0.0, at_s / self.duration_s)
        if self.ramps is None:
            return share
        return min(1.0, self.ramps.flown_m(share * self.ramps.duration_s) / self.ramps.length_m)

    def position_enu_m(self, at_s: float) -> Point:
        """Place after a time [m]; the last corner exactly from the end on."""
        share = self.share(at_s)
        if share >= 1.0:
            return self.corners_enu_m[-1]
        number = self._piece_at(share)
        first, last = self.shares[number : number + 2]
        begin, end = self.corners_enu_m[number : number + 2]
        return between(begin, end, (share - first) / (last - first))

    def corners_ahead_enu_m(self, at_s: float) -> tuple[Point, ...]:
        """What is left of the corners after a time [m], the end included; none from the end on."""
        share = self.share(at_s)
        return () if share >= 1.0 else self.corners_enu_m[self._piece_at(share) + 1 :]

    def velocity_enu_m_s(self, at_s: float) -> Point:
        """Velocity after a time [m/s]; zero before the start and from the end on."""
        if not 0.0 <= at_s < self.duration_s:
            return _AT_REST
        rate_per_s, _ = self._rates(at_s)
        return self._along(self._piece_at(self.share(at_s)), rate_per_s)

    def pieces(self, leaves_s: float) -> list[MotionPiece]:
        """What it is made of, if it is begun at ``leaves_s``."""
        if self.duration_s <= 0.0:
            return []
        cuts_s = [0.0]
        for cut_s in sorted((*self._ramp_ends_s(), *self._corners_s())):
            if cuts_s[-1] + _LEAST_S < cut_s < self.duration_s - _LEAST_S:
                cuts_s.append(cut_s)
        pieces = []
        for begin_s, end_s in itertools.pairwise([*cuts_s, self.duration_s]):
            middle_s = 0.5 * (begin_s + end_s)
            number = self._piece_at(self.share(middle_s))
            rate_per_s, change_per_s2 = self._rates(middle_s)
            begins_per_s = rate_per_s - change_per_s2 * (middle_s - begin_s)
            pieces.append(
                MotionPiece(
                    leaves_s + begin_s,
                    leaves_s + end_s,
                    self.position_enu_m(begin_s),
                    self._along(number, begins_per_s),
                    self._along(number, change_per_s2),
                )
            )
        return pieces

    def _piece_at(self, share: float) -> int:
        """Between which corners that is; of equal ones never."""
        last = len(self.shares) - 2
        for number in range(last + 1):
            if share < self.shares[number + 1]:
                return number
        while last > 0 and self.shares[last] >= self.shares[last + 1]:
            last -= 1
        return last

    def _along(self, number: int, rate_per_s: float) -> Point:
        """Velocity or acceleration between two corners, from shares of the way per time."""
        first, last = self.shares[number : number + 2]
        if last <= first:
            return _AT_REST
        way = minus(self.corners_enu_m[number + 1], self.corners_enu_m[number])
        by = rate_per_s / (last - first)
        return way[0] * by, way[1] * by, way[2] * by

    def _rates(self, at_s: float) -> tuple[float, float]:
        """How fast the share grows [1/s], and how fast that changes [1/s²]."""
        ramps = self.ramps
        if ramps is None:
            return 1.0 / self.duration_s, 0.0
        pace = ramps.duration_s / self.duration_s
        told_s = at_s * pace
        change_m_s2 = 0.0
        if told_s <= ramps.change_s:
            change_m_s2 = ramps.change_m_s2
        elif told_s >= ramps.braking_s:
            change_m_s2 = -ramps.brake_m_s2
        length_m = ramps.length_m
        return ramps.speed_m_s(told_s) * pace / length_m, change_m_s2 * pace**2 / length_m

    def _ramp_ends_s(self) -> Iterable[float]:
        ramps = self.ramps
        if ramps is None:
            return []
        pace = ramps.duration_s / self.duration_s
        ends_s = (ramps.change_s / pace, ramps.braking_s / pace)
        return [end_s for end_s in ends_s if 0.0 < end_s < self.duration_s]

    def _corners_s(self) -> Iterable[float]:
        """When the corners between both ends are passed [s]."""
        inner = [share for share in self.shares if 0.0 < share < 1.0]
        if self.ramps is None:
            return [share * self.duration_s for share in inner]
        pace, length_m = self.ramps.duration_s / self.duration_s, self.ramps.length_m
        return [self.ramps.reached_s(share * length_m) / pace for share in inner]
