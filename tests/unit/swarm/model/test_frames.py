"""The local frame: there and back exactly, and off the origin by as much as it says."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.model.frames import Origin, enu_from_wgs84, wgs84_from_enu

SEMI_MAJOR_M, ECCENTRICITY_SQUARED = 6_378_137.0, 6.694_379_990_14e-3
LEG_M = 100.0
"""Short enough that the ellipsoid is flat on the way."""


def length_m(origin: Origin, start_m: tuple[float, float], end_m: tuple[float, float]) -> float:
    """True length of a short leg, by the radii of curvature where it is."""
    (lat, lon, _), (to_lat, to_lon, _) = (
        wgs84_from_enu(origin, (*place, 0.0)) for place in (start_m, end_m)
    )
    middle_rad = math.radians((lat + to_lat) / 2.0)
    squared = 1.0 - ECCENTRICITY_SQUARED * math.sin(middle_rad) ** 2
    normal_m = SEMI_MAJOR_M / math.sqrt(squared)
    meridian_m = normal_m * (1.0 - ECCENTRICITY_SQUARED) / squared
    east_m = math.radians(to_lon - lon) * normal_m * math.cos(middle_rad)
    return math.hypot(east_m, math.radians(to_lat - lat) * meridian_m)


@pytest.mark.parametrize(("lat_deg", "off_frac"), [(47.0, 0.003), (70.0, 0.009)])
def test_twenty_kilometres_off_distances_are_off_by_as_much_as_the_module_says(
    lat_deg: float, off_frac: float
) -> None:
    origin = Origin(lat_deg, 8.0, 0.0)
    for east_m, north_m in [(0.0, 0.0), (20_000.0, 0.0)]:
        end_m = east_m + LEG_M, north_m
        assert length_m(origin, (east_m, north_m), end_m) == pytest.approx(LEG_M, rel=1e-6)

    across = length_m(origin, (0.0, 20_000.0), (LEG_M, 20_000.0))
    along = length_m(origin, (0.0, 20_000.0), (0.0, 20_000.0 + LEG_M))
    assert 1.0 - across / LEG_M == pytest.approx(off_frac, abs=0.0005)
    assert along == pytest.approx(LEG_M, rel=1e-4)


@given(
    st.floats(-80.0, 80.0),
    st.floats(-180.0, 180.0),
    st.tuples(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4), st.floats(-100.0, 1000.0)),
)
def test_a_place_comes_back_as_it_was(
    lat_deg: float, lon_deg: float, point_enu_m: tuple[float, float, float]
) -> None:
    origin = Origin(lat_deg, lon_deg, 400.0)
    there = wgs84_from_enu(origin, point_enu_m)
    assert enu_from_wgs84(origin, *there) == pytest.approx(point_enu_m, abs=1e-4)
