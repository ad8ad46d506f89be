"""Which ways a vehicle may be told, by the zones that it has to heed."""

from __future__ import annotations

import pytest

from agent.vehicle.zone_guard import ZoneGuard
from swarm.model import Zone, ZoneId
from swarm.protocol.fields import Point

POND = Zone(ZoneId("pond"), ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)))


def objection(here: Point, there: Point) -> str | None:
    return ZoneGuard([POND], 5.0).objection([here, there])


@pytest.mark.parametrize("far_m", [60.0, 1e4, 1e12])
def test_who_is_inside_may_leave_on_a_short_way_however_far_that_goes_on(far_m: float) -> None:
    assert objection((35.0, 20.0, 10.0), (far_m, 20.0, 10.0)) is None
    assert objection((35.0, 20.0, 10.0), (-far_m, 20.0, 10.0)) == "zone pond lies in the way"


def test_a_way_that_stays_inside_is_no_way_out() -> None:
    assert objection((10.0, 20.0, 10.0), (30.0, 20.0, 10.0)) == "zone pond lies in the way"
    assert objection((20.0, 20.0, 10.0), (20.0, 20.0, 10.0)) == "zone pond lies in the way"


def test_ways_beside_a_zone_are_free_and_ways_through_it_are_not() -> None:
    assert objection((-20.0, -10.0, 10.0), (60.0, -10.0, 10.0)) is None
    assert objection((-20.0, 20.0, 10.0), (60.0, 20.0, 10.0)) == "zone pond lies in the way"
