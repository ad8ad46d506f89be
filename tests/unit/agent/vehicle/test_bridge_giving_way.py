"""Missions of ArduCopter give way to targets, and go on by themselves without them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import Arrived, GoTo, HandedOver, Hold, Refused, VehicleReady
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.mission_plan import MissionPlan
from swarm.model.frames import wgs84_from_enu
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import (
    AUTO,
    DENIED,
    FAILED,
    GUIDED,
    LOITER,
    REPOSITION,
    SPEED,
    FakeCopter,
)

MISSIONS = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION, mission_patience_s=20.0)
NORTH, EAST, FAR = (5.0, 40.0, 12.0), (45.0, 0.0, 12.0), (205.0, 0.0, 12.0)
GUIDED_ITEM, TARGET_ITEM = 3, 4


def prepared() -> BridgeFlight:
    flight = BridgeFlight(FakeCopter(ORIGIN), MISSIONS).prepared()
    flight.copter.heard.clear()
    return flight


def sets_of(flight: BridgeFlight) -> list[int]:
    return [m.seq for m in flight.copter.heard if m.get_type() == "MISSION_SET_CURRENT"]


def deaf(flight: BridgeFlight) -> None:
    """The companion dies."""
    flight.happen = lambda _: []  # type: ignore[method-assign, assignment]


def left_alone(flight: BridgeFlight, limit_s: float) -> float:
    """How long the vehicle takes to come home and stop its motors."""
    began_s = flight.now_s
    while flight.copter.armed:
        flight.step()
        assert flight.now_s - began_s < limit_s
    assert math.dist(flight.copter.position_m, flight.copter.home_m) < 0.5
    return flight.now_s - began_s


def test_a_leg_is_flown_to_a_target_at_the_speed_told_in_the_mission_mode() -> None:
    flight = prepared()
    flight.order(GoTo(1, NORTH))
    flight.run(3.0)
    copter = flight.copter
    assert (copter.mode, copter.mission.current) == (AUTO, GUIDED_ITEM)
    assert copter.speed_m_s == START.speed_m_s
    flight.run_until(Arrived(1))
    assert copter.mission.current == GUIDED_ITEM
    assert len(copter.commands(REPOSITION)) == 1
    assert all(int(m.param2) & 1 == 0 for m in copter.commands(REPOSITION)), "no mode is changed"
    assert copter.mode == AUTO


@pytest.mark.parametrize("after_s", [0.5, 5.0])
def test_without_a_companion_it_flies_there_waits_and_comes_home(after_s: float) -> None:
    flight = prepared()
    flight.order(GoTo(1, NORTH))
    flight.run(after_s)
    deaf(flight)
    reached = False
    began_s = flight.now_s
    while flight.copter.armed:
        flight.step()
        reached |= math.dist(flight.copter.position_m, NORTH) < 0.5
        assert flight.now_s - began_s < 150.0
    assert reached


def test_without_a_companion_that_told_a_target_it_goes_on_by_itself() -> None:
    flight = prepared()
    flight.copter.verdicts[REPOSITION] = [None] * 50
    flight.order(GoTo(1, NORTH))
    while flight.copter.mission.current != GUIDED_ITEM or not flight.copter.commands(REPOSITION):
        flight.step()
    deaf(flight)
    left_alone(flight, 200.0)
    assert (NORTH[0], NORTH[1]) in flight.copter.mission.flown


@pytest.mark.parametrize("verdicts", [[FAILED] * 5, [DENIED] * 5, [None] * 40])
def test_a_vehicle_that_takes_no_target_flies_to_the_waypoint(verdicts: list[int | None]) -> None:
    flight = prepared()
    flight.copter.verdicts[REPOSITION] = verdicts
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    assert flight.reports == [Arrived(1)]
    assert sets_of(flight)[-1] == TARGET_ITEM
    assert flight.copter.mission.current == TARGET_ITEM
    assert flight.copter.speed_m_s == START.speed_m_s


def test_a_vehicle_that_takes_no_speed_flies_to_the_waypoint() -> None:
    flight = prepared()
    flight.copter.verdicts[SPEED] = [FAILED] * 5
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    assert flight.copter.mission.current == TARGET_ITEM
    assert flight.copter.speed_m_s == START.speed_m_s


def test_one_that_does_not_give_way_yet_is_told_again() -> None:
    flight = prepared()
    flight.copter.verdicts[REPOSITION] = [DENIED]
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    assert flight.copter.mission.current == GUIDED_ITEM


def test_an_end_of_the_time_for_targets_is_no_arrival_and_no_return() -> None:
    flight = prepared()
    flight.order(GoTo(1, FAR))
    flight.run(10.0)
    flight.copter.mission._gives_way_until_s = flight.copter.now_s
    flight.run(10.0)
    assert flight.copter.mission.current == TARGET_ITEM
    assert flight.reports == []
    flight.run_until(Arrived(1))
    flight.run(5.0 * MISSIONS.mission_patience_s)
    assert math.dist(flight.copter.position_m, FAR) < 1.0, "the wait is renewed"


def test_a_wait_is_renewed_without_leaving_the_place() -> None:
    flight = prepared()
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    flight.copter.heard.clear()
    flight.run(6.0 * MISSIONS.mission_patience_s)
    assert math.dist(flight.copter.position_m, NORTH) < 0.5
    assert sets_of(flight) == []
    assert flight.reports == [Arrived(1)]
    deaf(flight)
    assert left_alone(flight, 100.0) > 0.25 * MISSIONS.mission_patience_s


def test_a_hold_ends_what_is_told_of_a_target() -> None:
    flight = prepared()
    flight.copter.verdicts[REPOSITION] = [None]
    flight.order(GoTo(1, FAR))
    while not flight.copter.commands(REPOSITION):
        flight.step()
    flight.order(Hold("test"))
    flight.run(10.0)
    assert flight.copter.mode == GUIDED
    assert math.dist(flight.copter.position_m, START.position_enu_m) < 5.0


def test_a_pilot_keeps_the_vehicle() -> None:
    flight = prepared()
    flight.order(GoTo(1, FAR))
    flight.run(5.0)
    flight.copter.set_mode(LOITER)
    flight.run_until(HandedOver)
    flight.copter.heard.clear()
    flight.run(10.0)
    assert not [m for m in flight.copter.heard if "COMMAND" in m.get_type() and m.command != 511]


@pytest.mark.parametrize("guided_s", [0, 30], ids=["as it was", "giving way"])
def test_another_life_takes_on_either_kind_of_mission(guided_s: int) -> None:
    flight = prepared()
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    copter = flight.copter
    plan = MissionPlan(*wgs84_from_enu(ORIGIN, NORTH), 4.0, 25, guided_s)
    if not guided_s:
        # What the last release left.
        told = [flight.bridge.codec.encode(item) for item in plan.items(ArduCopter())]
        copter.mission.items = [m for data in told for m in copter._parser.parse_buffer(data)]
        copter.mission._fly(2)
    flight.restart()
    flight.order(replace(START, resume=True))
    flight.run_until(VehicleReady())
    flight.order(GoTo(2, EAST))
    flight.run_until(Arrived(2))
    assert not [r for r in flight.reports if isinstance(r, Refused | HandedOver)]
    assert copter.mission.current == GUIDED_ITEM
