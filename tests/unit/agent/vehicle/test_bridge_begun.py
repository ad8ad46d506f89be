"""An agent is killed while its vehicle takes off: the next life knows whose take-off that was."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from agent.core.interface import Refused, VehicleReady
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, INTERVAL, SET_MODE, TAKEOFF, FakeCopter
from tests.support.fake_px4 import FakePx4

BEGUN = replace(START, begun=True)
FLOWN_IN_HOLD = "flown by its pilot: land it, or switch it to AUTO.LOITER (Hold) from another mode"


def killed(
    fake: type[FakeCopter], when: Callable[[FakeCopter], bool], *, down_s: float = 1.0
) -> BridgeFlight:
    """A bridge that was started anew, as the one before died at that moment."""
    flight = BridgeFlight(fake(ORIGIN))
    flight.order(START)
    while not when(flight.copter):
        flight.step()
    flight.restart(down_s)
    flight.copter.heard.clear()
    return flight


def is_climbing(copter: FakeCopter) -> bool:
    return copter.airborne


@pytest.mark.parametrize("down_s", [1.0, 15.0], ids=["climbing", "hovering"])
def test_a_take_off_of_an_earlier_life_is_gone_on_with(
    fake: type[FakeCopter], down_s: float
) -> None:
    flight = killed(fake, is_climbing, down_s=down_s)
    assert flight.motors == [True]
    flight.order(BEGUN)
    flight.run_until(VehicleReady())

    assert math.dist(flight.copter.position_m, START.position_enu_m) < 1.0
    assert not {SET_MODE, ARM} & flight.copter.count().keys()
    assert flight.motors == [True]


def test_motors_that_an_earlier_life_started_take_off_for_the_next_one(
    fake: type[FakeCopter],
) -> None:
    flight = killed(fake, lambda copter: copter.armed and not copter.airborne)
    assert not flight.copter.airborne
    flight.order(BEGUN)
    flight.run_until(VehicleReady())

    assert not {SET_MODE, ARM} & flight.copter.count().keys()


def test_without_knowing_of_its_take_off_a_px4_is_its_pilots() -> None:
    flight = killed(FakePx4, is_climbing)
    flight.order(START)
    flight.run(20.0)

    assert flight.reasons()[-1] == FLOWN_IN_HOLD
    assert set(flight.copter.count()) <= {INTERVAL}


def test_motors_that_stood_meanwhile_are_not_ours_when_somebody_starts_them(
    fake: type[FakeCopter],
) -> None:
    flight = killed(fake, lambda copter: copter.armed)
    flight.copter.armed, flight.copter.prearm_ok = False, False
    flight.order(BEGUN)
    flight.run(3.0)
    assert flight.motors == [True, False]

    flight.copter.armed, flight.copter.armed_at_s = True, math.inf
    flight.run(3.0)
    assert flight.reasons()[-1] == "armed by somebody else: disarm it"
    flight.copter.armed = False
    assert isinstance(flight.run_until(Refused), Refused)
    assert not {ARM, TAKEOFF} & flight.copter.count().keys()


def test_a_pilot_who_took_over_meanwhile_keeps_the_vehicle(fake: type[FakeCopter]) -> None:
    flight = killed(fake, is_climbing)
    flight.copter.set_mode(fake.pilot_mode)
    flight.order(BEGUN)
    flight.run(5.0)

    assert "by its pilot: land it" in flight.reasons()[-1]
    assert set(flight.copter.count()) <= {INTERVAL}
    assert flight.motors == [True, False]


def test_whoever_armed_it_before_us_is_told_as_nobodys_take_off_of_ours(
    fake: type[FakeCopter],
) -> None:
    copter = fake(ORIGIN, ready_s=1.0)
    copter.prearm_ok = False
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run(5.0)
    copter.armed, copter.armed_at_s = True, math.inf
    flight.run(5.0)

    assert flight.motors == []
