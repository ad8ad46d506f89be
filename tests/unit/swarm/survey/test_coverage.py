"""What lines cover is what a grid of points says, each asked for its distance by plain loops."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from swarm.model import Area, AreaId, Task, TaskId, Zone
from swarm.survey.coverage import AreaCoverage, reach_m
from swarm.survey.lines import Uncut, line_tasks
from tests.support.random_areas import random_area

Place = tuple[float, float]


def inside(place: Place, ring: tuple[Place, ...]) -> bool:
    """By the number of edges that lie east of the place."""
    within = False
    for (x0, y0), (x1, y1) in zip(ring, (*ring[1:], ring[0]), strict=True):
        if (y0 > place[1]) != (y1 > place[1]):
            within ^= place[0] < x0 + (place[1] - y0) / (y1 - y0) * (x1 - x0)
    return within


def apart_m(place: Place, begin: Place, end: Place) -> float:
    """From a place to a straight piece."""
    way = (end[0] - begin[0], end[1] - begin[1])
    square = way[0] ** 2 + way[1] ** 2
    share = (place[0] - begin[0]) * way[0] + (place[1] - begin[1]) * way[1]
    share = min(1.0, max(0.0, share / square)) if square else 0.0
    return math.dist(place, (begin[0] + share * way[0], begin[1] + share * way[1]))


def to_be_covered(place: Place, area: Area, zones: tuple[Zone, ...], margin_m: float) -> bool:
    if not inside(place, area.polygon_enu_m):
        return False
    if any(inside(place, hole) for hole in area.holes_enu_m):
        return False
    for zone in zones:
        ring = zone.polygon_enu_m
        border = zip(ring, (*ring[1:], ring[0]), strict=True)
        near = min(apart_m(place, *edge) for edge in border) < margin_m
        if near or inside(place, ring) != zone.inclusive:
            return False
    return True


@given(seed=st.integers(0, 2**32 - 1), flown_frac=st.floats(0.0, 1.0))
def test_coverage_is_that_of_a_grid_of_points(seed: int, flown_frac: float) -> None:
    rng = np.random.default_rng(seed)
    area, zones, margin_m = random_area(rng)
    tasks = line_tasks(area, zones, margin_m)
    if isinstance(tasks, Uncut):
        return
    flown = [task for task in tasks if rng.random() < flown_frac]
    coverage = AreaCoverage(replace(area, lines=len(tasks)), tasks, zones, margin_m)
    whole_m2 = float(shapely.area(coverage.to_cover))
    if whole_m2 < 5000.0:
        return  # too few points

    told = coverage.share({task.id for task in flown})

    places = [
        place
        for place in map(tuple, rng.uniform(-300.0, 300.0, (1500, 2)).tolist())
        if to_be_covered(place, area, zones, margin_m)
    ]
    near = [
        any(
            apart_m(place, task.path_enu_m[0][:2], task.path_enu_m[1][:2]) <= reach_m(area)
            for task in flown
        )
        for place in places
    ]
    # Four standard deviations of a share of so many points, and the one that may be left over.
    spread = 4.0 * math.sqrt(max(told * (1.0 - told), 0.002) / max(len(places), 1))
    assert sum(near) / max(len(places), 1) == pytest.approx(told, abs=spread + 1.0 / len(places))
    share = whole_m2 / 600.0**2
    spread = 4.0 * math.sqrt(max(share * (1.0 - share), 0.002) / 1500)
    assert len(places) / 1500 == pytest.approx(share, abs=spread)


def test_half_the_lines_cover_half_and_tasks_that_are_none_of_them_nothing() -> None:
    square = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
    area = Area(AreaId("field"), square, 1.0, spacing_m=50.0, heading_deg=90.0)
    lines = line_tasks(area, (), 0.0)
    assert not isinstance(lines, Uncut)
    elsewhere = Task(TaskId("field-extra"), (0.0, 50.0, 0.0), 1.0)
    tasks = (elsewhere, *lines)

    coverage = AreaCoverage(replace(area, lines=len(lines)), tasks, (), 0.0)

    assert coverage.share(()) == 0.0
    assert coverage.share({TaskId("field-extra")}) == 0.0
    # 25 m to either side of the line, and the metre that counts as well.
    assert coverage.share({TaskId("field-01")}) == pytest.approx(0.51, abs=1e-3)
    assert coverage.share({line.id for line in lines}) == 1.0
