"""The camera of a vehicle is kept on what a line leads round, and on nothing else."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Arrived, GiveWay, GoTo, Hold, Home, Return
from agent.vehicle.config import BridgeConfig, CommandStyle
from swarm.model.frames import enu_from_wgs84
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import REPOSITION, FakeCopter
from tests.support.fake_px4 import FakePx4

LOOK_AT = mavlink.MAV_CMD_DO_SET_ROI_LOCATION
LOOK_AHEAD = mavlink.MAV_CMD_DO_SET_ROI_NONE
BEGIN, MIDDLE = (20.0, 0.0, 12.0), (40.0, 20.0)
CORNERS = ((60.0, 0.0, 12.0), (60.0, 40.0, 12.0), (20.0, 40.0, 12.0))
RING = GoTo(2, BEGIN, via_enu_m=CORNERS, look_at_m=MIDDLE)


@pytest.fixture
def flight(flight: BridgeFlight) -> BridgeFlight:
    """At the beginning of a ring, of a vehicle that takes what it is to look at."""
    flight.prepared()
    for command in (LOOK_AT, LOOK_AHEAD):
        flight.copter.verdicts[command] = [mavlink.MAV_RESULT_ACCEPTED] * 99
    flight.order(GoTo(1, BEGIN))
    flight.run_until(Arrived(1), limit_s=60.0)
    return flight


def told(flight: BridgeFlight) -> list[int]:
    """What it was told of looking, one after the other, repetitions left out."""
    orders = [m.command for m in flight.copter.heard if getattr(m, "command", 0) in LOOKING]
    return [each for i, each in enumerate(orders) if i == 0 or each != orders[i - 1]]


LOOKING = {LOOK_AT, LOOK_AHEAD}


def place_m(order: Any) -> tuple[float, float, float]:
    return enu_from_wgs84(ORIGIN, order.x / 1e7, order.y / 1e7, order.z)


def test_it_looks_at_the_middle_all_the_way_round_and_ahead_afterwards(
    flight: BridgeFlight,
) -> None:
    flight.order(RING)
    flight.run_until(Arrived(2), limit_s=180.0)
    flight.run(2.0)
    flight.order(GoTo(3, (0.0, 0.0, 12.0)))
    flight.run_until(Arrived(3), limit_s=90.0)

    assert told(flight) == [LOOK_AT, LOOK_AHEAD]
    assert len(flight.copter.commands(LOOK_AHEAD)) == 1
    for order in flight.copter.commands(LOOK_AT):
        assert order.get_type() == "COMMAND_INT"
        assert place_m(order) == pytest.approx((*MIDDLE, 12.0), abs=0.02)
    assert flight.cautions == []


def test_it_is_told_with_every_target_that_the_vehicle_has_taken(
    flight: BridgeFlight, style: CommandStyle
) -> None:
    flight.copter.heard.clear()
    flight.order(RING)
    flight.run_until(Arrived(2), limit_s=180.0)

    looks = [getattr(m, "command", 0) for m in flight.copter.heard]
    looks = [each for each in looks if each in (LOOK_AT, REPOSITION)]
    if style is CommandStyle.MISSION:
        assert looks == [LOOK_AT]
        return
    # What turns the nose alone is no other target; each of those is followed by a look.
    targets = {(m.x, m.y) for m in flight.copter.commands(REPOSITION)}
    assert looks.count(LOOK_AT) == len(targets) == 4
    assert looks[:2] == [REPOSITION, LOOK_AT]


def test_the_nose_is_turned_by_targets_where_nothing_else_turns_it(
    flight: BridgeFlight, style: CommandStyle
) -> None:
    flight.copter.heard.clear()
    flight.order(RING)
    bearings_deg, told_deg = [], []
    while not any(isinstance(each, Arrived) and each.leg == 2 for each in flight.reports):
        before = len(flight.copter.commands(REPOSITION))
        flight.step()
        told = flight.telemetry[-1]  # a second later it is on from there
        east_m, north_m = (
            p + v for p, v in zip(told.position_enu_m[:2], told.velocity_enu_m_s[:2], strict=True)
        )
        orders = flight.copter.commands(REPOSITION)
        if len(orders) > before:
            bearing_rad = math.atan2(MIDDLE[0] - east_m, MIDDLE[1] - north_m)
            bearings_deg.append(math.degrees(bearing_rad))
            told_deg.append(math.degrees(orders[-1].param4))
    turns = isinstance(flight.copter, FakePx4) and style is CommandStyle.REPOSITION
    if not turns:
        assert all(math.isnan(each) for each in told_deg)
        return
    assert len(told_deg) > 20
    for bearing_deg, heading_deg in zip(bearings_deg, told_deg, strict=True):
        assert abs(math.remainder(bearing_deg - heading_deg, 360.0)) < 10.0
    flight.order(GoTo(3, (0.0, 0.0, 12.0)))
    flight.run(1.0)
    assert math.isnan(flight.copter.commands(REPOSITION)[-1].param4)


@pytest.mark.parametrize(
    "order",
    [
        GoTo(3, (0.0, 0.0, 12.0)),
        Hold("look"),
        Return("over"),
        GiveWay(stands=True),
    ],
    ids=["another target", "a hold", "the way home", "one to give way to"],
)
def test_who_leaves_the_ring_looks_ahead(flight: BridgeFlight, order: Any) -> None:
    flight.order(RING)
    flight.run(6.0)
    assert told(flight) == [LOOK_AT]
    flight.order(order)
    flight.run(4.0)

    assert told(flight) == [LOOK_AT, LOOK_AHEAD]


def test_who_has_given_way_looks_there_again(flight: BridgeFlight) -> None:
    flight.order(RING)
    flight.run(6.0)
    flight.order(GiveWay(stands=True))
    flight.run(6.0)
    flight.order(GiveWay())
    flight.run_until(Arrived(2), limit_s=180.0)
    flight.run(1.0)

    assert told(flight) == [LOOK_AT, LOOK_AHEAD, LOOK_AT, LOOK_AHEAD]


@pytest.mark.parametrize(
    ("answer", "caution"),
    [
        (mavlink.MAV_RESULT_DENIED, "it does not take what its camera is to look at"),
        (mavlink.MAV_RESULT_UNSUPPORTED, "it does not take what its camera is to look at"),
        (None, "it does not answer to what its camera is to look at"),
    ],
)
def test_a_vehicle_that_does_not_take_it_flies_all_the_same_and_says_so_once(
    flight: BridgeFlight, answer: int | None, caution: str
) -> None:
    for command in (LOOK_AT, LOOK_AHEAD):
        flight.copter.verdicts[command] = [answer] * 999
    flight.order(RING)
    flight.run_until(Arrived(2), limit_s=180.0)
    flight.run(10.0)

    assert flight.cautions == [caution]
    if answer is not None:
        assert len(flight.copter.commands(LOOK_AT)) == 1


def test_what_was_not_answered_is_not_said_again_once_it_is_over(flight: BridgeFlight) -> None:
    flight.copter.verdicts[LOOK_AT] = [None] * 99
    flight.order(RING)
    while not flight.copter.commands(LOOK_AT):
        flight.step()
    flight.order(GoTo(3, (0.0, 0.0, 12.0)))
    said = len(flight.copter.commands(LOOK_AT))
    flight.run(10.0)

    assert len(flight.copter.commands(LOOK_AT)) == said
    assert told(flight) == [LOOK_AT, LOOK_AHEAD]


def test_who_has_nothing_to_look_at_is_told_nothing(flight: BridgeFlight) -> None:
    flight.order(GoTo(2, BEGIN, via_enu_m=CORNERS))
    flight.run_until(Arrived(2), limit_s=180.0)
    flight.order(Return("over"))
    flight.run_until(Home, limit_s=180.0)

    assert told(flight) == []


def test_a_mission_along_a_line_that_ends_where_it_begins_is_flown_before_it_is_over(
    fake: type[FakeCopter],
) -> None:
    # All of the line is near its end, and no speed too fast: only its corners tell.
    near = BridgeConfig(
        *(1, ORIGIN),
        command=CommandStyle.MISSION,
        acceptance_radius_m=60.0,
        arrival_speed_m_s=50.0,
        stall_timeout_s=1e6,
    )
    flight = BridgeFlight(fake(ORIGIN), near).prepared()
    flight.order(GoTo(1, BEGIN))
    flight.run_until(Arrived(1), limit_s=60.0)
    flight.run(10.0)
    seen = len(flight.telemetry)
    flight.order(GoTo(2, BEGIN, via_enu_m=CORNERS))
    flight.run_until(Arrived(2), limit_s=180.0)

    flown = [each.position_enu_m for each in flight.telemetry[seen:]]
    for corner in CORNERS:
        assert min(math.dist(corner, place) for place in flown) < 5.0
