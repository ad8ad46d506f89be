"""Shortest paths among zones once more, slow and plain: what the product's are held against.

Knows no geometry library: a piece is cut where it crosses borders, and the middle of each part is
asked whether it lies inside, by counting crossings of a ray. Distances are those of segments. With
a margin paths bend at places spread round every corner, so they are a little too long.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from swarm.model.ids import ZoneId
from swarm.model.rings import Corner
from swarm.model.zones import Zone

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
        begins = [begin_m for _, begin_m, _ in self.zones]
        self.corners_m = np.concatenate([np.empty((0, 2)), *begins])

    def depth_m(self, place_m: FloatArray) -> FloatArray:
        """(...) how deep (..., 2) places lie inside, the margin included; negative outside."""
        deepest = np.full(place_m.shape[:-1], -np.inf)
        for inclusive, begin_m, end_m in self.zones:
            border_m = apart_m(place_m[..., None, :], begin_m, end_m).min(axis=-1)
            kept_out = within(place_m, begin_m, end_m) != inclusive
            deepest = np.maximum(deepest, np.where(kept_out, border_m, -border_m))
        return deepest + self.margin_m

    def depth_along_m(self, from_m: FloatArray, to_m: FloatArray) -> FloatArray:
        """(n,) the same of a deep place of each straight piece; of the deepest if it is outside."""
        deepest = np.maximum(self.depth_m(from_m), self.depth_m(to_m))
        p, q = from_m[:, None], to_m[:, None]
        for _, begin_m, end_m in self.zones:
            cut = crossing(p, q, begin_m, end_m)
            border_m = np.minimum(apart_m(p, begin_m, end_m), apart_m(q, begin_m, end_m))
            for corner_m in (begin_m, end_m):
                border_m = np.minimum(border_m, apart_m(corner_m, p, q))
            border_m[np.isfinite(cut)] = 0.0
            deepest = np.maximum(deepest, self.margin_m - border_m.min(axis=1))
            cut[~np.isfinite(cut)] = 0.0
            ends = np.zeros((len(from_m), 1))
            cut = np.sort(np.concatenate([ends, cut, ends + 1.0], axis=1), axis=1)
            middle = (cut[:, 1:, None] + cut[:, :-1, None]) / 2
            deepest = np.maximum(deepest, self.depth_m(p + middle * (q - p)).max(axis=1))
        return deepest

    def length_m(self, from_m: FloatArray, to_m: FloatArray) -> float:
        """Shortest path over places at corners; inf: none."""
        places_m = np.concatenate([from_m[None], to_m[None], self._bends_m()])
        least_m = np.full(len(places_m), np.inf)
        least_m[0] = 0.0
        open_m = least_m.copy()
        while np.isfinite(open_m).any():
            here = int(open_m.argmin())
            if here == 1:
                break
            open_m[here] = np.inf
            ahead_m = least_m[here] + np.hypot(*(places_m - places_m[here]).T)
            nearer = np.flatnonzero(ahead_m < least_m)
            from_here_m = np.broadcast_to(places_m[here], (len(nearer), 2))
            nearer = nearer[self.depth_along_m(from_here_m, places_m[nearer]) <= DEPTH_M]
            least_m[nearer] = open_m[nearer] = ahead_m[nearer]
        return float(least_m[1])

    def _bends_m(self) -> FloatArray:
        if self.margin_m == 0.0:
            return self.corners_m
        angles = np.arange(PLACES_ROUND) * 2 * np.pi / PLACES_ROUND
        ring_m = np.column_stack([np.cos(angles), np.sin(angles)])
        ring_m *= self.margin_m / np.cos(np.pi / PLACES_ROUND)
        places_m: FloatArray = (self.corners_m[:, None] + ring_m).reshape(-1, 2)
        return places_m[self.depth_m(places_m) <= DEPTH_M]


def edges(zone: Zone) -> tuple[FloatArray, FloatArray]:
    """(k, 2) beginnings and ends of all edges of a zone."""
    rings = [np.array(ring) for ring in (zone.polygon_enu_m, *zone.holes_enu_m)]
    return np.concatenate(rings), np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])


def within(place_m: FloatArray, begin_m: FloatArray, end_m: FloatArray) -> npt.NDArray[np.bool_]:
    """(...) whether a ray to the east from (..., 2) places crosses edges an odd number of times."""
    east_m, north_m = place_m[..., :1], place_m[..., 1:]
    spans = (begin_m[:, 1] > north_m) != (end_m[:, 1] > north_m)
    rise_m = np.where(end_m[:, 1] == begin_m[:, 1], 1.0, end_m[:, 1] - begin_m[:, 1])
    meets_m = begin_m[:, 0] + (north_m - begin_m[:, 1]) / rise_m * (end_m - begin_m)[:, 0]
    inside: npt.NDArray[np.bool_] = (spans & (east_m < meets_m)).sum(axis=-1) % 2 == 1
    return inside


def crossing(p: FloatArray, q: FloatArray, b: FloatArray, e: FloatArray) -> FloatArray:
    """(...) where along p → q, from 0 to 1, each crosses b → e; nan: nowhere, or parallel."""
    along, edge, over = q - p, e - b, b - p
    with np.errstate(divide="ignore", invalid="ignore"):
        area = along[..., 0] * edge[..., 1] - along[..., 1] * edge[..., 0]
        t = (over[..., 0] * edge[..., 1] - over[..., 1] * edge[..., 0]) / area
        s = (over[..., 0] * along[..., 1] - over[..., 1] * along[..., 0]) / area
    return np.where((t >= 0.0) & (t <= 1.0) & (s >= 0.0) & (s <= 1.0), t, np.nan)


def apart_m(place_m: FloatArray, b: FloatArray, e: FloatArray) -> FloatArray:
    """(...) distances of (..., 2) places and segments from b to e."""
    edge = e - b
    square = np.maximum((edge * edge).sum(axis=-1), 1e-300)
    t = np.clip(((place_m - b) * edge).sum(axis=-1) / square, 0.0, 1.0)
    offset = place_m - b - t[..., None] * edge
    distance_m: FloatArray = np.sqrt((offset * offset).sum(axis=-1))
    return distance_m
