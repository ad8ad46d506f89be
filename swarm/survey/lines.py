"""Areas cut into lines, each of which is a task.

Strips of equal width lie side by side across the heading, and each has a line in its middle, as far
as there is anything of it to cover: at a slanted border that is further than the middle itself
lies in the area. Where zones leave no room for a middle, what it would have covered gets lines of
its own. All is decided by the shapes alone, so the same area gives the same lines.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.model import Area, Task, Zone
from swarm.survey.ground import to_cover, without_zones
from swarm.survey.heading import axes, fewest_turns_deg, strips_across

if TYPE_CHECKING:
    import shapely

FloatArray = npt.NDArray[np.float64]

MOST_LINES = 5000
"""Of one area; as many tasks as the largest missions have."""
MOST_CORNERS = 10_000
"""Of one area, holes included."""
_TOO_RAGGED = 10
"""If strips have so many times more pieces than lines may be, they are not cut at all."""
_LEFT_FRAC = 0.001
"""Share of what is to be covered that may be left where zones leave no room."""
_ROUNDS = 8
"""In which what is left gets lines of its own."""
_AT_ONCE = 200_000
"""Corners times strips that are cut at once; larger shapes are halved before."""
_SHORTEST_M = 0.5
"""Nothing is flown along less."""
_ROUND_STEPS = 8
"""Chords per quarter of a circle round the ends of what is covered."""


@dataclass(frozen=True, slots=True)
class Uncut:
    """Why an area has no lines, and what to do about it."""

    problem: str
    remedy: str
    key: str
    """Of the area's table."""


def line_tasks(area: Area, zones: Sequence[Zone], margin_m: float) -> tuple[Task, ...] | Uncut:
    """A task for each line of ``area``, in the order of its strips.

    Args:
        area: uncut, or cut before.
        zones: whatever their heights.
        margin_m: lines stay that far away from zones [m].
    """
    lines_m = lines_enu_m(area, zones, margin_m)
    if isinstance(lines_m, Uncut):
        return lines_m
    lengths_m = np.hypot(*(lines_m[:, 1] - lines_m[:, 0]).T)
    values = (area.value * lengths_m / lengths_m.sum()).tolist()
    ends = [tuple((east_m, north_m, 0.0) for east_m, north_m in line) for line in lines_m.tolist()]
    return tuple(
        Task(
            id=name,
            position_enu_m=path[0],
            value=value,
            service_s=area.service_s,
            kind=area.kind,
            appears_s=area.appears_s,
            due_s=area.due_s,
            opens_s=area.opens_s,
            closes_s=area.closes_s,
            path_enu_m=path,
            trigger_m=area.picture_m,
            height_m=area.height_m,
        )
        for name, path, value in zip(area.ids_of(len(ends)), ends, values, strict=True)
    )


def lines_enu_m(area: Area, zones: Sequence[Zone], margin_m: float) -> FloatArray | Uncut:
    """(lines, 2, 2) both ends of every line, in the order of strips [m; east, north]."""
    import shapely

    corners = len(area.polygon_enu_m) + sum(map(len, area.holes_enu_m))
    if corners > MOST_CORNERS:
        problem = f"has {corners} corners with its holes, and lines are made of {MOST_CORNERS}"
        return Uncut(problem, "simplify its outline", "polygon_m")
    polygons = to_cover(area, zones, margin_m)
    whole_m2 = float(shapely.area(polygons))
    if whole_m2 < _SHORTEST_M**2:
        return _NOTHING_LEFT
    heading_deg = area.heading_deg
    if heading_deg is None:
        heading_deg = fewest_turns_deg(polygons, area.apart_m)
    longest_m = math.inf if area.max_line_m is None else area.max_line_m
    at_least = max(
        strips_across(*_extent_m(polygons, axes(heading_deg)), area.apart_m),
        whole_m2 / (area.apart_m * longest_m),
    )
    if at_least > MOST_LINES:
        return _too_many(area, int(at_least))
    about = _met_by_strips(polygons, axes(heading_deg), area.apart_m)
    if about > _TOO_RAGGED * MOST_LINES:
        return _too_many(area, int(about))
    middles_m = _middles_m(polygons, axes(heading_deg), area.apart_m)
    if len(middles_m) > MOST_LINES:  # many strips are cut by a ragged border
        return _too_many(area, len(middles_m))
    main_m = _clipped_m(middles_m, zones, margin_m)
    rest_m = _lines_of_rest_m(polygons, main_m, area.apart_m, zones, margin_m)
    lines_m = _in_equal_parts(np.round(np.concatenate([main_m, rest_m]), 3), longest_m)
    if not len(lines_m):  # crumbs between zones
        return _NOTHING_LEFT
    return _too_many(area, len(lines_m)) if len(lines_m) > MOST_LINES else lines_m


