"""Flights by missions: every target stands on the vehicle, with the way home behind it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Hold,
    Home,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.session import LinkClosed, LinkOpened
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, SET_MODE, TAKEOFF, FakeCopter

MISSIONS = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION, mission_patience_s=20.0)
NORTH, SOUTH, EAST = (5.0, 40.0, 12.0), (5.0, -40.0, 12.0), (45.0, 0.0, 12.0)
FAR = (205.0, 0.0, 12.0)
RESUME = replace(START, resume=True)


def flight_of(fake: type[FakeCopter], config: BridgeConfig = MISSIONS) -> BridgeFlight:
    return BridgeFlight(fake(ORIGIN), config)


def under_way(fake: type[FakeCopter]) -> BridgeFlight:
    """Ten seconds on its way to a far target, which stands on the vehicle."""
    flight = flight_of(fake).prepared()
    flight.order(GoTo(1, FAR))
    flight.run(10.0)
    assert flight.copter.mode == flight.copter.mission_mode
    return flight


def waiting(fake: type[FakeCopter], stay_s: float = 0.0) -> BridgeFlight:
    """Just arrived at a near target."""
    flight = flight_of(fake).prepared()
    flight.order(GoTo(1, NORTH, stay_s))
    flight.run_until(Arrived(1))
    return flight


# -- whole flights ----------------------------------------------------------------------


def test_every_target_is_a_mission_with_the_way_home_behind_it(fake: type[FakeCopter]) -> None:
    flight = waiting(fake, stay_s=7.5)
    items = flight.copter.mission.items
    speed, target, home = items[int(fake is FakeCopter)], *items[-2:]
    assert (speed.command, speed.frame, speed.param1, speed.param2) == (178, 2, 1.0, 4.0)
    assert (target.command, target.frame, target.param1) == (16, 5, 28.0)
    assert target.z == pytest.approx(ORIGIN.alt_m + 12.0)
    assert (home.command, home.frame) == (20, 2)


def test_legs_follow_each_other_in_the_mission_mode(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake).prepared()
    for leg, target in enumerate((NORTH, SOUTH, EAST, EAST), start=1):
        flight.order(GoTo(leg, target))
        flight.run_until(Arrived(leg))
        assert math.dist(flight.copter.position_m, target) < 1.0
        assert flight.copter.mode == flight.copter.mission_mode
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert flight.reports == [*(Arrived(leg) for leg in (1, 2, 3, 4)), Home()]
    assert flight.copter.speed_m_s == START.speed_m_s


def test_target_is_replaced_in_mid_flight(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    flight.copter.heard.clear()
    flight.order(GoTo(2, NORTH))
    flight.run_until(Arrived(2))
    assert flight.reports == [Arrived(2)]
    assert not flight.copter.commands(SET_MODE), "it flew on in the mission mode"


def test_targets_in_quick_succession_end_at_the_newest(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake).prepared()
    for leg, target in enumerate((NORTH, FAR, SOUTH, EAST), start=1):
        flight.order(GoTo(leg, target))
        flight.run(0.04)
    flight.run_until(Arrived(4))
    assert flight.reports == [Arrived(4)]
    assert math.dist(flight.copter.position_m, EAST) < 1.0


def test_both_ways_give_the_same_reports(fake: type[FakeCopter]) -> None:
    stories = []
    for style in CommandStyle:
        flight = flight_of(fake, replace(MISSIONS, command=style)).prepared()
        flight.order(GoTo(1, NORTH))
        flight.run_until(Arrived(1))
        flight.order(GoTo(2, FAR))
        flight.run(3.0)
        flight.order(GoTo(3, SOUTH))
        flight.run_until(Arrived(3))
        flight.order(GoTo(4, (1e9, 0.0, 0.0)))
        flight.order(Return("mission ended"))
        flight.run_until(Home())
        stories.append(flight.reports)
    assert stories[0] == stories[1]


# -- left alone -------------------------------------------------------------------------


@pytest.mark.parametrize("stay_s", [0.0, 15.0])
def test_vehicle_comes_home_by_itself_if_its_companion_dies(
    fake: type[FakeCopter], stay_s: float
) -> None:
    for flight in (under_way(fake), waiting(fake, stay_s)):
        copter, flight.happen = flight.copter, lambda _: []  # type: ignore[method-assign, assignment]
        began_s = flight.now_s
        while copter.armed:
            flight.step()
            assert flight.now_s - began_s < 200.0
        assert math.dist(copter.position_m, copter.home_m) < 0.5
        assert flight.now_s - began_s > stay_s + MISSIONS.mission_patience_s


def test_wait_is_renewed_as_long_as_somebody_lives(fake: type[FakeCopter]) -> None:
    flight = waiting(fake)
    flight.run(6.0 * MISSIONS.mission_patience_s)

    assert math.dist(flight.copter.position_m, NORTH) < 1.0
    assert flight.reports == [Arrived(1)]
    renewals = [m for m in flight.copter.heard if m.get_type() == "MISSION_COUNT"]
    assert 10 <= len(renewals) <= 14
    flight.order(GoTo(2, SOUTH))
    flight.run_until(Arrived(2))


def test_return_of_its_own_is_not_taken_for_a_pilots(fake: type[FakeCopter]) -> None:
    flight = waiting(fake)
    flight.to_vehicle = lambda _: []
    advised = flight.run_until(ReturnAdvised, limit_s=40.0)
    assert isinstance(advised, ReturnAdvised)
    assert "by itself" in advised.reason
    flight.order(Return(advised.reason))
    flight.run_until(Home())
    assert flight.reports == [Arrived(1), advised, Home()]


def test_vehicle_that_never_stops_at_its_target_has_arrived_when_it_says_so(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, replace(MISSIONS, arrival_speed_m_s=1e-9)).prepared()
    copter = flight.copter
    swaying = copter._move

    def sway(duration_s: float) -> None:
        swaying(duration_s)
        copter.velocity_m_s = (0.6, 0.0, 0.0)

    copter._move = sway  # type: ignore[method-assign]
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    flight.run_until(ReturnAdvised)


# -- what was heard before --------------------------------------------------------------


def test_what_is_said_of_the_mission_before_is_no_arrival(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    seqs = range(len(flight.copter.mission.items))
    for _ in range(10):
        for seq in seqs:
            flight.copter.mission.say_reached(seq)
        flight.run(0.5)
    flight.copter.stuck = True
    flight.order(GoTo(2, flight.copter.position_m))
    for seq in seqs:
        flight.copter.mission.say_reached(seq)
    flight.run(0.3)
    assert flight.reports == []


def test_mission_left_at_another_item_is_begun_at_its_target(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    copter = flight.copter
    home = len(copter.mission.items) - 1
    replace_ = copter.mission.on_item

    def strays(m: object) -> None:
        replace_(m)
        copter.mission.current = home

    copter._handlers["MISSION_ITEM_INT"] = strays
    flight.order(GoTo(2, NORTH))
    flight.run_until(Arrived(2))


# -- pilots -----------------------------------------------------------------------------


@pytest.mark.parametrize("after", range(8))
def test_pilot_who_takes_over_during_an_upload_is_left_alone(
    fake: type[FakeCopter], after: int
) -> None:
    flight = under_way(fake)
    copter = flight.copter
    copter.heard.clear()
    count = 0

    def to_vehicle(data: bytes) -> list[bytes]:
        nonlocal count
        count += 1
        if count == after + 1:
            copter.set_mode(copter.pilot_mode)
        return [data]

    flight.to_vehicle = to_vehicle
    flight.order(GoTo(2, NORTH))
    flight.run_until(HandedOver)
    copter.heard.clear()
    flight.run(20.0)
    assert {m.get_type() for m in copter.heard} <= {"HEARTBEAT", "COMMAND_LONG"}
    assert set(copter.count()) <= {511}
    assert copter.mode == copter.pilot_mode


def test_guided_mode_that_nobody_asked_for_is_a_pilots(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    flight.copter.set_mode(flight.copter.own_mode)
    handed = flight.run_until(HandedOver)
    assert isinstance(handed, HandedOver)
    assert "switched it to" in handed.reason


def test_missions_that_a_pilot_flies_are_not_ours(fake: type[FakeCopter]) -> None:
    flight = waiting(fake)
    items = flight.copter.mission.items
    other = flight_of(fake, replace(MISSIONS, command=CommandStyle.REPOSITION)).prepared()
    other.copter.mission.items = items
    other.copter.set_mode(other.copter.mission_mode)
    other.run_until(HandedOver)


def test_return_home_is_flown_from_the_mission_mode(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    flight.order(Return("mission ended"))
    flight.run(3.0)
    assert flight.copter.mode == flight.copter.return_mode
    flight.run_until(Home())
    assert flight.reports == [Home()]


# -- refusals ---------------------------------------------------------------------------


@pytest.mark.parametrize("result", [2, 4, 14])
def test_refused_mission_leaves_the_old_target_in_force(
    fake: type[FakeCopter], result: int
) -> None:
    flight = under_way(fake)
    copter = flight.copter
    real, refused_once = copter.mission.on_item, [result]

    def refuse(m: object) -> None:
        if refused_once and m.z > 500.5 and m.seq == len(copter.mission.items) - 2:  # type: ignore[attr-defined]
            copter.mission._wanted = None
            copter.mission.ack(refused_once.pop())
        else:
            real(m)

    copter._handlers["MISSION_ITEM_INT"] = refuse
    order = GoTo(2, (5.0, 40.0, 20.0))
    flight.order(order)
    refusal = flight.run_until(Refused)
    assert isinstance(refusal, Refused)
    assert refusal.order == order
    assert f"the vehicle refused the mission (result {result})" in refusal.reason
    flight.run(5.0)
    assert copter.mode == copter.mission_mode
    assert copter.target_m is not None
    assert math.dist(copter.target_m, FAR) < 0.1
    flight.order(GoTo(3, NORTH))
    flight.run_until(Arrived(3))


def test_first_mission_that_is_refused_leaves_no_half_mission_standing_and_no_takeoff(
    fake: type[FakeCopter],
) -> None:
    """A pilot's old mission has as many items, so half of ours would be flown with half of it."""
    old = waiting(fake).copter.mission.items
    flight = flight_of(fake)
    mission = flight.copter.mission
    mission.items, mission.verdict = list(old), 4
    flight.order(START)
    refused = flight.run_until(Refused)
    assert refused == Refused(
        START,
        "the way home cannot be put on it: the vehicle refused the mission (result 4)",
    )
    assert len(mission.items) == 0
    assert not {ARM, TAKEOFF} & set(flight.copter.count())
    mission.verdict = None
    flight.order(START)
    flight.run_until(VehicleReady())


