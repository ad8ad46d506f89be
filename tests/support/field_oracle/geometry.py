"""Shortest horizontal ways round zones without a margin, exactly.

A shortest way bends at corners of zones only, also where zones overlap or share an edge. So it is
a shortest way in the graph of all straight pieces between ends and corners that meet no zone's
inside. Whether a piece does is decided in fractions, so that borders count as outside to the last
bit. With a margin corners are round: `tests.support.field_oracle.rounded`.
"""

from __future__ import annotations

import functools
import heapq
import itertools
import math
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from typing import TypeVar

from tests.support.field_oracle.scenario import FieldZone, Point

Node = TypeVar("Node", bound=Hashable)
Exact = tuple[Fraction, Fraction]


class Side(Enum):
    """Where a point lies of a polygon."""

    INSIDE = "inside"
    BORDER = "border"
    OUTSIDE = "outside"


@dataclass(frozen=True, slots=True)
class Piece:
    """A straight piece of a way."""

    direction: Point
    """Unit vector."""
    length_m: float


@dataclass(frozen=True, slots=True)
class Way:
    """A horizontal way from its first point to its last."""

    points: tuple[Point, ...]
    pieces: tuple[Piece, ...]
    """Without those of no length."""
    length_m: float


def straight_way(points: Sequence[Point]) -> Way:
    """The way from point to point."""
    pieces = []
    for (x0, y0), (x1, y1) in itertools.pairwise(points):
        length_m = math.hypot(x1 - x0, y1 - y0)
        if length_m > 0.0:
            pieces.append(Piece(((x1 - x0) / length_m, (y1 - y0) / length_m), length_m))
    return Way(tuple(points), tuple(pieces), math.fsum(piece.length_m for piece in pieces))


def side_of(point: Exact | Point, rings: Sequence[tuple[Point, ...]]) -> Side:
    """Where ``point`` lies of the polygon with that border and those holes."""
    x, y = point
    inside = False
    for ring in rings:
        for (ax, ay), (bx, by) in zip(ring, [*ring[1:], ring[0]], strict=True):
            west, east = (ax, bx) if ax <= bx else (bx, ax)
            # The ray to the east crosses the edge: one end below or level with it, one above.
            crosses = (ay > y) != (by > y)
            if x > east or (x < west and not crosses):
                continue
            if x < west:
                inside = not inside
                continue
            within = ay <= y <= by or by <= y <= ay
            if not within:
                continue
            # Only here fractions are called for.
            rx, ry = Fraction(bx) - Fraction(ax), Fraction(by) - Fraction(ay)
            qx, qy = Fraction(x) - Fraction(ax), Fraction(y) - Fraction(ay)
            if rx * qy == ry * qx:
                return Side.BORDER
            if crosses and qx < qy * rx / ry:
                inside = not inside
    return Side.INSIDE if inside else Side.OUTSIDE


def blocks(zone: FieldZone, a: Point, b: Point) -> bool:
    """Whether the straight piece from ``a`` to ``b`` is forbidden by ``zone`` (no margin)."""
    forbidden = Side.OUTSIDE if zone.inclusive else Side.INSIDE
    if not zone.inclusive and _apart(zone, a, b):
        return False
    if side_of(a, zone.rings) is forbidden:
        return True
    if a == b:
        return False
    if side_of(b, zone.rings) is forbidden:
        return True
    ax, ay = Fraction(a[0]), Fraction(a[1])
    rx, ry = Fraction(b[0]) - ax, Fraction(b[1]) - ay
    # Between two neighbouring meetings with the border the piece lies on one side of it.
    shares = sorted({Fraction(0), Fraction(1), *_meetings(zone, a, b)})
    probes = ((one + two) / 2 for one, two in itertools.pairwise(shares))
    return any(side_of((ax + t * rx, ay + t * ry), zone.rings) is forbidden for t in probes)