_NOTHING_LEFT = Uncut(
    "zones with their margin leave nothing of it",
    "move it out of zones, or change these",
    "polygon_m",
)


def _too_many(area: Area, lines: int) -> Uncut:
    key = "spacing_m" if area.camera is None else "camera"
    problem = f"{area.apart_m:g} m between lines take {lines} lines, and {MOST_LINES} are the most"
    return Uncut(problem, "set them further apart, or make several missions of it", key)


def _extent_m(polygons: shapely.Geometry, turned: FloatArray) -> tuple[float, float]:
    """From where to where the polygons reach across the lines [m]."""
    import shapely

    across_m = (shapely.get_coordinates(polygons) @ turned)[:, 1]
    return float(across_m.min()), float(across_m.max())


def _met_by_strips(polygons: shapely.Geometry, turned: FloatArray, apart_m: float) -> float:
    """About how many pieces strips have: every second edge that a strip meets begins one."""
    import shapely

    rings = shapely.get_parts(shapely.boundary(polygons))
    corners_m, ring = shapely.get_coordinates(rings, return_index=True)
    across_m = np.abs(np.diff((corners_m @ turned)[:, 1]))[np.diff(ring) == 0]
    return float(across_m.sum()) / (2.0 * apart_m)


def _middles_m(polygons: shapely.Geometry, turned: FloatArray, apart_m: float) -> FloatArray:
    """(n, 2, 2) the middle of every strip, as far along as there is anything of it to cover.

    Gaps of no more than ``apart_m`` are flown over: to leave a line and begin another takes longer.
    """
    import shapely

    shape = shapely.transform(polygons, lambda corners_m: corners_m @ turned)
    low_m, high_m = _extent_m(polygons, turned)
    strips = strips_across(low_m, high_m, apart_m)
    borders_m = np.linspace(low_m, high_m, strips + 1)
    begins_m, ends_m, strip = _pieces(shape, borders_m, 0)
    order = np.lexsort((begins_m, strip))
    lines: list[list[float]] = []
    for begin_m, end_m, number in zip(
        begins_m[order].tolist(), ends_m[order].tolist(), strip[order].tolist(), strict=True
    ):
        if lines and lines[-1][2] == number and begin_m - lines[-1][1] <= apart_m:
            lines[-1][1] = max(lines[-1][1], end_m)
        else:
            lines.append([begin_m, end_m, number])
    along_m = np.array(lines)[:, :2]
    numbers = np.array(lines)[:, 2].astype(np.int64)
    middle_m = (borders_m[numbers] + borders_m[numbers + 1]) / 2.0
    lines_m = np.stack([along_m, np.repeat(middle_m[:, None], 2, axis=1)], axis=2)
    return np.asarray(lines_m @ turned)


def _pieces(
    shape: shapely.Geometry, borders_m: FloatArray, first: int
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.int64]]:
    """From where to where along the strips each connected piece reaches, and in which it lies."""
    import shapely

    strips = len(borders_m) - 1
    west_m, _, east_m, _ = shapely.bounds(shape)
    if strips > 1 and shapely.get_num_coordinates(shape) * strips > _AT_ONCE:
        half = strips // 2
        parts = []
        for borders, begin in ((borders_m[: half + 1], first), (borders_m[half:], first + half)):
            box = shapely.box(west_m - 1.0, borders[0], east_m + 1.0, borders[-1])
            parts.append(_pieces(shapely.intersection(shape, box), borders, begin))
        begins, ends, numbers = zip(*parts, strict=True)
        return np.concatenate(begins), np.concatenate(ends), np.concatenate(numbers)
    boxes = shapely.box(west_m - 1.0, borders_m[:-1], east_m + 1.0, borders_m[1:])
    found, strip = shapely.get_parts(shapely.intersection(shape, boxes), return_index=True)
    solid = shapely.area(found) > 0.0
    reach_m = shapely.bounds(found[solid]).reshape(-1, 4)
    return reach_m[:, 0], reach_m[:, 2], strip[solid].astype(np.int64) + first


