"""Times of legs and lines: way round zones, wind, acceleration.

Leaves out: when they are flown (tests.support.field_oracle.schedule).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass

from tests.support.field_oracle.geometry import Piece, StraightWays, Way, straight_way
from tests.support.field_oracle.rounded import RoundedWays
from tests.support.field_oracle.scenario import (
    FieldScenario,
    FieldTask,
    FieldUav,
    FieldZone,
    Point,
    Stop,
)


@dataclass(frozen=True, slots=True)
class Leg:
    """A flight from rest to rest."""

    way: Way
    length_m: float
    """With the difference of heights."""
    time_s: float


def rest_to_rest_s(length_m: float, speed_m_s: float, acceleration_m_s2: float | None) -> float:
    """Time of a leg of that length."""
    if acceleration_m_s2 is None:
        return length_m / speed_m_s
    if length_m >= speed_m_s**2 / acceleration_m_s2:
        return length_m / speed_m_s + speed_m_s / acceleration_m_s2
    return 2.0 * math.sqrt(length_m / acceleration_m_s2)


def speed_over_ground_m_s(uav: FieldUav, wind_m_s: Point, direction: Point) -> float | None:
    """Speed along ``direction``, a unit vector; None if it can't be flown."""
    if uav.airspeed_m_s is None:
        return uav.speed_m_s
    along = wind_m_s[0] * direction[0] + wind_m_s[1] * direction[1]
    across = (wind_m_s[0] - along * direction[0], wind_m_s[1] - along * direction[1])
    squared = uav.airspeed_m_s**2 - (across[0] ** 2 + across[1] ** 2)
    if squared < 0.0:
        return None
    speed_m_s = min(uav.speed_m_s, along + math.sqrt(squared))
    return speed_m_s if speed_m_s > 0.0 else None


class FlightTimes:
    """All legs and lines of one scenario, each worked out once."""

    def __init__(self, scenario: FieldScenario) -> None:
        self._scenario = scenario
        self._finders: dict[tuple[str, ...], StraightWays | RoundedWays] = {}
        self._ways: dict[tuple[tuple[str, ...], Point, Point], Way | None] = {}
        self._legs: dict[tuple[str, str, str], Leg | None] = {}
        self._lines: dict[tuple[str, str, bool], float | None] = {}
        self._homes: dict[tuple[str, str], tuple[Stop, Leg] | None] = {}

    def leg(self, uav: FieldUav, a: Stop, b: Stop) -> Leg | None:
        """The leg of ``uav`` from ``a`` to ``b``; None if it can't be flown."""
        key = (uav.id, a.name, b.name)
        if key not in self._legs:
            self._legs[key] = self._leg(uav, a, b)
        return self._legs[key]

    def line_s(self, uav: FieldUav, task: FieldTask, *, backwards: bool) -> float | None:
        """Time of flying a line; 0 at a place; None if it can't be flown."""
        key = (uav.id, task.id, backwards)
        if key not in self._lines:
            self._lines[key] = self._line_s(uav, task, backwards=backwards)
        return self._lines[key]

    def home(self, uav: FieldUav, here: Stop) -> tuple[Stop, Leg] | None:
        """The quickest way to the own start or a base, the start first if as quick."""
        key = (uav.id, here.name)
        if key not in self._homes:
            self._homes[key] = self._home(uav, here)
        return self._homes[key]

    def zones_of(self, uav: FieldUav, a: Stop, b: Stop) -> list[FieldZone]:
        """The zones that concern ``uav`` on the leg from ``a`` to ``b``."""
        if self._scenario.band_m is not None:
            low_m, high_m = self._scenario.band_m
        else:
            heights = (a.flown_m(uav.layer_m), b.flown_m(uav.layer_m))
            low_m, high_m = min(heights), max(heights)
        return [
            zone
            for zone in self._scenario.zones
            if zone.floor_m <= high_m and low_m <= zone.ceiling_m
        ]

    def way(self, zones: Iterable[FieldZone], a: Point, b: Point) -> Way | None:
        """The shortest horizontal way."""
        concerned = tuple(zones)
        ids = tuple(zone.id for zone in concerned)
        if (ids, a, b) not in self._ways:
            if ids not in self._finders:
                margin_m = self._scenario.margin_m
                self._finders[ids] = (
                    RoundedWays(concerned, margin_m) if margin_m > 0.0 else StraightWays(concerned)
                )
            self._ways[ids, a, b] = self._finders[ids].find(a, b)
        return self._ways[ids, a, b]

    def _leg(self, uav: FieldUav, a: Stop, b: Stop) -> Leg | None:
        way = self.way(self.zones_of(uav, a, b), a.at, b.at)
        if way is None:
            return None
        length_m = math.sqrt(way.length_m**2 + (b.up_m - a.up_m) ** 2)
        time_s = self._time_s(uav, way.pieces, length_m)
        return None if time_s is None else Leg(way, length_m, time_s)

    def _line_s(self, uav: FieldUav, task: FieldTask, *, backwards: bool) -> float | None:
        stops = task.way(backwards=backwards)
        pieces = []
        for a, b in itertools.pairwise(stops):
            flat = straight_way([a.at, b.at])
            slanted_m = math.sqrt(flat.length_m**2 + (b.up_m - a.up_m) ** 2)
            pieces += [Piece(piece.direction, slanted_m) for piece in flat.pieces]
        return self._time_s(uav, pieces, math.fsum(piece.length_m for piece in pieces))

    def _time_s(self, uav: FieldUav, pieces: Iterable[Piece], length_m: float) -> float | None:
        """Rest to rest, at the speed that the pieces give together."""
        flown = list(pieces)
        speed_m_s = uav.speed_m_s
        if flown and uav.airspeed_m_s is not None:
            spent_s = []
            for piece in flown:
                piece_m_s = speed_over_ground_m_s(uav, self._scenario.wind_m_s, piece.direction)
                if piece_m_s is None:
                    return None
                spent_s.append(piece.length_m / piece_m_s)
            speed_m_s = math.fsum(piece.length_m for piece in flown) / math.fsum(spent_s)
        return rest_to_rest_s(length_m, speed_m_s, uav.acceleration_m_s2)

    def _home(self, uav: FieldUav, here: Stop) -> tuple[Stop, Leg] | None:
        best: tuple[Stop, Leg] | None = None
        for stop in (uav.start, *(base.stop for base in self._scenario.bases)):
            leg = self.leg(uav, here, stop)
            if leg is not None and (best is None or leg.time_s < best[1].time_s):
                best = (stop, leg)
        return best
