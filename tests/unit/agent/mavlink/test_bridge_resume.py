"""A new life of the bridge meets a vehicle that an earlier one left in the air."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.mavlink.bridge import Phase
from agent.vehicle import (
    Arrived,
    GoTo,
    HandedOver,
    Home,
    NotReady,
    Refused,
    Return,
    VehicleReady,
)
from tests.bridge_flight import ORIGIN, START, BridgeFlight
from tests.fake_copter import (
    ARM,
    GUIDED,
    LOITER,
    REPOSITION,
    RTL,
    SET_MODE,
    SPEED,
    TAKEOFF,
    FakeCopter,
)

RESUME = replace(START, resume=True)
RETURN = Return("the mission is over", resume=True)


def crashed() -> BridgeFlight:
    """A bridge that was killed on the way to a far place, and started anew."""
    flight = BridgeFlight().flying(leg=7).restart()
    flight.copter.heard.clear()
    return flight


# -- in a running mission ---------------------------------------------------------------


def test_a_vehicle_in_the_air_flies_on_while_the_new_life_takes_over() -> None:
    flight = crashed()
    east_m = [flight.copter.position_m[0]]
    flight.order(RESUME)
    while not any(isinstance(r, VehicleReady) for r in flight.reports):
        flight.step()
        east_m.append(flight.copter.position_m[0])

    assert east_m == sorted(east_m)
    assert east_m[-1] > east_m[0]
    assert not {SET_MODE, ARM, TAKEOFF, REPOSITION} & flight.copter.count().keys()
    assert flight.copter.count()[SPEED] == 1


def test_it_says_where_the_vehicle_is_before_it_says_that_it_is_ready() -> None:
    flight = crashed()
    flight.telemetry.clear()
    flight.order(RESUME)
    flight.run_until(VehicleReady())

    assert flight.telemetry
    assert flight.telemetry[-1].position_enu_m[0] > START.position_enu_m[0] + 4.0


def test_the_old_target_ordered_again_is_reached() -> None:
    flight = crashed()
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    flight.order(GoTo(1, (100.0, 0.0, 10.0)))

    flight.run_until(Arrived(1))


def test_a_vehicle_that_arrived_meanwhile_arrives_again_at_once() -> None:
    flight = BridgeFlight().flying(leg=7, east_m=12.0).restart(down_s=10.0)
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    began_s = flight.now_s
    flight.order(GoTo(1, (12.0, 0.0, 10.0)))

    flight.run_until(Arrived(1))
    assert flight.now_s - began_s < 1.0


def test_a_vehicle_on_the_ground_takes_off_as_usual() -> None:
    flight = BridgeFlight()
    flight.order(RESUME)
    flight.run_until(VehicleReady())

    assert {ARM, TAKEOFF, REPOSITION} <= flight.copter.count().keys()
    assert flight.bridge.phase is Phase.HOVERING


def test_a_vehicle_that_was_taking_off_is_prepared_to_the_end() -> None:
    flight = BridgeFlight()
    flight.order(START)
    while not flight.copter.airborne:
        flight.step()
    flight.run(1.0)
    assert flight.copter.in_takeoff
    flight.restart(down_s=0.5)
    flight.order(RESUME)
    flight.run_until(VehicleReady())

    assert flight.copter.position_m == pytest.approx(START.position_enu_m, abs=1.0)
    assert flight.copter.speed_m_s == START.speed_m_s


def test_a_vehicle_its_pilot_flies_is_waited_for_and_not_commanded() -> None:
    flight = BridgeFlight().flying()
    flight.copter.set_mode(LOITER)
    flight.restart()
    flight.copter.heard.clear()
    flight.order(RESUME)
    flight.run(30.0)

    assert not {SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED} & flight.copter.count().keys()
    assert not any(isinstance(r, VehicleReady) for r in flight.reports)
    assert "LOITER" in flight.reasons()[-1]

    flight.copter.set_mode(GUIDED)
    flight.run_until(VehicleReady())


def test_a_pilot_who_takes_over_while_it_is_resumed_keeps_the_vehicle() -> None:
    flight = crashed()
    flight.copter.verdicts[SPEED] = [None] * 9
    flight.order(RESUME)
    flight.run(2.0)
    flight.copter.set_mode(LOITER)

    flight.run_until(HandedOver)


# -- after the mission ------------------------------------------------------------------


def test_a_return_finds_the_vehicle_in_the_air_and_brings_it_home() -> None:
    flight = crashed()
    assert Home() not in flight.order(RETURN)
    flight.run_until(Home())

    assert not flight.copter.armed
    assert flight.copter.count()[SET_MODE] == 1


def test_a_return_waits_for_a_vehicle_that_is_on_its_way_home_already() -> None:
    flight = BridgeFlight().flying()
    flight.order(Return("over"))
    flight.run(2.0)
    assert flight.copter.mode == RTL
    flight.restart()
    flight.copter.heard.clear()
    flight.order(RETURN)
    flight.run_until(Home())

    assert SET_MODE not in flight.copter.count()
    assert not flight.copter.armed


def test_a_return_leaves_a_pilot_the_vehicle() -> None:
    flight = BridgeFlight().flying()
    flight.copter.set_mode(LOITER)
    flight.restart()
    flight.order(RETURN)
    assert flight.run_until(HandedOver) == HandedOver("its pilot flies it in LOITER")

    flight.run(10.0)
    assert flight.copter.mode == LOITER


def test_a_return_of_a_vehicle_on_the_ground_is_over_once_it_is_heard() -> None:
    flight = BridgeFlight()
    assert Home() not in flight.order(RETURN)
    flight.run_until(Home())

    assert not {SET_MODE, ARM, TAKEOFF} & flight.copter.count().keys()


def test_a_vehicle_that_is_never_heard_is_reported_and_not_taken_for_home() -> None:
    copter = FakeCopter(ORIGIN)
    copter.silent = True
    flight = BridgeFlight(copter)
    flight.order(RETURN)
    refused = flight.run_until(Refused)

    assert refused == Refused(RETURN, "waiting for a heartbeat of system id 1")
    assert any(isinstance(r, NotReady) for r in flight.reports)
    assert flight.now_s - 100.0 == pytest.approx(3 * flight.bridge.config.silence_timeout_s, abs=1)
