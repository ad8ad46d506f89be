"""Paths with corners: flown without a stop, and never through a zone."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from agent.core.interface import Arrived, GoTo, Home, KeepOut, Refused, Return
from agent.vehicle.config import BridgeConfig, CommandStyle
from swarm.allocation.legs.obstacles import Obstacles
from swarm.model import Zone, ZoneId
from tests.support.bridge_flight import BEHIND, ORIGIN, ROUND, WALL, BridgeFlight
from tests.support.fake_copter import SET_MODE, FakeCopter
from tests.support.fake_px4 import FakePx4

SQUARE = ((-15.0, -15.0), (15.0, -15.0), (15.0, 15.0), (-15.0, 15.0))
"""Corners of a zone around a place [m]."""


@pytest.fixture
def flight(flight: BridgeFlight) -> BridgeFlight:
    """Prepared, with a wall to fly round."""
    flight.order(KeepOut((WALL,), 3.0))
    return flight.prepared()


def closest_m(flight: BridgeFlight) -> float:
    """Of all that was flown, to the zone."""
    import shapely

    line = [each.position_enu_m[:2] for each in flight.telemetry]
    return float(shapely.distance(WALL.shape(), shapely.LineString(line)))


def test_a_path_is_flown_round_its_corners_without_a_stop(flight: BridgeFlight) -> None:
    flight.telemetry.clear()
    flight.order(GoTo(1, BEHIND, via_enu_m=ROUND))
    begun_s = flight.now_s
    flight.run_until(Arrived(1), limit_s=120.0)

    way = ((5.0, 0.0, 10.0), *ROUND, BEHIND)
    length_m = sum(math.dist(a, b) for a, b in pairwise(way))
    assert closest_m(flight) >= 3.0 - 0.05  # of bends, too, the margin is kept
    assert flight.now_s - begun_s <= length_m / 4.0 + 5.0
    for corner in ROUND:
        nearest_m = min(math.dist(corner, each.position_enu_m) for each in flight.telemetry)
        assert nearest_m <= 6.0  # this vehicle turns at once, and so cuts more than real ones


def test_no_straight_line_through_a_zone_is_flown(flight: BridgeFlight) -> None:
    order = GoTo(1, BEHIND)
    before = len(flight.copter.heard)

    assert flight.order(order)[-1] == Refused(order, "zone wall lies in the way")
    assert len(flight.copter.heard) == before


def test_an_order_is_kept_until_it_is_known_where_the_vehicle_is(flight: BridgeFlight) -> None:
    flight.now_s += 4.0  # its program was held up, and has read nothing meanwhile
    assert flight.order(GoTo(1, BEHIND, via_enu_m=ROUND)) == []
    flight.run_until(Arrived(1), limit_s=120.0)
    assert not any(isinstance(report, Refused) for report in flight.reports)


def test_an_order_is_not_kept_for_long_nor_once_there_is_another(flight: BridgeFlight) -> None:
    lost = GoTo(1, BEHIND, via_enu_m=ROUND)
    position = flight.to_bridge
    flight.to_bridge = lambda _: []
    flight.run(3.5)
    flight.order(lost)
    flight.order(GoTo(2, BEHIND, via_enu_m=ROUND))
    refused = flight.run_until(Refused, limit_s=30.0)
    assert isinstance(refused, Refused)
    assert refused.order == GoTo(2, BEHIND, via_enu_m=ROUND)
    flight.to_bridge = position
    flight.run(20.0)
    assert lost not in [each.order for each in flight.reports if isinstance(each, Refused)]


def test_corners_may_not_lead_through_one_either(flight: BridgeFlight) -> None:
    order = GoTo(1, (60.0, 0.0, 10.0), via_enu_m=((17.0, 35.0, 10.0), (24.0, 0.0, 10.0)))

    assert isinstance(flight.order(order)[-1], Refused)


def test_one_above_a_zone_may_cross_it(flight: BridgeFlight) -> None:
    low = Zone(WALL.id, WALL.polygon_enu_m, ceiling_m=8.0)
    flight.order(KeepOut((low,), 3.0))

    flight.order(GoTo(1, BEHIND))
    flight.run_until(Arrived(1), limit_s=60.0)


def test_a_zone_drawn_round_it_is_left_by_a_short_way_only(flight: BridgeFlight) -> None:
    around = Zone(ZoneId("new"), ((0.0, -20.0), (60.0, -20.0), (60.0, 20.0), (0.0, 20.0)))
    flight.order(KeepOut((around,), 0.0))
    across = GoTo(1, (80.0, 0.0, 10.0))

    assert flight.order(across)[-1] == Refused(across, "zone new lies in the way")
    flight.order(GoTo(2, (-5.0, 0.0, 10.0)))
    flight.run_until(Arrived(2), limit_s=60.0)


def test_in_a_zone_drawn_over_it_a_vehicle_may_stop_where_it_is_and_nowhere_else(
    flight: BridgeFlight,
) -> None:
    flight.order(GoTo(1, (60.0, 40.0, 10.0)))
    flight.run(5.0)
    here = flight.telemetry[-1].position_enu_m
    around = Zone(ZoneId("new"), tuple((here[0] + e, here[1] + n) for e, n in SQUARE))
    flight.order(KeepOut((around,), 0.0))
    farther = GoTo(2, (here[0] + 8.0, here[1], here[2]))
    assert flight.order(farther)[-1] == Refused(farther, "zone new lies in the way")

    stop = GoTo(3, here)
    assert Refused(stop, "zone new lies in the way") not in flight.order(stop)
    flight.run_until(Arrived(3), limit_s=30.0)

    assert math.dist(flight.telemetry[-1].position_enu_m, here) <= 1.0
    nearer = GoTo(4, (here[0] + 2.5, here[1], here[2]))
    assert flight.order(nearer)[-1] == Refused(nearer, "zone new lies in the way")


def test_who_hovers_beside_a_zone_is_not_let_into_it(flight: BridgeFlight) -> None:
    here = flight.telemetry[-1].position_enu_m
    beside = Zone(ZoneId("new"), tuple((here[0] + 16.0 + e, here[1] + n) for e, n in SQUARE))
    flight.order(KeepOut((beside,), 0.0))
    order = GoTo(1, (here[0] + 1.9, here[1], here[2]))

    assert flight.order(order)[-1] == Refused(order, "zone new lies in the way")


def test_a_path_is_replaced_by_another_in_the_middle_of_it(flight: BridgeFlight) -> None:
    flight.telemetry.clear()
    flight.order(GoTo(1, BEHIND, via_enu_m=ROUND))
    flight.run(9.0)

    flight.order(GoTo(2, (5.0, 0.0, 10.0), via_enu_m=((14.0, 30.0, 10.0),)))
    flight.run_until(Arrived(2), limit_s=120.0)

    assert Arrived(1) not in flight.reports
    assert closest_m(flight) >= 3.0 - 0.05  # of bends, too, the margin is kept


def test_it_comes_home_round_a_zone_and_lands_there(flight: BridgeFlight) -> None:
    flight.order(GoTo(1, BEHIND, via_enu_m=ROUND))
    flight.run_until(Arrived(1), limit_s=120.0)
    flight.telemetry.clear()

    flight.order(Return("over", via_enu_m=(4.0, 2.0, 10.0), path_enu_m=ROUND[::-1], land=True))
    flight.run_until(Home, limit_s=180.0)

    assert closest_m(flight) >= 3.0 - 0.05  # of bends, too, the margin is kept
    assert flight.copter.position_m == pytest.approx((4.0, 2.0, 0.0), abs=1.5)


def test_where_a_zone_lies_between_it_and_home_it_lands_where_it_is(flight: BridgeFlight) -> None:
    flight.order(GoTo(1, BEHIND, via_enu_m=ROUND))
    flight.run_until(Arrived(1), limit_s=120.0)
    flight.telemetry.clear()

    flight.order(Return("its battery is low"))
    flight.run_until(Home, limit_s=180.0)

    assert closest_m(flight) >= 3.0 - 0.05  # of bends, too, the margin is kept
    assert flight.copter.position_m == pytest.approx((*BEHIND[:2], 0.0), abs=1.5)


def test_many_random_paths_keep_out_of_zones(fake: type[FakeCopter]) -> None:
    """Whatever way is ordered, what is flown stays out of it, or nothing is."""
    random = np.random.default_rng(5)
    flight = BridgeFlight(fake(ORIGIN), BridgeConfig(1, ORIGIN))
    flight.order(KeepOut((WALL,), 3.0))
    flight.prepared()
    flight.telemetry.clear()
    inside = Obstacles([WALL], 0.0)
    for leg in range(1, 16):
        points = [(*random.uniform(-60.0, 60.0, 2).tolist(), 10.0) for _ in range(3)]
        flight.order(GoTo(leg, points[-1], via_enu_m=tuple(points[:-1])))
        flight.run(random.uniform(1.0, 20.0))

    flown_m = np.array([each.position_enu_m[:2] for each in flight.telemetry])
    assert inside.free(flown_m).all()
    assert np.ptp(flown_m[:, 0]) > 0.0


def test_px4_is_given_corners_in_the_middle_of_a_mission_and_flies_on() -> None:
    """It begins a mission anew; ArduCopter would go on with the item of the same number."""
    stopped = {}
    for fake in (FakeCopter, FakePx4):
        config = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION)
        flight = BridgeFlight(fake(ORIGIN), config).prepared()
        flight.order(GoTo(1, BEHIND, via_enu_m=ROUND))
        flight.run_until(Arrived(1), limit_s=120.0)
        before = len(flight.copter.commands(SET_MODE))

        flight.order(GoTo(2, (0.0, 0.0, 10.0), via_enu_m=ROUND[::-1]))
        flight.run_until(Arrived(2), limit_s=120.0)

        stopped[fake] = len(flight.copter.commands(SET_MODE)) > before
    assert stopped == {FakeCopter: True, FakePx4: False}