def test_the_way_home_stands_on_the_vehicle_before_it_is_armed_and_is_flown_once_it_is_ready(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake)
    copter = flight.copter
    flight.order(START)
    while not copter.commands(ARM):
        assert not copter.armed
        flight.step()
    speed, target, home = copter.mission.items[int(fake is FakeCopter)], *copter.mission.items[-2:]
    assert (speed.param2, target.param1, home.command) == (4.0, 20.0, 20)
    assert target.z == pytest.approx(ORIGIN.alt_m + START.position_enu_m[2])
    flight.run_until(VehicleReady())
    assert copter.mode == copter.mission_mode
    assert math.dist(copter.position_m, START.position_enu_m) < 1.0


def test_vehicle_comes_home_by_itself_if_its_companion_dies_before_the_first_target(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake).prepared()
    flight.run(3.0 * MISSIONS.mission_patience_s)
    assert math.dist(flight.copter.position_m, START.position_enu_m) < 1.0, "the wait is renewed"
    flight.happen = lambda _: []  # type: ignore[method-assign, assignment]
    flight.run(100.0)
    assert not flight.copter.armed
    assert math.dist(flight.copter.position_m, flight.copter.home_m) < 0.5


@pytest.mark.parametrize("after_s", [0.0, 0.1, 0.5, 1.0])
def test_vehicle_is_stopped_while_its_first_mission_begins(
    fake: type[FakeCopter], after_s: float
) -> None:
    flight = flight_of(fake)
    flight.order(START)
    while "starting the mission" not in flight.reasons():
        flight.step()
    flight.run(after_s)
    flight.order(Hold("wait"))
    flight.run(10.0)
    assert flight.copter.mode == flight.copter.own_mode
    assert flight.bridge.phase is FlightPhase.HOVERING
    assert not [r for r in flight.reports if isinstance(r, HandedOver)]


