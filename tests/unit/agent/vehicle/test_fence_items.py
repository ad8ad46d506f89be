"""Zones as polygons of a firmware's fence, and what firmwares do about these."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from agent.vehicle.fence_items import (
    FenceArea,
    areas_of,
    fence_areas,
    fence_items,
)
from agent.vehicle.firmware.fences import arducopter_fence, px4_fence
from agent.vehicle.messages import MissionKind
from swarm.model import Zone, ZoneId
from swarm.model.fence_rings import blocks_all_heights
from swarm.model.frames import enu_from_wgs84
from tests.support.bridge_flight import ORIGIN

INCLUSION, EXCLUSION = 5001, 5002
SQUARE = ((0.0, 0.0), (100.0, 0.0), (100.0, 100.0), (0.0, 100.0))
HOLES = (
    ((10.0, 10.0), (40.0, 10.0), (40.0, 60.0), (10.0, 60.0)),
    ((60.0, 30.0), (90.0, 50.0), (60.0, 80.0)),
)


def polygon(area: FenceArea) -> shapely.Polygon:
    places = (
        enu_from_wgs84(ORIGIN, lat / 1e7, lon / 1e7, ORIGIN.alt_m) for lat, lon in area.corners_e7
    )
    return shapely.Polygon([place_m[:2] for place_m in places])


def is_forbidden(areas: tuple[FenceArea, ...], place: shapely.Point) -> bool:
    """As firmwares judge: outside of anything to stay in, or inside of anything to keep out of."""
    kept_in = [polygon(area) for area in areas if area.command == INCLUSION]
    kept_out = [polygon(area) for area in areas if area.command == EXCLUSION]
    return any(not each.contains(place) for each in kept_in) or any(
        each.contains(place) for each in kept_out
    )


@pytest.mark.parametrize("inclusive", [False, True])
@pytest.mark.parametrize("holes", [(), HOLES[:1], HOLES])
def test_the_polygons_forbid_what_the_zone_forbids(
    inclusive: bool, holes: tuple[tuple[tuple[float, float], ...], ...]
) -> None:
    zone = Zone(ZoneId("z"), SQUARE, holes, inclusive=inclusive)
    areas, shape = fence_areas(zone, ORIGIN), zone.shape()
    for at in np.random.default_rng(3).uniform(-30.0, 130.0, (400, 2)):
        place = shapely.Point(at)
        if shape.boundary.distance(place) > 0.1:
            assert is_forbidden(areas, place) is (shape.contains(place) is not inclusive), at


def test_every_corner_tells_how_many_its_polygon_has() -> None:
    triangle = Zone(ZoneId("t"), SQUARE[:3], inclusive=True)
    areas = (*fence_areas(Zone(ZoneId("s"), SQUARE), ORIGIN), *fence_areas(triangle, ORIGIN))
    items = fence_items(areas)
    assert [item.seq for item in items] == list(range(7))
    assert [item.command for item in items] == [EXCLUSION] * 4 + [INCLUSION] * 3
    assert [item.params[0] for item in items] == [4.0] * 4 + [3.0] * 3
    assert {item.kind for item in items} == {MissionKind.FENCE}
    assert areas_of(items) == areas


def test_places_are_within_a_centimetre() -> None:
    [area] = fence_areas(Zone(ZoneId("z"), SQUARE), ORIGIN)
    for corner, told in zip(SQUARE, polygon(area).exterior.coords, strict=False):
        assert math.dist(corner, told) < 0.02


@pytest.mark.parametrize(
    ("command", "number"), [(5003, 4.0), (EXCLUSION, 2.0), (EXCLUSION, 5.0), (EXCLUSION, math.nan)]
)
def test_what_is_no_polygon_is_none(command: int, number: float) -> None:
    from dataclasses import replace

    items = fence_items(fence_areas(Zone(ZoneId("z"), SQUARE), ORIGIN))
    odd = tuple(replace(item, command=command, params=(number, 0.0, 0.0, 0.0)) for item in items)
    assert areas_of(odd) is None


@pytest.mark.parametrize(
    ("floor_m", "ceiling_m", "blocks"),
    [
        (None, None, True),
        (0.0, None, True),
        (None, 120.0, True),
        (None, 60.0, False),
        (30.0, None, False),
    ],
)
def test_a_zone_above_or_below_which_may_be_flown_is_no_prism(
    floor_m: float | None, ceiling_m: float | None, blocks: bool
) -> None:
    zone = Zone(ZoneId("z"), SQUARE, floor_m=floor_m, ceiling_m=ceiling_m)
    assert blocks_all_heights(zone, 2.0, 100.0) is blocks


COPTER = {"FENCE_ENABLE": 0.0, "FENCE_TYPE": 7.0, "FENCE_ACTION": 1.0, "FENCE_AUTOENABLE": 0.0}


def test_arducopter_is_switched_on_by_command_where_that_spares_heights_and_circle() -> None:
    assert arducopter_fence(COPTER).switches
    assert arducopter_fence(COPTER).caution is None
    older = {name: value for name, value in COPTER.items() if name != "FENCE_AUTOENABLE"}
    assert not arducopter_fence(older).switches
    assert "set FENCE_ENABLE 1" in (arducopter_fence(older).caution or "")


@pytest.mark.parametrize("name", ["FENCE_ENABLE", "FENCE_AUTOENABLE"])
def test_an_arducopter_whose_fence_is_on_is_not_switched(name: str) -> None:
    setup = arducopter_fence({**COPTER, name: 1.0})
    assert (setup.puts, setup.switches) == (True, False)


def test_an_arducopter_that_minds_no_polygons_is_given_none() -> None:
    setup = arducopter_fence({**COPTER, "FENCE_TYPE": 3.0})
    assert not setup.puts
    assert "FENCE_TYPE is 3" in (setup.caution or "")


def test_a_fence_that_does_nothing_is_told() -> None:
    assert "FENCE_ACTION" in (arducopter_fence({**COPTER, "FENCE_ACTION": 0.0}).caution or "")
    assert "GF_ACTION is 1" in (px4_fence({"GF_ACTION": 1.0}).caution or "")


def test_a_px4_that_would_cut_its_motors_at_a_fence_is_given_none() -> None:
    assert px4_fence({"GF_ACTION": 2.0}).puts
    assert not px4_fence({"GF_ACTION": 4.0}).puts
    assert not px4_fence({}).puts
