"""A vehicle makes room and goes on as it was ordered; whoever takes it over keeps it as it is."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import Arrived, GiveWay, GoTo, HandedOver, Hold
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import LOITER, SPEED, FakeCopter

FAR = (5.0, 60.0, 10.0)
ASIDE = (25.0, 20.0, 10.0)


def under_way() -> BridgeFlight:
    flight = BridgeFlight(FakeCopter(ORIGIN)).prepared()
    flight.order(GoTo(1, FAR))
    flight.run(3.0)
    flight.copter.heard.clear()
    return flight


def speeds_m_s(flight: BridgeFlight) -> list[float]:
    return [message.param2 for message in flight.copter.commands(SPEED)]


def test_it_stands_until_there_is_room_and_then_flies_on_to_where_it_was_sent() -> None:
    flight = under_way()
    flight.order(GiveWay(stands=True))
    flight.run(5.0)
    stood_at_m = flight.copter.position_m
    flight.run(5.0)
    assert math.dist(flight.copter.position_m, stood_at_m) < 0.5
    flight.order(GiveWay())
    flight.run_until(Arrived(1))
    assert math.dist(flight.copter.position_m, FAR) < 1.0


def test_it_flies_aside_and_then_on() -> None:
    flight = under_way()
    flight.order(GiveWay((ASIDE,)))
    flight.run(20.0)
    assert math.dist(flight.copter.position_m, ASIDE) < 1.0
    flight.order(GiveWay())
    flight.run_until(Arrived(1))


def test_it_flies_slower_and_then_as_fast_as_before() -> None:
    flight = under_way()
    flight.order(GiveWay(speed_m_s=2.0))
    flight.run(1.0)
    flight.order(GiveWay())
    flight.run(1.0)
    assert speeds_m_s(flight) == [2.0, START.speed_m_s]


@pytest.mark.parametrize("speed_m_s", [math.inf, math.nan, 0.0, -1.0, 1e6])
def test_no_speed_is_told_that_is_none_or_above_its_cruise_speed(speed_m_s: float) -> None:
    flight = under_way()
    flight.order(GiveWay(speed_m_s=speed_m_s))
    flight.run(1.0)
    assert speeds_m_s(flight) == []


def test_a_pilot_who_takes_over_one_that_was_slowed_keeps_that_speed() -> None:
    flight = under_way()
    flight.order(GiveWay(speed_m_s=2.0))
    flight.run(1.0)
    flight.copter.set_mode(LOITER)
    flight.run_until(HandedOver)
    flight.copter.heard.clear()
    flight.order(Hold("test"))
    flight.run(3.0)
    assert speeds_m_s(flight) == []