def test_mission_mode_that_is_refused_for_good_is_reported() -> None:
    flight = flight_of(FakeCopter).prepared()
    flight.order(Hold("wait"))
    flight.run(5.0)
    flight.copter.verdicts[SET_MODE] = [4] * 99
    order = GoTo(1, NORTH)
    flight.order(order)
    refused = flight.run_until(Refused)
    assert refused == Refused(order, "the mission mode cannot be set (failed)")
    assert flight.bridge.phase is FlightPhase.HOVERING
    flight.copter.verdicts.clear()
    flight.order(GoTo(2, NORTH))
    flight.run_until(Arrived(2))


def test_first_mission_that_is_not_begun_ends_the_preparation_with_a_return() -> None:
    flight = flight_of(FakeCopter)
    flight.order(START)
    while not flight.copter.airborne:
        flight.step()
    flight.copter.verdicts[SET_MODE] = [4] * 5
    advised = ReturnAdvised("the mission mode cannot be set (failed)")
    assert flight.run_until(ReturnAdvised) == advised
    flight.order(Return(advised.reason))
    flight.run_until(Home())


@pytest.mark.parametrize("stay_s", [math.nan, math.inf, -1.0])
def test_stay_that_is_no_duration_is_refused(stay_s: float) -> None:
    flight = flight_of(FakeCopter).prepared()
    [refused] = flight.order(GoTo(1, NORTH, stay_s))
    assert isinstance(refused, Refused)


