"""Shortest paths among zones once more, slow and plain: what the product's are held against.

Knows no geometry library: a piece is cut where it crosses borders, and the middle of each part is
asked whether it lies inside, by counting crossings of a ray. Distances are those of segments. With
a margin paths bend at places spread round every corner, so they are a little too long.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from swarm.model.zones import Corner, Zone, ZoneId

FloatArray = npt.NDArray[np.float64]

DEPTH_M = 1e-6
"""Deeper than this is inside."""
PLACES_ROUND = 48
"""How many places stand round a corner when there is a margin."""


def random_zones(
    rng: np.random.Generator, n_zone: int, n_corner: int = 7, size_m: float = 100.0
) -> list[Zone]:
    """Star-shaped zones, convex or not, that may overlap."""
    zones = []
    for number in range(n_zone):
        middle_m = rng.uniform(0.2 * size_m, 0.8 * size_m, 2)
        angles = np.linspace(0.0, 2 * np.pi, n_corner, endpoint=False)
        angles += rng.uniform(0.0, 1.5 * np.pi / n_corner, n_corner)
        radii_m = rng.uniform(0.04, 0.22, n_corner) * size_m
        corners = middle_m + radii_m[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        polygon: tuple[Corner, ...] = tuple((float(x), float(y)) for x, y in corners)
        zones.append(Zone(ZoneId(f"z{number}"), polygon))
    return zones


class PlainZones:
    """Zones as lists of edges."""

    def __init__(self, zones: Sequence[Zone], margin_m: float = 0.0) -> None:
        self.margin_m = margin_m
        self.zones = [(zone.inclusive, *edges(zone)) for zone in zones]
        self.corners_m = np.concatenate(
            [np.empty((0, 2)), *(begin_m for _, begin_m, _ in self.zones)]
        )

    def depth_m(self, place_m: FloatArray) -> float:
        """How deep a place lies inside, the margin included; negative outside."""
        deepest = -math.inf
        for inclusive, begin_m, end_m in self.zones:
            distance_m = min(
                segments_apart_m(place_m, place_m, b, e)
                for b, e in zip(begin_m, end_m, strict=True)
            )
            kept_out = within(place_m, begin_m, end_m) != inclusive
            deepest = max(deepest, self.margin_m + (distance_m if kept_out else -distance_m))
        return deepest

    def depth_along_m(self, from_m: FloatArray, to_m: FloatArray) -> float:
        """The same of the deepest place of a straight piece; exact outside, a bound inside."""
        deepest = max(self.depth_m(from_m), self.depth_m(to_m))
        for _, begin_m, end_m in self.zones:
            crossings = [0.0, 1.0]
            for b, e in zip(begin_m, end_m, strict=True):
                apart_m = segments_apart_m(from_m, to_m, b, e)
                deepest = max(deepest, self.margin_m - apart_m)
                crossings += crossing(from_m, to_m, b, e)
            crossings.sort()
            for low, high in zip(crossings, crossings[1:], strict=False):
                deepest = max(deepest, self.depth_m(from_m + (low + high) / 2 * (to_m - from_m)))
        return deepest

    def clear(self, from_m: FloatArray, to_m: FloatArray) -> bool:
        return self.depth_along_m(from_m, to_m) <= DEPTH_M

    def length_m(self, from_m: FloatArray, to_m: FloatArray) -> float:
        """Shortest path over places at corners; inf: none."""
        places = [from_m, to_m, *self._bends_m()]
        least = [math.inf] * len(places)
        least[0] = 0.0
        queue = [(0.0, 0)]
        done = set()
        while queue:
            flown_m, here = heapq.heappop(queue)
            if here == 1:
                return flown_m
            if here in done:
                continue
            done.add(here)
            for there, place_m in enumerate(places):
                ahead_m = flown_m + math.dist(places[here], place_m)
                if ahead_m < least[there] and self.clear(places[here], place_m):
                    least[there] = ahead_m
                    heapq.heappush(queue, (ahead_m, there))
        return math.inf

    def _bends_m(self) -> list[FloatArray]:
        if self.margin_m == 0.0:
            return list(self.corners_m)
        angles = np.arange(PLACES_ROUND) * 2 * np.pi / PLACES_ROUND
        ring_m = np.column_stack([np.cos(angles), np.sin(angles)])
        ring_m *= self.margin_m / math.cos(np.pi / PLACES_ROUND)
        places = (self.corners_m[:, None] + ring_m).reshape(-1, 2)
        return [place_m for place_m in places if self.depth_m(place_m) <= DEPTH_M]


def edges(zone: Zone) -> tuple[FloatArray, FloatArray]:
    """(k, 2) beginnings and ends of all edges of a zone."""
    rings = [np.array(ring) for ring in (zone.polygon_enu_m, *zone.holes_enu_m)]
    return np.concatenate(rings), np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])


def within(place_m: FloatArray, begin_m: FloatArray, end_m: FloatArray) -> bool:
    """Whether a ray to the east crosses edges an odd number of times."""
    inside = False
    for (bx, by), (ex, ey) in zip(begin_m, end_m, strict=True):
        if (by > place_m[1]) != (ey > place_m[1]):
            east = bx + (place_m[1] - by) / (ey - by) * (ex - bx)
            inside ^= bool(place_m[0] < east)
    return inside


def crossing(p: FloatArray, q: FloatArray, b: FloatArray, e: FloatArray) -> list[float]:
    """Where along p → q it crosses b → e, from 0 to 1; parallels never do."""
    along, edge = q - p, e - b
    area = along[0] * edge[1] - along[1] * edge[0]
    if area == 0.0:
        return []
    t = ((b[0] - p[0]) * edge[1] - (b[1] - p[1]) * edge[0]) / area
    s = ((b[0] - p[0]) * along[1] - (b[1] - p[1]) * along[0]) / area
    return [float(t)] if 0.0 <= t <= 1.0 and 0.0 <= s <= 1.0 else []


def segments_apart_m(p: FloatArray, q: FloatArray, b: FloatArray, e: FloatArray) -> float:
    """Distance of two segments; 0 if they cross."""
    if crossing(p, q, b, e):
        return 0.0
    return min(apart_m(p, b, e), apart_m(q, b, e), apart_m(b, p, q), apart_m(e, p, q))


def apart_m(place_m: FloatArray, b: FloatArray, e: FloatArray) -> float:
    """Distance of a place and a segment."""
    edge = e - b
    square = float(edge @ edge)
    t = 0.0 if square == 0.0 else min(1.0, max(0.0, float((place_m - b) @ edge) / square))
    return math.dist(place_m, b + t * edge)
