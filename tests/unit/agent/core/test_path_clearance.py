"""Ways with room to spare keep out of zones, farther away than the shortest where they can."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from agent.core.path_clearance import PATH_CLEARANCE_M, PathClearance
from swarm.allocation.legs import PathPlanner
from swarm.model import Zone, ZoneId

WALL = Zone(ZoneId("wall"), ((20.0, -40.0), (30.0, -40.0), (30.0, 30.0), (20.0, 30.0)))
BEGIN, END = (0.0, 0.0, 10.0), (50.0, 0.0, 30.0)


def distance_m(way: tuple[tuple[float, float, float], ...], *zones: Zone) -> float:
    line = shapely.LineString([place[:2] for place in way])
    return float(min(shapely.distance(zone.shape(), line) for zone in zones))


@pytest.mark.parametrize("margin_m", [0.0, 5.0])
def test_a_way_leads_past_a_zone_farther_out(margin_m: float) -> None:
    shortest = (BEGIN, (20.0, 30.0, 15.0), (30.0, 30.0, 20.0), END)

    way = PathClearance([WALL], margin_m, PATH_CLEARANCE_M).widened(shortest)

    assert (way[0], way[-1]) == (BEGIN, END)
    assert distance_m(way, WALL) >= margin_m + PATH_CLEARANCE_M * 2.0 / 3.0 - 1e-6
    heights_m = [place[2] for place in way]
    assert heights_m == sorted(heights_m)
    assert sum(math.dist(a, b) for a, b in pairwise(way)) <= 1.3 * 120.0


def test_a_way_that_is_far_from_everything_stays_as_it_is() -> None:
    way = (BEGIN, (-20.0, 5.0, 12.0))

    assert PathClearance([WALL], 5.0, PATH_CLEARANCE_M).widened(way) == way


def test_one_above_a_zone_needs_no_room() -> None:
    low = Zone(WALL.id, WALL.polygon_enu_m, ceiling_m=5.0)

    assert PathClearance([low], 5.0, PATH_CLEARANCE_M).widened((BEGIN, END)) == (BEGIN, END)


def test_through_a_narrow_gap_it_leads_with_the_room_that_there_is() -> None:
    east, west = (
        Zone(ZoneId("a"), ((20.0, 2.0), (30.0, 2.0), (30.0, 300.0), (20.0, 300.0))),
        Zone(ZoneId("b"), ((20.0, -2.0), (20.0, -300.0), (30.0, -300.0), (30.0, -2.0))),
    )
    shortest = ((0.0, 30.0, 10.0), (20.0, 2.0, 10.0), (30.0, 2.0, 10.0), (50.0, 30.0, 10.0))

    way = PathClearance([east, west], 0.0, PATH_CLEARANCE_M).widened(shortest)

    assert 0.3 <= distance_m(way, east, west) <= 2.0


def test_a_task_beside_a_zone_is_still_flown_to() -> None:
    task = (31.0, 0.0, 10.0)
    shortest = (BEGIN, (20.0, 30.0, 10.0), (30.0, 30.0, 10.0), task)

    way = PathClearance([WALL], 0.0, PATH_CLEARANCE_M).widened(shortest)

    assert way[-1] == task
    assert distance_m(way[:-1], WALL) >= 1.0


@given(
    st.lists(st.tuples(st.integers(-80, 80), st.integers(-80, 80)), min_size=2, max_size=2),
    st.sampled_from([0.0, 4.0]),
)
def test_whatever_the_ends_no_way_meets_a_zone(
    ends: list[tuple[int, int]], margin_m: float
) -> None:
    import numpy as np

    planner = PathPlanner([WALL], margin_m)
    begin, end = np.array(ends[0], dtype=float), np.array(ends[1], dtype=float)
    flat_m = planner.path_m(begin, end)
    if flat_m is None or not planner.free(np.array(ends, dtype=float)).all():
        return
    shortest = tuple((float(x), float(y), 10.0) for x, y in flat_m)

    way = PathClearance([WALL], margin_m, PATH_CLEARANCE_M).widened(shortest)

    places_m = np.array([place[:2] for place in way])
    assert planner.clear(places_m[:-1], places_m[1:]).all()
