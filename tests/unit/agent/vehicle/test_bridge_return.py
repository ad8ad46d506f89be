"""The way home: first in the UAV's own layer to its start, then in the return mode."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import (
    GoTo,
    HandedOver,
    Hold,
    Home,
    Refused,
    Return,
    ReturnAdvised,
    ReturnBegun,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight, rough_link
from tests.support.fake_copter import DENIED, REPOSITION, SET_MODE, FakeCopter

FAR = (100.0, 30.0, 10.0)
VIA = START.position_enu_m
RETURN = Return("mission ended", via_enu_m=VIA)


def under_way(flight: BridgeFlight) -> BridgeFlight:
    flight.prepared()
    flight.order(GoTo(1, FAR))
    flight.run(15.0)
    assert math.dist(flight.copter.position_m, VIA) > 30.0
    flight.copter.heard.clear()
    return flight


def returns_at(flight: BridgeFlight, limit_s: float = 60.0) -> float:
    """How far from the place it is when it is in the return mode."""
    end_s = flight.now_s + limit_s
    while flight.copter.mode != flight.copter.return_mode:
        assert flight.now_s < end_s, "never ordered to return"
        flight.step()
    return math.dist(flight.copter.position_m, VIA)


def test_it_flies_to_its_start_in_its_layer_and_returns_from_there(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    while flight.copter.mode != flight.copter.return_mode:
        assert flight.seen == []
        assert abs(flight.copter.position_m[2] - VIA[2]) < 0.5, "it left its layer"
        flight.step()
    assert math.dist(flight.copter.position_m, VIA) < 1.0
    flight.run_until(Home())
    assert flight.seen == [ReturnBegun()]
    assert flight.reports == [Home()]


@pytest.mark.parametrize("seed", range(4))
def test_it_comes_home_over_a_rough_link(flight: BridgeFlight, seed: int) -> None:
    under_way(flight)
    flight.to_vehicle, flight.to_bridge = rough_link(seed), rough_link(seed + 100)
    flight.order(RETURN)
    flight.run_until(Home(), limit_s=120.0)
    assert not any(isinstance(r, HandedOver | Refused) for r in flight.reports)


def test_a_return_without_a_place_begins_at_once(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(Return("battery"))
    assert returns_at(flight, 3.0) > 20.0
    assert not flight.copter.commands(REPOSITION)


def test_ordered_again_without_a_place_it_returns_from_where_it_is(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(3.0)
    assert flight.copter.mode == flight.copter.own_mode
    flight.order(Return("told to stop"))
    assert returns_at(flight, 3.0) > 10.0
    flight.run_until(Home())


def test_a_place_that_is_refused_is_not_insisted_on(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.verdicts[REPOSITION] = [DENIED]
    flight.order(RETURN)
    assert returns_at(flight, 5.0) > 20.0
    flight.run_until(Home())


def test_a_mode_that_is_refused_is_not_insisted_on(fake: type[FakeCopter]) -> None:
    config = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION)
    flight = under_way(BridgeFlight(fake(ORIGIN), config))
    flight.copter.verdicts[SET_MODE] = [DENIED]
    flight.order(RETURN)
    assert returns_at(flight, 5.0) > 20.0
    assert not flight.copter.commands(REPOSITION)


def test_a_vehicle_that_does_not_move_returns_from_where_it_is(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.stuck = True
    flight.order(RETURN)
    assert returns_at(flight, 60.0) > 20.0
    flight.run_until(Home())


def test_a_vehicle_that_takes_too_long_returns_from_where_it_is(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(2.0)
    flight.copter.speed_m_s = 0.6
    distance_m = math.dist(flight.copter.position_m, VIA)
    assert returns_at(flight, 30.0 + 3.0 * distance_m / 4.0 + 20.0) > 5.0


def test_a_low_battery_on_the_way_ends_it(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(1.0)
    flight.copter.battery_percent = 10
    flight.run_until(ReturnAdvised)
    assert returns_at(flight, 3.0) > 5.0
    flight.run_until(Home())


def test_without_a_position_it_returns_at_once(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(1.0)
    flight.copter.deaf_to.add(33)
    assert returns_at(flight, 12.0) > 0.0
    assert not any(isinstance(r, HandedOver) for r in flight.reports)


def test_without_a_position_before_it_returns_at_once(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.deaf_to.add(33)
    flight.run(4.0)
    flight.order(RETURN)
    assert returns_at(flight, 3.0) > 20.0
    assert not flight.copter.commands(REPOSITION)


@pytest.mark.parametrize("via", [(30_000.0, 0.0, 10.0), (math.nan, 0.0, 10.0)])
def test_a_place_beyond_the_fence_is_never_sent(
    flight: BridgeFlight, via: tuple[float, float, float]
) -> None:
    under_way(flight)
    flight.order(Return("mission ended", via_enu_m=via))
    assert returns_at(flight, 3.0) > 20.0
    assert not flight.copter.commands(REPOSITION)


def test_a_vehicle_that_returns_already_is_left_to_it(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.copter.set_mode(flight.copter.return_mode)
    flight.run_until(HandedOver)
    flight.order(RETURN)
    flight.run_until(Home())
    assert not flight.copter.commands(REPOSITION)


def test_a_failsafes_return_on_the_way_is_left_to_it(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(5.0)
    flight.copter.heard.clear()
    flight.copter.set_mode(flight.copter.return_mode)
    flight.run_until(Home())
    assert not flight.copter.commands(REPOSITION)
    assert not flight.copter.commands(SET_MODE)


def test_a_pilot_who_takes_over_on_the_way_keeps_the_vehicle(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(5.0)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run_until(HandedOver)
    flight.run(10.0)
    assert flight.copter.mode == flight.copter.pilot_mode


def test_it_is_stopped_on_the_way_and_goes_on_home(flight: BridgeFlight) -> None:
    under_way(flight)
    flight.order(RETURN)
    flight.run(5.0)
    flight.order(Hold("wait"))
    flight.run(5.0)
    assert flight.copter.velocity_m_s == (0.0, 0.0, 0.0)
    assert flight.bridge.phase is FlightPhase.HOVERING
    flight.order(RETURN)
    assert returns_at(flight) < 1.0
    flight.run_until(Home())


def test_a_new_life_brings_it_home_the_same_way(fake: type[FakeCopter]) -> None:
    flight = under_way(BridgeFlight(fake(ORIGIN))).restart()
    flight.run(5.0)  # until it knows where the vehicle is
    flight.order(Return("over", resume=True, via_enu_m=VIA))
    assert returns_at(flight) < 1.0
    flight.run_until(Home())
