"""A new life of the bridge meets a vehicle that an earlier one left in the air."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Home,
    NotReady,
    Refused,
    Return,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, REPOSITION, SET_MODE, SPEED, TAKEOFF, FakeCopter

RESUME = replace(START, resume=True)
RETURN = Return("the mission is over", resume=True)


def crashed(fake: type[FakeCopter]) -> BridgeFlight:
    """A bridge that was killed on the way to a far place, and started anew."""
    flight = BridgeFlight(fake(ORIGIN)).flying(leg=7).restart()
    flight.copter.heard.clear()
    return flight


# -- in a running mission ---------------------------------------------------------------


def test_a_vehicle_in_the_air_flies_on_while_the_new_life_takes_over(
    fake: type[FakeCopter],
) -> None:
    flight = crashed(fake)
    east_m = [flight.copter.position_m[0]]
    flight.order(RESUME)
    while not any(isinstance(r, VehicleReady) for r in flight.reports):
        flight.step()
        east_m.append(flight.copter.position_m[0])

    assert east_m == sorted(east_m)
    assert east_m[-1] > east_m[0]
    assert not {SET_MODE, ARM, TAKEOFF, REPOSITION} & flight.copter.count().keys()
    assert flight.copter.count()[SPEED] == 1


def test_it_says_where_the_vehicle_is_before_it_says_that_it_is_ready(
    fake: type[FakeCopter],
) -> None:
    flight = crashed(fake)
    flight.telemetry.clear()
    flight.order(RESUME)
    flight.run_until(VehicleReady())

    assert flight.telemetry
    assert flight.telemetry[-1].position_enu_m[0] > START.position_enu_m[0] + 4.0


def test_the_old_target_ordered_again_is_reached(fake: type[FakeCopter]) -> None:
    flight = crashed(fake)
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    flight.order(GoTo(1, (100.0, 0.0, 10.0)))

    flight.run_until(Arrived(1))


def test_a_vehicle_that_arrived_meanwhile_arrives_again_at_once(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying(leg=7, east_m=12.0).restart(down_s=10.0)
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    began_s = flight.now_s
    flight.order(GoTo(1, (12.0, 0.0, 10.0)))

    flight.run_until(Arrived(1))
    assert flight.now_s - began_s < 1.0


def test_a_vehicle_on_the_ground_takes_off_as_usual(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(RESUME)
    flight.run_until(VehicleReady())

    assert {ARM, TAKEOFF, REPOSITION} <= flight.copter.count().keys()
    assert flight.bridge.phase is FlightPhase.HOVERING


def test_a_vehicle_that_was_taking_off_is_prepared_to_the_end(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
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


def test_a_vehicle_its_pilot_flies_is_waited_for_and_not_commanded(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.pilot_mode)
    flight.restart()
    flight.copter.heard.clear()
    flight.order(RESUME)
    flight.run(30.0)

    assert not {SET_MODE, ARM, TAKEOFF, REPOSITION, SPEED} & flight.copter.count().keys()
    assert not any(isinstance(r, VehicleReady) for r in flight.reports)
    assert fake.mode_names[fake.pilot_mode] in flight.reasons()[-1]

    flight.copter.set_mode(fake.own_mode)
    flight.run_until(VehicleReady())


def test_a_pilot_who_takes_over_while_it_is_resumed_keeps_the_vehicle(
    fake: type[FakeCopter],
) -> None:
    flight = crashed(fake)
    flight.copter.verdicts[SPEED] = [None] * 9
    flight.order(RESUME)
    flight.run(2.0)
    flight.copter.set_mode(fake.pilot_mode)

    flight.run_until(HandedOver)


# -- after the mission ------------------------------------------------------------------


def test_a_return_finds_the_vehicle_in_the_air_and_brings_it_home(fake: type[FakeCopter]) -> None:
    flight = crashed(fake)
    assert Home() not in flight.order(RETURN)
    flight.run_until(Home())

    assert not flight.copter.armed
    assert flight.copter.count()[SET_MODE] == 1


def test_a_return_waits_for_a_vehicle_that_is_on_its_way_home_already(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.order(Return("over"))
    flight.run(2.0)
    assert flight.copter.mode == fake.return_mode
    flight.restart()
    flight.copter.heard.clear()
    flight.order(RETURN)
    flight.run_until(Home())

    assert SET_MODE not in flight.copter.count()
    assert not flight.copter.armed


def test_a_return_leaves_a_pilot_the_vehicle(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.pilot_mode)
    flight.restart()
    flight.order(RETURN)
    assert flight.run_until(HandedOver) == HandedOver(
        f"its pilot flies it in {fake.mode_names[fake.pilot_mode]}"
    )

    flight.run(10.0)
    assert flight.copter.mode == fake.pilot_mode


def test_a_return_of_a_vehicle_on_the_ground_is_over_once_it_is_heard(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    assert Home() not in flight.order(RETURN)
    flight.run_until(Home())

    assert not {SET_MODE, ARM, TAKEOFF} & flight.copter.count().keys()


def test_a_vehicle_that_is_never_heard_is_reported_and_not_taken_for_home(
    fake: type[FakeCopter],
) -> None:
    copter = fake(ORIGIN)
    copter.silent = True
    flight = BridgeFlight(copter)
    flight.order(RETURN)
    refused = flight.run_until(Refused)

    assert refused == Refused(RETURN, "waiting for a heartbeat of system id 1")
    assert any(isinstance(r, NotReady) for r in flight.reports)
    assert flight.now_s - 100.0 == pytest.approx(3 * flight.bridge.config.silence_timeout_s, abs=1)


def test_a_vehicle_left_in_the_air_and_found_on_the_ground_is_not_started(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    order = replace(RESUME, left_in_air=True)
    flight.order(order)
    refused = flight.run_until(Refused)

    assert isinstance(refused, Refused)
    assert refused.reason.startswith("it was left in the air and stands on the ground now")
    flight.run(20.0)
    assert not {ARM, TAKEOFF} & flight.copter.count().keys()