def _clipped_m(lines_m: FloatArray, zones: Sequence[Zone], margin_m: float) -> FloatArray:
    """(k, 2, 2) what of straight lines may be flown, each in the order of its pieces."""
    import shapely

    left = without_zones(np.asarray(shapely.linestrings(lines_m)), zones, margin_m)
    parts, line = shapely.get_parts(left, return_index=True)
    parts, line = parts[shapely.length(parts) > 0.0], line[shapely.length(parts) > 0.0]
    if not len(parts):
        return np.empty((0, 2, 2))
    ends_m = shapely.get_coordinates(parts).reshape(-1, 2, 2)
    begins_m = lines_m[line, 0]
    order = np.lexsort((np.hypot(*(ends_m[:, 0] - begins_m).T), line))
    ends_m = ends_m[order]
    return np.asarray(ends_m[np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T) >= _SHORTEST_M])


def _lines_of_rest_m(
    polygons: shapely.Geometry,
    lines_m: FloatArray,
    apart_m: float,
    zones: Sequence[Zone],
    margin_m: float,
) -> FloatArray:
    """(k, 2, 2) more lines, one along each piece that ``lines_m`` do not cover.

    The largest first, until nearly nothing is left.
    """
    import shapely

    more = np.empty((0, 2, 2))
    enough_m2 = _LEFT_FRAC * float(shapely.area(polygons))
    rest = _uncovered(polygons, lines_m, apart_m)
    for _ in range(_ROUNDS):
        parts = shapely.get_parts(rest)
        areas_m2 = shapely.area(parts)
        order = np.argsort(-areas_m2, kind="stable")
        left_m2 = areas_m2.sum() - np.cumsum(areas_m2[order])
        if areas_m2.sum() <= enough_m2:
            break
        enough = int(np.searchsorted(-left_m2, -enough_m2)) + 1
        axes_m = np.array([_long_axis_m(part) for part in parts[order[:enough]]])
        new = _clipped_m(axes_m, zones, margin_m)
        if not len(new):
            break
        more = np.concatenate([more, new])
        rest = _uncovered(rest, new, apart_m)
    return more


def _uncovered(polygons: shapely.Geometry, lines_m: FloatArray, apart_m: float) -> shapely.Geometry:
    """What of ``polygons`` is further from every line than half of what lies between them."""
    import shapely

    reach_m = apart_m / 2.0 / math.cos(math.pi / (4 * _ROUND_STEPS))
    flown = shapely.buffer(shapely.linestrings(lines_m), reach_m, quad_segs=_ROUND_STEPS)
    return shapely.difference(polygons, shapely.union_all(flown))


def _long_axis_m(part: shapely.Geometry) -> FloatArray:
    """(2, 2) the middle line of the narrowest rectangle round ``part``, along its longer side."""
    import shapely

    corners_m = shapely.get_coordinates(shapely.oriented_envelope(part))
    if len(corners_m) < 5:  # no wider than a line
        return corners_m[[0, -1]]
    sides_m = np.hypot(*(corners_m[1:3] - corners_m[:2]).T)
    if sides_m[0] >= sides_m[1]:
        return (corners_m[[0, 1]] + corners_m[[3, 2]]) / 2.0
    return (corners_m[[1, 2]] + corners_m[[0, 3]]) / 2.0


def _in_equal_parts(lines_m: FloatArray, longest_m: float) -> FloatArray:
    """(k, 2, 2) the lines, those longer than ``longest_m`` in as few equal parts as can be."""
    lengths_m = np.hypot(*(lines_m[:, 1] - lines_m[:, 0]).T)
    parts = np.maximum(1, np.ceil(lengths_m / longest_m - 1e-9).astype(np.int64))
    line = np.repeat(np.arange(len(lines_m)), parts)
    number = np.arange(len(line)) - np.repeat(np.cumsum(parts) - parts, parts)
    begin_m, way_m = lines_m[line, 0], lines_m[line, 1] - lines_m[line, 0]
    from_frac, to_frac = number / parts[line], (number + 1) / parts[line]
    ends_m = [begin_m + share[:, None] * way_m for share in (from_frac, to_frac)]
    return np.round(np.stack(ends_m, axis=1), 3)