def test_vehicle_that_stands_still_elsewhere_is_begun_anew_and_then_given_up(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake).prepared()
    flight.copter.stuck = True
    flight.order(GoTo(1, NORTH))
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "stands still 40.0 m from the target" in refused.reason


# -- the next life ----------------------------------------------------------------------


def test_restarted_agent_takes_on_its_mission_while_the_vehicle_flies_on(
    fake: type[FakeCopter],
) -> None:
    flight = under_way(fake).restart()
    flight.copter.heard.clear()
    flight.order(RESUME)
    flight.run_until(VehicleReady())
    assert not flight.copter.commands(SET_MODE)
    assert flight.copter.mode == flight.copter.mission_mode
    flight.run(5.0)
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    assert not flight.copter.commands(SET_MODE)


def test_mission_of_a_pilot_is_not_taken_on(fake: type[FakeCopter]) -> None:
    flight = under_way(fake)
    del flight.copter.mission.items[-1]
    flight.restart()
    flight.copter.heard.clear()
    flight.order(RESUME)
    flight.run(10.0)
    assert VehicleReady() not in flight.reports
    assert "by its pilot" in flight.reasons()[-1]
    assert set(flight.copter.count()) <= {511}


def test_wait_that_an_earlier_life_began_is_renewed(fake: type[FakeCopter]) -> None:
    flight = waiting(fake).restart(down_s=MISSIONS.mission_patience_s - 6.0)
    flight.order(RESUME)
    flight.run(3.0 * MISSIONS.mission_patience_s)
    assert VehicleReady() in flight.reports
    assert math.dist(flight.copter.position_m, NORTH) < 1.0
    assert not any(isinstance(r, ReturnAdvised) for r in flight.reports)


def test_restarted_agent_that_has_left_the_mission_brings_the_vehicle_home(
    fake: type[FakeCopter],
) -> None:
    flight = under_way(fake).restart()
    flight.order(Return("the mission is over", resume=True))
    flight.run_until(Home())


# -- links ------------------------------------------------------------------------------


@pytest.mark.parametrize("at", [0, 3, 7, 11])
def test_link_lost_for_a_while_in_mid_upload_is_ridden_out(fake: type[FakeCopter], at: int) -> None:
    flight = under_way(fake)
    count = 0

    def cut(data: bytes) -> list[bytes]:
        nonlocal count
        count += 1
        return [data] if count <= at else []

    flight.to_vehicle = flight.to_bridge = cut
    flight.order(GoTo(2, NORTH))
    flight.happen(LinkClosed())
    flight.run(3.0)
    del flight.to_vehicle, flight.to_bridge
    flight.to_vehicle = flight.to_bridge = lambda data: [data]
    flight.happen(LinkOpened())
    flight.run_until(Arrived(2))
