"""How near zones and the end of their batteries UAVs came, by what they told."""

from __future__ import annotations

import math

import pytest

from coordinator.mission_view.observed_limits import ObservedLimits
from swarm.model import Zone, ZoneId
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.uav_messages import Status, StatusPhase

SQUARE = ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0))
POND = ZoneSpec.of(Zone(ZoneId("pond"), SQUARE))


def status(
    at_s: float,
    east_m: float,
    north_m: float,
    *,
    velocity: tuple[float, float] = (0.0, 0.0),
    phase: StatusPhase = StatusPhase.FLYING,
    charge: float | None = None,
) -> Status:
    place, speed = (east_m, north_m, 0.0), (*velocity, 0.0)
    return Status(phase, None, place, speed, charge, at_s, {}, "")


def flown(*statuses: Status, zones: tuple[ZoneSpec, ...] = (POND,)) -> ObservedLimits:
    limits = ObservedLimits()
    for each in statuses:
        limits.hear("u1", each, 10.0, zones)
    return limits


def test_between_two_places_a_uav_is_seen_to_pass_a_zone() -> None:
    limits = flown(status(1.0, -20.0, -15.0), status(3.0, 60.0, -15.0))

    assert limits.nearest_zone_m == pytest.approx(15.0)


def test_a_bend_round_a_corner_is_not_cut_short() -> None:
    """A quarter of a circle of 15 m round the corner, told at its ends alone."""
    bend = (
        status(1.0, -15.0, 0.0, velocity=(0.0, -8.0)),
        status(4.0, 0.0, -15.0, velocity=(8.0, 0.0)),
    )

    told_m = flown(*bend).nearest_zone_m

    assert told_m is not None
    assert 13.5 < told_m < 15.0  # a straight line comes as near as 10.6 m


def test_who_was_not_heard_for_long_was_nowhere_in_between() -> None:
    limits = flown(status(1.0, -20.0, 20.0), status(30.0, 60.0, 20.0))

    assert limits.nearest_zone_m == pytest.approx(20.0)


def test_who_is_inside_is_no_distance_away_unless_above_it() -> None:
    inside = status(1.0, 20.0, 20.0)
    low = ZoneSpec.of(Zone(ZoneId("low"), SQUARE, ceiling_m=8.0))

    assert flown(inside).nearest_zone_m == 0.0
    assert flown(inside, zones=(low,)).nearest_zone_m is None


def test_of_the_only_place_where_to_fly_the_border_is_what_is_kept_from() -> None:
    inclusive = ZoneSpec.of(Zone(ZoneId("county"), SQUARE, inclusive=True))

    assert flown(status(1.0, 10.0, 20.0), zones=(inclusive,)).nearest_zone_m == 10.0
    assert flown(status(1.0, -10.0, 20.0), zones=(inclusive,)).nearest_zone_m == 0.0


def test_the_lowest_charge_is_told_of_each_uav_that_takes_part() -> None:
    limits = flown(
        status(0.0, 90.0, 0.0, phase=StatusPhase.PREPARING, charge=0.1),
        status(1.0, 90.0, 0.0, charge=0.5),
        status(2.0, 90.0, 0.0, charge=0.3),
        status(3.0, 90.0, 0.0, charge=1.0),  # another battery
        status(4.0, 90.0, 0.0, charge=None),
    )

    assert limits.lowest_charge_frac == {"u1": 0.3}


def test_without_zones_or_a_clock_nothing_is_known() -> None:
    limits = flown(status(1.0, 0.0, 0.0), zones=())
    limits.hear(
        "u1", Status(StatusPhase.FLYING, None, None, None, 0.4, None, {}, ""), 10.0, (POND,)
    )

    assert limits.nearest_zone_m is None
    assert math.isclose(min(limits.lowest_charge_frac.values(), default=0.0), 0.0)
