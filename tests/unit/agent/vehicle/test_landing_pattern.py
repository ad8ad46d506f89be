"""The way down to a runway: a circle whose tangent is the landing's line, and that line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.core.interface import Runway
from agent.vehicle.landing_pattern import RunwayLanding
from agent.vehicle.messages import AltitudeFrame
from swarm.model.frames import Origin, enu_from_wgs84

ORIGIN = Origin(48.2, 7.5, 170.0)
PLACE = st.floats(-500.0, 500.0)
LANDINGS = st.builds(RunwayLanding, st.floats(20.0, 300.0), st.floats(0.03, 0.25))


@given(landing=LANDINGS, east_m=PLACE, north_m=PLACE, heading_rad=st.floats(0.0, math.tau))
def test_the_tangent_of_the_circle_is_the_line(
    landing: RunwayLanding, east_m: float, north_m: float, heading_rad: float
) -> None:
    circle_m = landing.circle_enu_m(Runway((east_m, north_m, 3.0), heading_rad))
    away_east_m, away_north_m = circle_m[0] - east_m, circle_m[1] - north_m
    ahead_east, ahead_north = math.sin(heading_rad), math.cos(heading_rad)
    behind_m = -(away_east_m * ahead_east + away_north_m * ahead_north)
    right_m = away_east_m * ahead_north - away_north_m * ahead_east
    assert behind_m == pytest.approx(landing.line_m + 100.0)
    assert right_m == pytest.approx(landing.circle_m)


@given(landing=LANDINGS)
def test_the_line_is_less_steep_than_the_plane_may_descend(landing: RunwayLanding) -> None:
    circle_m = landing.circle_enu_m(Runway((0.0, 0.0, 0.0), 0.0))
    assert math.atan2(circle_m[2], landing.line_m) == pytest.approx(0.8 * landing.slope_rad)


def test_the_items_begin_the_landing_circle_down_and_touch_down_at_the_place() -> None:
    runway = Runway((40.0, -20.0, 2.0), math.pi / 2.0)
    landing = RunwayLanding(80.0, math.radians(5.0))
    items = landing.items(runway, ORIGIN)
    _, circle, high, low, ground = items
    assert [item.command for item in items] == [189, 31, 16, 16, 21]
    assert [item.seq for item in items] == [0, 1, 2, 3, 4]
    for item, frac in ((high, 1.0), (low, 0.7)):
        place_enu_m = enu_from_wgs84(ORIGIN, item.lat_deg, item.lon_deg, item.alt_m)
        on_line_m = (40.0 - frac * landing.line_m, -20.0, 2.0 + frac * 25.0)
        assert place_enu_m == pytest.approx(on_line_m, abs=0.02)
    assert circle.params == (1.0, 80.0, 0.0, 1.0)
    assert {circle.frame, ground.frame} == {AltitudeFrame.MEAN_SEA_LEVEL}
    place_enu_m = enu_from_wgs84(ORIGIN, ground.lat_deg, ground.lon_deg, ground.alt_m)
    assert place_enu_m == pytest.approx(runway.position_enu_m, abs=0.01)
    assert circle.alt_m == pytest.approx(172.0 + 25.0)
