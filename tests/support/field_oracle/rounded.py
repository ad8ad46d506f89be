"""Shortest horizontal ways that stay a margin away from zones: tangents and arcs.

Such a way is made of arcs round corners, with the margin as radius, and of straight pieces that
touch them. Its length is exact but for rounding (`SLACK_M`). Where a chain of points is asked
for, an arc is given by points on it every `STEP_RAD` at most: the chain is shorter than the arc
by at most STEP_RAD² / 24 = 3e-6 of it. Pieces have the arc's true length and directions such that
the time of flight in wind is that of the arc.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from tests.support.field_oracle.geometry import (
    Piece,
    Side,
    Way,
    boxes_apart_m,
    shortest_chain,
    side_of,
    straight_way,
)
from tests.support.field_oracle.scenario import FieldZone, Point

SLACK_M = 1e-7
"""By so much a way may come nearer than the margin, since tangents are rounded."""
STEP_RAD = math.radians(0.5)
GAUSS = (0.5 - 0.5 / math.sqrt(3.0), 0.5 + 0.5 / math.sqrt(3.0))
"""Where to look on a short arc, so that what is summed up of both is its integral (Gauss)."""


@dataclass(frozen=True, slots=True)
class _Spot:
    """A point of the graph: an end of the way, or a point of the circle round a corner."""

    at: Point
    circle: Point | None = None
    angle_rad: float = 0.0


class RoundedWays:
    """Shortest ways that stay ``margin_m`` > 0 away from some zones."""

    def __init__(self, zones: Sequence[FieldZone], margin_m: float) -> None:
        self._zones = tuple(zones)
        self._margin_m = margin_m
        self._edges = [edge for zone in zones for ring in zone.rings for edge in _edges(ring)]
        self._corners = sorted({corner for edge in self._edges for corner in edge})
        self._between = list(self._tangents_between_circles())
        self._meetings = {corner: list(self._crossings(corner)) for corner in self._corners}
        self._free_arcs: dict[tuple[Point, float, float], bool] = {}

    def find(self, a: Point, b: Point) -> Way | None:
        """The shortest way from ``a`` to ``b``; None if there is none."""
        if self._is_free(a, b):
            return straight_way([a, b])
        first, last = _Spot(a), _Spot(b)
        links: dict[_Spot, dict[_Spot, float]] = {first: {}, last: {}}

        def link(one: _Spot, two: _Spot, length_m: float) -> None:
            links.setdefault(one, {})[two] = length_m
            links.setdefault(two, {})[one] = length_m

        for one, two in self._between:
            link(one, two, math.dist(one.at, two.at))
        for end in (first, last):
            for corner in self._corners:
                for spot in self._tangents_from(end.at, corner):
                    if self._is_free(end.at, spot.at):
                        link(end, spot, math.dist(end.at, spot.at))
        for corner in self._corners:
            spots = [spot for spot in links if spot.circle == corner]
            for one, two in self._arcs(corner, spots):
                link(one, two, self._margin_m * _turn_rad(one.angle_rad, two.angle_rad))
        chain = shortest_chain(links, first, last)
        return None if chain is None else self._way(chain)

    def _way(self, chain: Sequence[_Spot]) -> Way:
        points = [chain[0].at]
        pieces: list[Piece] = []
        for one, two in itertools.pairwise(chain):
            if one.circle is not None and one.circle == two.circle:
                arc_points, arc_pieces = self._arc(one, two)
                points += arc_points
                pieces += arc_pieces
            else:
                points.append(two.at)
                pieces += straight_way([one.at, two.at]).pieces
        return Way(tuple(points), tuple(pieces), math.fsum(piece.length_m for piece in pieces))

    def _arc(self, one: _Spot, two: _Spot) -> tuple[list[Point], list[Piece]]:
        corner = one.circle
        if corner is None:
            raise ValueError("an arc is round a corner")
        turn = (two.angle_rad - one.angle_rad) % math.tau
        sign = 1.0
        if turn > math.pi:  # the shorter side is the one that was linked
            turn, sign = math.tau - turn, -1.0
        n = max(1, math.ceil(turn / STEP_RAD))
        points, pieces = [], []
        for index in range(n):
            end = one.angle_rad + sign * turn * (index + 1) / n
            for share in GAUSS if turn > 0.0 else ():
                angle = one.angle_rad + sign * turn * (index + share) / n
                heading = (-sign * math.sin(angle), sign * math.cos(angle))
                pieces.append(Piece(heading, self._margin_m * turn / (2 * n)))
            points.append(_on_circle(corner, self._margin_m, end))
        points[-1] = two.at
        return points, pieces

    def _tangents_between_circles(self) -> Iterable[tuple[_Spot, _Spot]]:
        radius = self._margin_m
        for index, one in enumerate(self._corners):
            for two in self._corners[index + 1 :]:
                apart_m = math.dist(one, two)
                heading = math.atan2(two[1] - one[1], two[0] - one[0])
                pairs = [(heading + math.pi / 2,) * 2, (heading - math.pi / 2,) * 2]
                if apart_m >= 2.0 * radius:
                    lean = math.acos(min(1.0, 2.0 * radius / apart_m))
                    pairs.append((heading + lean, heading + lean + math.pi))
                    pairs.append((heading - lean, heading - lean + math.pi))
                for angle_one, angle_two in pairs:
                    spots = self._spot(one, angle_one), self._spot(two, angle_two)
                    if self._is_free(spots[0].at, spots[1].at):
                        yield spots

    def _tangents_from(self, end: Point, corner: Point) -> Iterable[_Spot]:
        apart_m = math.dist(end, corner)
        heading = math.atan2(end[1] - corner[1], end[0] - corner[0])
        if apart_m < self._margin_m - SLACK_M:
            return  # the end itself is too near, which is a fault of the file
        if apart_m <= self._margin_m + SLACK_M:
            yield self._spot(corner, heading)
            return
        lean = math.acos(self._margin_m / apart_m)
        yield self._spot(corner, heading + lean)
        yield self._spot(corner, heading - lean)

    def _spot(self, corner: Point, angle_rad: float) -> _Spot:
        return _Spot(_on_circle(corner, self._margin_m, angle_rad), corner, angle_rad % math.tau)

    def _arcs(self, corner: Point, spots: Sequence[_Spot]) -> Iterable[tuple[_Spot, _Spot]]:
        """Neighbours on the circle round ``corner`` with nothing too near between them."""
        ordered = sorted(spots, key=lambda spot: spot.angle_rad)
        for one, two in zip(ordered, [*ordered[1:], *ordered[:1]], strict=True):
            if one is not two and self._is_free_arc(corner, one.angle_rad, two.angle_rad):
                yield one, two

    def _is_free_arc(self, corner: Point, start: float, end: float) -> bool:
        """Of the arc from ``start`` on to ``end``: it changes sides at crossings only."""
        key = (corner, start, end)
        if key not in self._free_arcs:
            self._free_arcs[key] = self._probe_arc(corner, start, end)
        return self._free_arcs[key]

    def _probe_arc(self, corner: Point, start: float, end: float) -> bool:
        turn = (end - start) % math.tau
        if turn > math.pi:
            return False  # a shortest way turns by less than half a circle at any corner
        cuts = sorted((angle - start) % math.tau for angle in self._meetings[corner])
        stations = [0.0, *(cut for cut in cuts if cut < turn), turn]
        middles = [(one + two) / 2 for one, two in itertools.pairwise(stations)]
        probes = [_on_circle(corner, self._margin_m, start + middle) for middle in middles]
        return all(self._is_free(probe, probe) for probe in probes)

    def _crossings(self, corner: Point) -> Iterable[float]:
        """Angles at which the circle round ``corner`` meets what is a margin from an edge."""
        radius = self._margin_m
        for other in self._corners:
            apart_m = math.dist(corner, other)
            if 0.0 < apart_m <= 2.0 * radius:
                heading = math.atan2(other[1] - corner[1], other[0] - corner[0])
                lean = math.acos(apart_m / (2.0 * radius))
                yield from (heading + lean, heading - lean)
        for (ax, ay), (bx, by) in self._edges:
            length_m = math.hypot(bx - ax, by - ay)
            normal = (-(by - ay) / length_m, (bx - ax) / length_m)
            offset_m = (corner[0] - ax) * normal[0] + (corner[1] - ay) * normal[1]
            for side_m in (radius, -radius):
                cosine = (side_m - offset_m) / radius
                if -1.0 <= cosine <= 1.0:
                    heading, lean = math.atan2(normal[1], normal[0]), math.acos(cosine)
                    yield from (heading + lean, heading - lean)

    def _is_free(self, a: Point, b: Point) -> bool:
        """Whether the straight piece keeps the margin to every zone, each by itself."""
        nearest_m = self._margin_m - SLACK_M
        for c, d in self._edges:
            if boxes_apart_m(a, b, c, d) <= nearest_m and distance_m(a, b, c, d) < nearest_m:
                return False
        # So near no border, so on one side of each.
        return all(
            side_of(a, zone.rings) is (Side.INSIDE if zone.inclusive else Side.OUTSIDE)
            for zone in self._zones
        )


def distance_m(a: Point, b: Point, c: Point, d: Point) -> float:
    """The distance of the straight pieces from ``a`` to ``b`` and from ``c`` to ``d``."""
    if _cross(a, b, c) * _cross(a, b, d) < 0.0 and _cross(c, d, a) * _cross(c, d, b) < 0.0:
        return 0.0
    return min(
        _to_piece_m(a, c, d), _to_piece_m(b, c, d), _to_piece_m(c, a, b), _to_piece_m(d, a, b)
    )


def _to_piece_m(point: Point, c: Point, d: Point) -> float:
    sx, sy = d[0] - c[0], d[1] - c[1]
    squared = sx * sx + sy * sy
    share = 0.0
    if squared > 0.0:
        share = ((point[0] - c[0]) * sx + (point[1] - c[1]) * sy) / squared
        share = min(1.0, max(0.0, share))
    return math.hypot(point[0] - c[0] - share * sx, point[1] - c[1] - share * sy)


def _cross(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _edges(ring: Sequence[Point]) -> Iterable[tuple[Point, Point]]:
    return zip(ring, [*ring[1:], ring[0]], strict=True)


def _on_circle(corner: Point, radius_m: float, angle_rad: float) -> Point:
    return (
        corner[0] + radius_m * math.cos(angle_rad),
        corner[1] + radius_m * math.sin(angle_rad),
    )


def _turn_rad(one: float, two: float) -> float:
    turn = (two - one) % math.tau
    return min(turn, math.tau - turn)
