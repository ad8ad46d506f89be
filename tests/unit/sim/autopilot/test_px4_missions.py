"""Missions of the simulated PX4: checked, flown, replaced and ended."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.ground_station import ACCEPTED
from tests.support.px4_ground import (
    HOLD,
    LAND,
    MISSION,
    RETURN,
    airborne,
    checked,
    ground_station,
    home_alt_m,
    mission_texts,
    mode,
    reached,
    take_off,
)


def test_a_mission_is_checked_before_its_mode_can_be_entered() -> None:
    ground = airborne()
    assert ground.upload(ground.item(0, 0.0, 50.0)) == 0

    assert ground.set_mode(*MISSION) == ACCEPTED
    assert mode(ground) == HOLD
    assert mission_texts(ground) == ["No valid mission available, loitering"]
    ground.wait(1.0)
    assert ground.set_mode(*MISSION) == ACCEPTED
    assert mode(ground) == MISSION


def test_item_0_is_a_waypoint_and_what_was_reached_is_told_ten_times_more() -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 60.0), ground.item(1, 60.0, 60.0))
    ground.set_mode(*MISSION)
    ground.wait(12.0)
    assert ground.position_enu_m == pytest.approx((0.0, 60.0, 12.0), abs=0.1)
    ground.wait(13.0)

    assert reached(ground) == [0] * 11 + [1]
    assert mode(ground) == HOLD
    assert mission_texts(ground) == ["Executing Mission", "Mission finished, loitering"]


def test_a_finished_mission_begins_again_only_when_its_current_item_was_set() -> None:
    ground = airborne(12.0)
    items = [ground.item(0, 0.0, 10.0, params=(0.0, 0.0, 0.0, math.nan))]
    checked(ground, *items)
    ground.set_mode(*MISSION)
    ground.wait(5.0)
    checked(ground, *items)
    ground.set_mode(*MISSION)
    assert mode(ground) == HOLD
    ground.send(mavlink.MAVLink_mission_set_current_message(1, 1, 0))
    ground.set_mode(*MISSION)
    ground.wait(1.0)

    assert mission_texts(ground) == [
        "Executing Mission",
        "Mission finished, loitering",
        "No valid mission available, loitering",
        "Executing Mission",
        "Mission finished, loitering",
    ]


def test_another_mission_after_the_end_begins_without_further_ado() -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 10.0))
    ground.set_mode(*MISSION)
    ground.wait(5.0)
    checked(ground, ground.item(0, 0.0, 100.0))
    ground.set_mode(*MISSION)

    assert mode(ground) == MISSION


def test_a_mission_replaced_while_it_is_flown_is_begun_at_once_from_its_first_item() -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 10.0), ground.item(1, 0.0, 200.0))
    ground.set_mode(*MISSION)
    ground.wait(10.0)
    assert ground.upload(ground.item(0, 50.0, 0.0)) == 0
    ground.wait(15.0)

    assert ground.position_enu_m == pytest.approx((50.0, 0.0, 12.0), abs=0.1)


def test_a_mission_below_its_height_is_begun_with_a_climb() -> None:
    ground = airborne(5.0)
    checked(ground, ground.item(0, 0.0, 50.0, height_m=20.0))
    ground.set_mode(*MISSION)
    ground.wait(5.0)

    assert ground.position_enu_m == pytest.approx((0.0, 0.0, 20.0), abs=0.1)
    assert "Climb to 20.0 meters above home\t" in ground.texts()
    ground.wait(10.1)
    assert reached(ground) == [0]


def test_a_mission_started_on_the_ground_arms_and_takes_off_by_itself() -> None:
    ground = ground_station()
    ground.wait(5.0)
    checked(ground, ground.item(0, 0.0, 50.0))

    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.wait(12.0 / 2.5 + 10.2)
    assert reached(ground) == [0]


def test_a_mission_can_be_flown_again_after_landing() -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 10.0))
    for _ in range(2):
        ground.set_mode(*MISSION)
        ground.wait(10.0)
        assert ground.set_mode(*LAND) == ACCEPTED
        ground.wait(30.0)
        assert not ground.vehicle.pilot.armed
        ground.arm()
        take_off(ground, home_alt_m(ground) + 12.0)
        ground.wait(8.0)

    assert reached(ground) == [0, 0]


def test_an_item_that_returns_home_ends_the_mission_in_the_mode_for_it() -> None:
    ground = airborne(12.0)
    rtl = ground.item(1, command=mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)
    checked(ground, ground.item(0, 0.0, 50.0), rtl)
    ground.set_mode(*MISSION)
    ground.wait(12.0)

    assert mode(ground) == RETURN
    assert [seq for seq in reached(ground) if seq > 0] == [1]
    ground.wait(60.0)
    assert not ground.vehicle.pilot.armed


def test_an_item_that_lands_ends_the_mission_and_the_flight() -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 50.0, command=mavlink.MAV_CMD_NAV_LAND))
    ground.set_mode(*MISSION)
    ground.wait(30.0)

    assert ground.position_enu_m == pytest.approx((0.0, 50.0, 0.0), abs=0.1)
    assert ground.texts()[-2:] == ["Mission finished, landed\t", "Disarmed by landing\t"]
    assert mode(ground) == HOLD


@pytest.mark.parametrize("stay_s", [0.0, 7.0])
def test_a_waypoint_is_reached_when_its_hold_time_is_over(stay_s: float) -> None:
    ground = airborne(12.0)
    checked(ground, ground.item(0, 0.0, 50.0, params=(stay_s, 0.0, 0.0, 0.0)))
    ground.set_mode(*MISSION)
    ground.wait(10.0 + stay_s - 0.1)
    assert reached(ground) == []
    ground.wait(0.2)

    assert reached(ground) == [0]
