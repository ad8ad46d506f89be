"""Which way lines go with the fewest turns: as few lines as can be, then the least length.

A convex field is narrowest across one of its edges (M. E. Houle and G. T. Toussaint, Computing the
width of a set, 1988, https://doi.org/10.1109/34.6790), so edges of the hull are tried. Where holes
and zones cut lines, another direction may do with fewer: long edges of all rings and every third
degree are tried as well. Lines are counted as middles of strips that the polygons meet; what
cutting adds at slanted borders is left out.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import shapely

FloatArray = npt.NDArray[np.float64]

_STEP_DEG = 3.0
_MOST_EDGES = 400
"""Of the polygons that are counted on; finer ones are simplified."""
_MOST_DIRECTIONS = 40
"""That edges may name."""
_MOST_STRIPS = 400
"""Of more, so many spread evenly are counted."""


def fewest_turns_deg(polygons: shapely.Geometry, apart_m: float) -> float:
    """Heading of the lines, clockwise from north, within 0..180 [deg].

    Args:
        polygons: what they cover [m; east, north].
        apart_m: between neighbouring lines at most [m].
    """
    import shapely

    shape = _simplified(polygons, apart_m / 10.0)
    edges_m = _edges_m(shape)
    hull_m = _edges_m(shapely.convex_hull(polygons))
    long = edges_m[np.hypot(*(edges_m[:, 1] - edges_m[:, 0]).T) >= apart_m]
    candidates = [_directions_deg(hull_m), _directions_deg(long), np.arange(0.0, 180.0, _STEP_DEG)]
    best_deg, least = 0.0, (np.inf, np.inf)
    for heading_deg in np.concatenate(candidates):
        cost = _lines(edges_m, float(heading_deg), apart_m)
        if cost < least:
            best_deg, least = float(heading_deg), cost
    return best_deg


def axes(heading_deg: float) -> FloatArray:
    """(2, 2) from east and north to along and across lines; it is its own inverse."""
    heading_rad = np.radians(heading_deg)
    sine, cosine = np.sin(heading_rad), np.cos(heading_rad)
    turned: FloatArray = np.array([[sine, cosine], [cosine, -sine]])
    return turned


def strips_across(low_m: float, high_m: float, apart_m: float) -> int:
    """How many strips of equal width, ``apart_m`` at most, there are between two borders."""
    return max(1, int(np.ceil((high_m - low_m) / apart_m - 1e-9)))


def _simplified(polygons: shapely.Geometry, by_m: float) -> shapely.Geometry:
    import shapely

    shape = shapely.simplify(polygons, by_m)
    while shapely.get_num_coordinates(shape) > _MOST_EDGES:
        by_m *= 2.0
        coarser = shapely.simplify(polygons, by_m)
        if shapely.is_empty(coarser):
            break
        shape = coarser
    return polygons if shapely.is_empty(shape) else shape


def _edges_m(polygons: shapely.Geometry) -> FloatArray:
    """(edges, 2, 2) ends of the edges of all rings, outer ones and holes in opposite sense."""
    import shapely

    pairs = []
    for part in shapely.get_parts(shapely.orient_polygons(polygons)):
        for ring in (part.exterior, *part.interiors):
            corners_m = shapely.get_coordinates(ring)
            pairs.append(np.stack([corners_m[:-1], corners_m[1:]], axis=1))
    return np.concatenate(pairs)


def _directions_deg(edges_m: FloatArray) -> FloatArray:
    """Those of the longest edges, each once, longest first."""
    east_m, north_m = (edges_m[:, 1] - edges_m[:, 0]).T
    longest = np.argsort(-np.hypot(east_m, north_m), kind="stable")
    heading_deg = np.degrees(np.arctan2(east_m, north_m))[longest] % 180.0
    _, first = np.unique(np.round(heading_deg, 6), return_index=True)
    distinct_deg: FloatArray = heading_deg[np.sort(first)]
    return distinct_deg[:_MOST_DIRECTIONS]


def _lines(edges_m: FloatArray, heading_deg: float, apart_m: float) -> tuple[float, float]:
    """How many lines there are at a heading, and how long they are together [m]."""
    along_m, across_m = np.moveaxis(edges_m @ axes(heading_deg), 2, 0)
    low_m, high_m = float(across_m.min()), float(across_m.max())
    strips = strips_across(low_m, high_m, apart_m)
    counted = min(strips, _MOST_STRIPS)
    middles_m = low_m + (np.arange(counted) + 0.5) * ((high_m - low_m) / counted)
    below = across_m[:, :, None] <= middles_m
    up, down = below[:, 0] & ~below[:, 1], ~below[:, 0] & below[:, 1]
    edge, middle = np.nonzero(up | down)
    share = (middles_m[middle] - across_m[edge, 0]) / (across_m[edge, 1] - across_m[edge, 0])
    met_m = along_m[edge, 0] + share * (along_m[edge, 1] - along_m[edge, 0])
    length_m = abs(float(np.where(up[edge, middle], met_m, -met_m).sum()))
    scale = strips / counted
    return round(len(edge) / 2 * scale, 3), round(length_m * scale, 1)
