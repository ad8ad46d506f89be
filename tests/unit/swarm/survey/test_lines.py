"""Lines of an area: all of it is covered, no zone is met, and the way they go takes few turns."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from swarm.allocation.legs.obstacles import Obstacles
from swarm.model import Area, AreaId, TaskId, Zone, ZoneId
from swarm.survey.coverage import AreaCoverage
from swarm.survey.heading import fewest_turns_deg
from swarm.survey.lines import Uncut, line_tasks, lines_enu_m
from tests.support.random_areas import random_area

SEEDS = st.integers(0, 2**32 - 1)
FIELD = Area(
    AreaId("field"),
    ((0.0, 0.0), (400.0, 0.0), (400.0, 200.0), (0.0, 200.0)),
    60.0,
    spacing_m=25.0,
)


def lines_of(
    area: Area, zones: tuple[Zone, ...] = (), margin_m: float = 0.0
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    lines_m = lines_enu_m(area, zones, margin_m)
    assert not isinstance(lines_m, Uncut)
    return lines_m


@given(seed=SEEDS)
def test_nearly_all_that_is_allowed_is_covered_and_no_zone_is_met(seed: int) -> None:
    area, zones, margin_m = random_area(np.random.default_rng(seed))
    tasks = line_tasks(area, zones, margin_m)
    if isinstance(tasks, Uncut):  # zones are all over it
        assert shapely.area(AreaCoverage(area, (), zones, margin_m).to_cover) < 1.0
        return

    cut = replace(area, lines=len(tasks))
    coverage = AreaCoverage(cut, tasks, zones, margin_m)
    assert coverage.share({task.id for task in tasks}) >= 0.998
    obstacles = Obstacles(zones, margin_m)
    ends_m = np.array([[point[:2] for point in task.path_enu_m] for task in tasks])
    assert obstacles.clear(ends_m[:, 0], ends_m[:, 1]).all()
    lengths_m = np.hypot(*(ends_m[:, 1] - ends_m[:, 0]).T)
    assert lengths_m.max() <= 150.01
    np.testing.assert_allclose(
        [task.value for task in tasks], 10.0 * lengths_m / lengths_m.sum(), atol=1e-3
    )
    assert line_tasks(area, zones, margin_m) == tasks


@given(seed=SEEDS, heading_deg=st.floats(0.0, 360.0))
def test_lines_of_a_field_without_zones_lie_side_by_side_at_the_heading_asked_for(
    seed: int, heading_deg: float
) -> None:
    area, _, _ = random_area(np.random.default_rng(seed), heading_deg=heading_deg)
    lines_m = lines_of(area)

    east_m, north_m = (lines_m[:, 1] - lines_m[:, 0]).T
    long = np.hypot(east_m, north_m) > 10.0
    off_rad = np.arctan2(east_m, north_m)[long] - math.radians(heading_deg)
    np.testing.assert_allclose(np.sin(off_rad), 0.0, atol=1e-3)
    across_rad = math.radians(heading_deg + 90.0)
    across_m = lines_m[:, 0] @ [math.sin(across_rad), math.cos(across_rad)]
    gaps_m = np.diff(np.unique(np.round(across_m, 1)))
    assert (gaps_m <= area.apart_m + 0.3).all()


def test_a_field_is_cut_along_its_longer_side_into_strips_of_equal_width() -> None:
    lines_m = lines_of(replace(FIELD, spacing_m=30.0))

    middles_m = np.arange(7) * (200.0 / 7.0) + 100.0 / 7.0
    np.testing.assert_allclose(np.sort(lines_m[:, 0, 1]), middles_m, atol=1e-3)
    np.testing.assert_allclose(np.sort(lines_m[:, :, 0], axis=1), [[0.0, 400.0]] * 7, atol=1e-3)


def test_long_lines_are_cut_into_as_few_equal_parts_as_can_be() -> None:
    whole = lines_of(FIELD)
    parts_m = lines_of(replace(FIELD, max_line_m=150.0))

    lengths_m = np.hypot(*(parts_m[:, 1] - parts_m[:, 0]).T)
    assert len(parts_m) == 3 * len(whole)
    np.testing.assert_allclose(lengths_m, 400.0 / 3.0, atol=2e-3)
    np.testing.assert_allclose(parts_m[1::3, 0], parts_m[::3, 1])
    assert len(lines_of(replace(FIELD, max_line_m=400.0))) == len(whole)


def test_lines_are_prolonged_at_slanted_borders() -> None:
    slanted = replace(FIELD, polygon_enu_m=((0.0, 0.0), (300.0, 0.0), (400.0, 50.0), (100.0, 50.0)))
    (upper, lower) = lines_of(replace(slanted, heading_deg=90.0))

    np.testing.assert_allclose(lower, [[0.0, 12.5], [350.0, 12.5]], atol=1e-3)
    np.testing.assert_allclose(upper, [[50.0, 37.5], [400.0, 37.5]], atol=1e-3)


def test_a_hole_is_left_out_and_a_narrow_one_flown_over() -> None:
    wide = ((150.0, 60.0), (250.0, 60.0), (250.0, 140.0), (150.0, 140.0))
    narrow = ((190.0, 60.0), (210.0, 60.0), (210.0, 140.0), (190.0, 140.0))

    across = lines_of(replace(FIELD, holes_enu_m=(wide,), heading_deg=90.0))
    over = lines_of(replace(FIELD, holes_enu_m=(narrow,), heading_deg=90.0))

    # The strips from 75 to 100 and from 100 to 125 m lie in the hole where it is.
    assert len(across) == 8 + 2
    assert len(over) == 8


def test_where_a_zone_takes_the_middle_of_a_strip_the_rest_of_it_gets_a_line() -> None:
    zone = Zone(ZoneId("z"), ((-50.0, -50.0), (450.0, -50.0), (450.0, 5.0), (-50.0, 5.0)))
    area = replace(
        FIELD,
        polygon_enu_m=((0.0, 0.0), (400.0, 0.0), (400.0, 25.0), (0.0, 25.0)),
        heading_deg=90.0,
    )

    ((begin, end),) = lines_of(area, (zone,), margin_m=10.0).tolist()

    assert begin == pytest.approx([0.0, 20.0], abs=0.02)
    assert end == pytest.approx([400.0, 20.0], abs=0.02)


@pytest.mark.parametrize("turned_deg", [0.0, 17.0, 90.0, 133.7])
def test_the_way_with_the_fewest_turns_is_along_the_longer_side(turned_deg: float) -> None:
    turn_rad = math.radians(turned_deg)
    turn = np.array(
        [[math.cos(turn_rad), -math.sin(turn_rad)], [math.sin(turn_rad), math.cos(turn_rad)]]
    )
    corners_m = np.array(FIELD.polygon_enu_m) @ turn
    shape = replace(FIELD, polygon_enu_m=tuple(map(tuple, corners_m.tolist()))).shape()

    # East and north turned clockwise by that much.
    off_deg = fewest_turns_deg(shape, 25.0) - 90.0 - turned_deg
    assert math.sin(math.radians(off_deg)) == pytest.approx(0.0, abs=1e-9)


def test_no_other_way_needs_fewer_lines_for_a_dented_field() -> None:
    dented = ((0.0, 0.0), (400.0, 0.0), (400.0, 60.0), (200.0, 60.0), (200.0, 300.0), (0.0, 300.0))
    area = replace(FIELD, polygon_enu_m=dented)
    chosen = len(lines_of(area))

    others = [len(lines_of(replace(area, heading_deg=deg))) for deg in range(0, 180, 2)]

    assert chosen <= min(others)


def test_crumbs_between_zones_are_no_lines() -> None:
    around = ((-10.0, -10.0), (410.0, -10.0), (410.0, 210.0), (-10.0, 210.0))
    hole = ((199.0, 99.0), (201.0, 99.0), (201.0, 101.0), (199.0, 101.0))
    zone = Zone(ZoneId("z"), around, (hole,))

    assert isinstance(line_tasks(FIELD, (zone,), margin_m=0.9), Uncut)
    lines = line_tasks(FIELD, (zone,), margin_m=0.0)
    assert not isinstance(lines, Uncut)
    assert [line.id for line in lines] == [TaskId("field-01")]


def test_more_lines_than_a_mission_can_have_are_refused_with_their_number() -> None:
    refused = line_tasks(replace(FIELD, spacing_m=0.1, max_line_m=10.0), (), 0.0)

    assert isinstance(refused, Uncut)
    assert refused.problem == "0.1 m between lines take 80000 lines, and 5000 are the most"
