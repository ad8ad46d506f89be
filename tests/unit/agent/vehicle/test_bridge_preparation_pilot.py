"""Preparing a vehicle that flies already, or that a pilot has a hand in."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import HandedOver, Hold, Prepare, Refused, VehicleReady
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, FAILED, INTERVAL, SET_MODE, TAKEOFF, FakeCopter
from tests.support.fake_px4 import FakePx4


def test_vehicle_that_flies_already_does_not_take_off_again(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    again = BridgeFlight(flight.copter)  # another agent, and its pilot hands it over
    flight.copter.set_mode(fake.pilot_mode)
    again.run(2.0)
    flight.copter.set_mode(fake.own_mode)
    flight.copter.heard.clear()
    again.order(Prepare((60.0, 0.0, 12.0), 5.0))
    again.run_until(VehicleReady())

    heard = again.copter.count()
    assert heard[TAKEOFF] == heard[ARM] == heard[SET_MODE] == 0
    assert math.dist(again.copter.position_m, (60.0, 0.0, 12.0)) < 1.0
    assert again.copter.speed_m_s == 5.0


def test_vehicle_flown_by_its_pilot_is_waited_for_and_not_touched(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying()
    flight.copter.set_mode(fake.pilot_mode)
    again = BridgeFlight(flight.copter)
    flight.copter.heard.clear()
    again.order(START)
    again.run(5.0)
    assert again.reasons()[-1].startswith(
        f"armed in {fake.mode_names[fake.pilot_mode]} by its pilot: land it, or switch it to "
    )
    assert set(again.copter.count()) == {INTERVAL}

    flight.copter.set_mode(fake.own_mode)  # the pilot hands it to us
    again.run_until(VehicleReady())


ARMED_BY_SOMEBODY = "armed by somebody else: disarm it"
FLOWN_IN_HOLD = "flown by its pilot: land it, or switch it to AUTO.LOITER (Hold) from another mode"


@pytest.mark.parametrize("ordered_first", [False, True])
def test_vehicle_that_somebody_else_armed_on_the_ground_is_never_taken_off(
    fake: type[FakeCopter], ordered_first: bool
) -> None:
    copter = fake(ORIGIN, ready_s=1.0)
    copter.prearm_ok = False
    flight = BridgeFlight(copter)
    if ordered_first:
        flight.order(START)
    flight.run(5.0)
    copter.set_mode(fake.own_mode)
    copter.armed, copter.armed_at_s = True, copter.now_s + 30.0
    flight.run(1.5)
    copter.prearm_ok = True
    if not ordered_first:
        flight.order(START)
    flight.run(20.0)
    assert flight.reasons()[-1] == ARMED_BY_SOMEBODY
    assert set(copter.count()) <= {INTERVAL, SET_MODE}

    copter.armed = False
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "somebody else armed it" in refused.reason
    assert not {ARM, TAKEOFF} & set(copter.count())


def test_vehicle_whose_arming_was_refused_to_us_and_done_after_all_is_ours(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.copter.verdicts[ARM] = [FAILED]
    flight.order(START)
    while not flight.copter.commands(ARM):
        flight.step()
    flight.copter.armed, flight.copter.armed_at_s = True, flight.now_s
    flight.run_until(VehicleReady())


def hovering_in_hold(*, armed_s: float = 0.0) -> BridgeFlight:
    """A PX4 that its pilot let hover in Hold, and a new agent."""
    flight = BridgeFlight(BridgeFlight(FakePx4(ORIGIN)).flying().copter)
    flight.copter.heard.clear()
    flight.run(armed_s)
    return flight


@pytest.mark.parametrize("armed_s", [0.0, 5.0])
def test_hold_of_a_px4_in_the_air_is_no_consent(armed_s: float) -> None:
    flight = hovering_in_hold(armed_s=armed_s)
    flight.order(START)
    flight.run(30.0)
    assert flight.reasons()[-1] == FLOWN_IN_HOLD
    assert set(flight.copter.count()) <= {INTERVAL}

    flight.copter.set_mode(flight.copter.return_mode)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "its pilot flew and landed it" in refused.reason
    assert set(flight.copter.count()) <= {INTERVAL}


def test_hold_that_a_px4_is_seen_to_enter_is_consent() -> None:
    flight = hovering_in_hold()
    flight.order(START)
    flight.run(5.0)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run(2.0)
    flight.copter.set_mode(flight.copter.own_mode)
    flight.run_until(VehicleReady())
    assert not {ARM, TAKEOFF} & set(flight.copter.count())


def test_hold_that_a_px4_falls_into_by_a_failsafe_is_no_consent() -> None:
    flight = hovering_in_hold()
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.order(START)
    flight.run(3.0)
    flight.copter.system_status = 5
    flight.copter.set_mode(flight.copter.own_mode)
    flight.run(10.0)
    assert flight.reasons()[-1] == FLOWN_IN_HOLD
    assert set(flight.copter.count()) <= {INTERVAL}


def test_vehicle_that_hovers_on_our_orders_is_prepared_anew(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).prepared()
    flight.order(Hold("wait"))
    flight.run(3.0)
    flight.order(START)
    flight.run_until(VehicleReady())


def test_vehicle_landed_by_its_pilot_does_not_start_by_itself(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN, ready_s=1.0)
    flight = BridgeFlight(copter)
    flight.run(3.0)
    copter.set_mode(fake.pilot_mode)
    copter.armed, copter.armed_at_s = True, copter.now_s
    flight.run(1.5)
    flight.order(START)
    flight.run(3.0)
    copter.armed = False
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "its pilot flew and landed it" in refused.reason
    assert not copter.commands(ARM)


def test_pilot_who_takes_over_during_takeoff_keeps_the_vehicle(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    while not flight.copter.airborne:
        flight.step()
    flight.run(1.0)
    flight.copter.set_mode(fake.pilot_mode)
    handed = flight.run_until(HandedOver)
    name = fake.mode_names[fake.pilot_mode]
    assert handed == HandedOver(f"its pilot switched it to {name}")
    flight.copter.heard.clear()
    flight.run(10.0)
    assert set(flight.copter.count()) <= {INTERVAL}
