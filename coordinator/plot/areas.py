"""Areas on the map of a plan: their outlines, what planned lines cover, and what they do not.

Leaves out: the lines themselves (coordinator.plot.field).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from coordinator.plot.labels import Label
from coordinator.plot.looks import LATE, marker
from swarm.model import Area, Mission, TaskId
from swarm.survey.coverage import AreaCoverage, covered

if TYPE_CHECKING:
    import shapely
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

_OUTLINE = "#33691E"
_COVERED = "#DCEDC8"
_LEAST_SHOWN_M2 = 1.0
"""Smaller crumbs are not seen."""


def lines_of_areas(mission: Mission) -> frozenset[TaskId]:
    """The tasks that are lines of areas: too many to be marked and named one by one."""
    return frozenset(line for area in mission.areas for line in area.line_ids)


def area_places_m(mission: Mission) -> list[tuple[float, float]]:
    """East and north of their corners [m]."""
    return [corner for area in mission.areas for corner in area.polygon_enu_m]


def draw_areas(axes: Axes, mission: Mission, met: Collection[TaskId]) -> None:
    """The outline of each, light where these tasks cover it, marked where they do not."""
    import shapely

    for area in mission.areas:
        coverage = AreaCoverage(area, mission.tasks, mission.zones, mission.zone_margin_m)
        lines = [line for name, line in coverage.lines.items() if name in met]
        shape = covered(area, lines)
        _fill(axes, shapely.intersection(coverage.to_cover, shape), _COVERED, 0.4)
        _fill(axes, shapely.difference(coverage.to_cover, shape), LATE, 0.5)
        for ring in (area.polygon_enu_m, *area.holes_enu_m):
            corners_m = np.array([*ring, ring[0]])
            axes.plot(*corners_m.T, color=_OUTLINE, linewidth=1.1, zorder=0.8)


def _fill(axes: Axes, shape: shapely.Geometry, colour: str, order: float) -> None:
    """Polygons with their holes."""
    import shapely
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for part in shapely.get_parts(shape):
        if part.geom_type != "Polygon" or part.area < _LEAST_SHOWN_M2:
            continue
        turned = shapely.orient_polygons(part)
        rings = [np.array(ring.coords)[:, :2] for ring in (turned.exterior, *turned.interiors)]
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(PathPatch(path, facecolor=colour, linewidth=0.0, zorder=order))


def area_labels(mission: Mission) -> Sequence[Label]:
    """Names of areas, well inside of them."""
    return [Label(area.id, _name_place_m(area), 0.0, bold=True) for area in mission.areas]


def _name_place_m(area: Area) -> tuple[float, float]:
    place = area.shape().representative_point()
    return float(place.x), float(place.y)


def area_legend(mission: Mission) -> Iterator[Line2D]:
    """What their marks mean."""
    if mission.areas:
        yield marker("s", _COVERED, _OUTLINE, "area; light: covered")