class StraightWays:
    """Shortest ways that meet no inside of any of some zones, which have no margin."""

    def __init__(self, zones: Sequence[FieldZone]) -> None:
        self._zones = tuple(zones)
        corners = {corner for zone in zones for ring in zone.rings for corner in ring}
        self._corners = sorted(corners)
        self._sights: dict[tuple[Point, Point], bool] = {}

    def find(self, a: Point, b: Point) -> Way | None:
        """The shortest way from ``a`` to ``b``; None if there is none."""
        if self._sees(a, b):
            return straight_way([a, b])
        places = [a, b, *(corner for corner in self._corners if corner not in (a, b))]
        links: dict[Point, dict[Point, float]] = {place: {} for place in places}
        for index, one in enumerate(places):
            for two in places[index + 1 :]:
                if self._sees(one, two):
                    links[one][two] = links[two][one] = math.dist(one, two)
        chain = shortest_chain(links, a, b)
        return None if chain is None else straight_way(chain)

    def _sees(self, a: Point, b: Point) -> bool:
        key = (a, b) if a <= b else (b, a)
        if key not in self._sights:
            self._sights[key] = not any(blocks(zone, *key) for zone in self._zones)
        return self._sights[key]


def boxes_apart_m(a: Point, b: Point, c: Point, d: Point) -> float:
    """How far the boxes round two straight pieces are apart, east or north; 0 or less: not."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = a, b, c, d
    if bx < ax:
        ax, bx = bx, ax
    if dx < cx:
        cx, dx = dx, cx
    if by < ay:
        ay, by = by, ay
    if dy < cy:
        cy, dy = dy, cy
    return max(ax - dx, cx - bx, ay - dy, cy - by)


def shortest_chain(
    links: Mapping[Node, Mapping[Node, float]], first: Node, last: Node
) -> list[Node] | None:
    """The nodes of a shortest chain of links (Dijkstra); None if there is none."""
    best = {first: 0.0}
    before: dict[Node, Node] = {}
    done: set[Node] = set()
    queue = [(0.0, 0, first)]
    count = 0  # of equal lengths the node that was found first, without comparing nodes
    while queue:
        length_m, _, node = heapq.heappop(queue)
        if node in done:
            continue
        if node == last:
            break
        done.add(node)
        for neighbour, step_m in links[node].items():
            if length_m + step_m < best.get(neighbour, math.inf):
                best[neighbour] = length_m + step_m
                before[neighbour] = node
                count += 1
                heapq.heappush(queue, (length_m + step_m, count, neighbour))
    if last not in best:
        return None
    chain = [last]
    while chain[-1] != first:
        chain.append(before[chain[-1]])
    return chain[::-1]


@functools.cache
def _edges(ring: tuple[Point, ...]) -> tuple[tuple[Exact, Exact], ...]:
    exact = [(Fraction(x), Fraction(y)) for x, y in ring]
    return tuple(zip(exact, [*exact[1:], exact[0]], strict=True))


def _apart(zone: FieldZone, a: Point, b: Point) -> bool:
    """Whether the boxes round piece and zone do not even overlap."""
    xs = [x for x, _ in zone.rings[0]]
    ys = [y for _, y in zone.rings[0]]
    return (
        max(a[0], b[0]) <= min(xs)
        or min(a[0], b[0]) >= max(xs)
        or max(a[1], b[1]) <= min(ys)
        or min(a[1], b[1]) >= max(ys)
    )


def _meetings(zone: FieldZone, start: Point, end: Point) -> Iterable[Fraction]:
    """Shares t of the straight piece at which it meets the border of ``zone``, 0 <= t <= 1."""
    a = Fraction(start[0]), Fraction(start[1])
    r = Fraction(end[0]) - a[0], Fraction(end[1]) - a[1]
    for ring in zone.rings:
        corners = zip(ring, [*ring[1:], ring[0]], strict=True)
        for (one, two), ((cx, cy), (dx, dy)) in zip(corners, _edges(ring), strict=True):
            if boxes_apart_m(start, end, one, two) > 0.0:
                continue
            sx, sy = dx - cx, dy - cy
            qx, qy = cx - a[0], cy - a[1]
            turn = r[0] * sy - r[1] * sx
            if turn != 0:
                t = (qx * sy - qy * sx) / turn
                u = (qx * r[1] - qy * r[0]) / turn
                if 0 <= t <= 1 and 0 <= u <= 1:
                    yield t
            elif qx * r[1] - qy * r[0] == 0 and any(r):  # on one line
                squared = r[0] * r[0] + r[1] * r[1]
                for ex, ey in ((cx, cy), (dx, dy)):
                    t = ((ex - a[0]) * r[0] + (ey - a[1]) * r[1]) / squared
                    if 0 <= t <= 1:
                        yield t
