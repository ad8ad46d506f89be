from __future__ import annotations

import math
import re

import pytest

from swarm.model.ids import ZoneId
from swarm.model.rings import Corner
from swarm.model.zones import Zone

SQUARE: tuple[Corner, ...] = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))
HOLE: tuple[Corner, ...] = ((2.0, 2.0), (4.0, 2.0), (3.0, 4.0))


def zone(
    polygon: tuple[Corner, ...],
    *holes: tuple[Corner, ...],
    floor_m: float | None = None,
    ceiling_m: float | None = None,
) -> Zone:
    return Zone(ZoneId("village"), polygon, holes, floor_m, ceiling_m)


def test_polygon_may_go_round_either_way_and_end_where_it_began() -> None:
    assert zone((*SQUARE, SQUARE[0])) == zone(SQUARE)
    assert zone(SQUARE[::-1]).shape().area == zone(SQUARE).shape().area == 100.0
    assert zone(SQUARE, HOLE).shape().area == 98.0


@pytest.mark.parametrize(
    ("polygon", "words"),
    [
        (((0.0, 0.0), (1.0, 0.0)), "polygon of zone village must have at least three corners"),
        (((0.0, 0.0), (1.0, math.nan), (0.0, 1.0)), "corner 2 must be two finite numbers"),
        (((0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0)), "corner 2 must be two finite numbers"),
        (((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.0, 1.0)), "corner 3 repeats the one before"),
        (((0.0, 0.0), (1.0, 0.0), (3.0, 0.0)), "encloses nothing"),
        (((0.0, 0.0), (4.0, 4.0), (4.0, 0.0), (0.0, 6.0)), "crosses or touches itself near ("),
        # A figure of eight, and a border that touches a corner of its own.
        (((0.0, 0.0), (2.0, 2.0), (4.0, 0.0), (4.0, 4.0), (2.0, 2.0), (0.0, 4.0)), "touches"),
        (((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (2.0, 0.0), (0.0, 4.0)), "touches itself"),
    ],
)
def test_polygon_that_is_not_simple_is_refused(polygon: tuple[Corner, ...], words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        zone(polygon)


@pytest.mark.parametrize(
    ("holes", "words"),
    [
        ([((20.0, 2.0), (24.0, 2.0), (23.0, 4.0))], "a hole lies outside the polygon"),
        ([((8.0, 2.0), (14.0, 2.0), (9.0, 4.0))], "a hole crosses the polygon's border"),
        ([HOLE, ((2.5, 2.2), (3.5, 2.2), (3.0, 3.0))], "a hole lies in another"),
        ([HOLE, HOLE], "holes of zone village"),
        ([((0.0, 5.0), (5.0, 0.0), (10.0, 5.0), (5.0, 10.0))], "cut the polygon into pieces"),
        ([((2.0, 2.0), (4.0, 2.0))], "hole 1 of zone village must have at least three"),
    ],
)
def test_holes_that_are_none_are_refused(holes: list[tuple[Corner, ...]], words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)):
        zone(SQUARE, *holes)


def test_a_hole_may_touch_the_border_in_a_point() -> None:
    assert zone(SQUARE, ((0.0, 5.0), (2.0, 4.0), (2.0, 6.0))).shape().area == 98.0


def test_heights_that_are_none_are_refused() -> None:
    for heights in ({"floor_m": 5.0, "ceiling_m": 5.0}, {"floor_m": 6.0, "ceiling_m": 5.0}):
        with pytest.raises(
            ValueError, match=r"ceiling_m of zone village must be above its floor_m"
        ):
            zone(SQUARE, **heights)
    with pytest.raises(ValueError, match="floor_m of zone village must be finite"):
        zone(SQUARE, floor_m=math.inf)
    with pytest.raises(ValueError, match="zone id"):
        Zone(ZoneId("a village"), SQUARE)


def test_zone_concerns_who_uses_heights_inside_its_own() -> None:
    layered = zone(SQUARE, floor_m=20.0, ceiling_m=60.0)

    assert layered.concerns(30.0, 30.0)
    assert layered.concerns(0.0, 100.0)
    assert layered.concerns(59.9, 80.0)
    assert not layered.concerns(0.0, 20.0)
    assert not layered.concerns(60.0, 60.0)
    assert zone(SQUARE).concerns(-50.0, -40.0)  # from the ground up, wherever the ground is
    assert zone(SQUARE, floor_m=20.0).concerns(1e4, 1e4)
