"""Take-off, guided flight, return and landing of the simulated vehicle."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import TimeAdvanced
from tests.support.ground_station import (
    ACCEPTED,
    DENIED,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    RTL,
    STABILIZE,
    GroundStation,
    ground_station,
    only,
    the,
)

TAKE_OFF = mavlink.MAV_CMD_NAV_TAKEOFF
CHANGE_SPEED = mavlink.MAV_CMD_DO_CHANGE_SPEED
ON_GROUND, IN_AIR, TAKING_OFF, LANDING = 1, 2, 3, 4


def landed_state(ground: GroundStation) -> int:
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    state: int = only(ground.heard, "EXTENDED_SYS_STATE")[-1].landed_state
    return state


def near(ground: GroundStation, east_m: float, north_m: float, up_m: float) -> bool:
    # Places on the wire are good to about a centimetre.
    return math.dist(ground.position_enu_m, (east_m, north_m, up_m)) < 0.02


def test_take_off_rises_to_the_height_above_home() -> None:
    ground = ground_station(start_enu_m=(3.0, 4.0, 50.0))
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED

    ground.wait(2.0)
    assert ground.position_enu_m == (3.0, 4.0, 55.0)
    assert landed_state(ground) == TAKING_OFF
    assert only(ground.heard, "HEARTBEAT")[-1].system_status == 4
    ground.wait(20.0)
    assert ground.position_enu_m == (3.0, 4.0, 60.0)
    assert landed_state(ground) == IN_AIR
    assert "Disarming motors" not in ground.texts()


def test_take_off_is_refused_when_disarmed_or_not_guided_or_flying_or_downwards() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0) == FAILED
    ground.set_mode(LOITER)
    ground.arm()
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0) == FAILED
    ground.set_mode(GUIDED)
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, -1.0) == FAILED
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, math.nan) == DENIED
    assert ground.command_int(TAKE_OFF, mavlink.MAV_FRAME_GLOBAL, 0, 0, 500.0) == DENIED
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED
    ground.wait(1.0)
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 20.0) == FAILED


def test_vehicle_leaves_the_ground_once_its_motors_are_up_to_it() -> None:
    ground = ground_station(spool_up_s=3.0)
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.wait(9.0)  # the usual disarming no longer counts once a take-off is accepted
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0) == ACCEPTED
    ground.wait(2.0)
    assert ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 5.0) == ACCEPTED
    assert landed_state(ground) == ON_GROUND

    ground.wait(2.0)
    assert ground.position_enu_m == (0.0, 0.0, 2.5)
    ground.wait(5.0)
    assert ground.position_enu_m == (0.0, 0.0, 5.0)


def test_target_given_before_the_vehicle_leaves_the_ground_undoes_the_take_off() -> None:
    ground = ground_station(spool_up_s=3.0)
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0)
    assert ground.reposition(5.0, 5.0, 10.0) == ACCEPTED

    ground.wait(9.0)
    assert ground.position_enu_m == (0.0, 0.0, 0.0)
    ground.wait(1.1)
    assert ground.texts()[-1] == "Disarming motors"


@pytest.mark.parametrize("mode", [LOITER, LAND, RTL])
def test_mode_changed_before_the_vehicle_leaves_the_ground_undoes_the_take_off(mode: int) -> None:
    ground = ground_station(spool_up_s=3.0)
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.command(TAKE_OFF, 0, 0, 0, 0, 0, 0, 10.0)
    assert ground.set_mode(mode) == ACCEPTED

    ground.wait(10.1)
    assert ground.position_enu_m == (0.0, 0.0, 0.0)
    assert not ground.vehicle.pilot.armed


def test_reposition_flies_straight_at_cruise_speed_and_stops_there() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(10.0)
    assert ground.reposition(30.0, 40.0, 10.0) == ACCEPTED

    ground.wait(5.0)
    assert near(ground, 15.0, 20.0, 10.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    report = only(ground.heard, "GLOBAL_POSITION_INT")[-1]
    assert (report.vx, report.vy, report.vz) == (400, 300, 0)
    assert report.hdg == pytest.approx(3687, abs=1)
    assert report.relative_alt == 10_000
    ground.wait(5.01)
    assert near(ground, 30.0, 40.0, 10.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    report = only(ground.heard, "GLOBAL_POSITION_INT")[-1]
    assert (report.vx, report.vy, report.vz) == (0, 0, 0)
    assert (report.lat, report.lon) == ground.place_e7(30.0, 40.0)


def test_reposition_retargets_at_once() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(10.0)
    ground.reposition(50.0, 0.0, 10.0)
    ground.wait(4.0)
    ground.reposition(20.0, 30.0, 10.0)

    ground.wait(3.0)
    assert near(ground, 20.0, 15.0, 10.0)


def test_height_above_sea_level_is_understood() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    lat_e7, lon_e7 = ground.place_e7(5.0, 6.0)
    command = mavlink.MAV_CMD_DO_REPOSITION
    assert (
        ground.command_int(command, mavlink.MAV_FRAME_GLOBAL, lat_e7, lon_e7, 510.0, -1, 1)
        == ACCEPTED
    )
    ground.wait(20.0)
    assert near(ground, 5.0, 6.0, 22.0)
    # As COMMAND_LONG, degrees come in single precision: good to a metre only.
    ground.command(command, -1, 1, 0, math.nan, lat_e7 / 1e7, lon_e7 / 1e7, 500.0)
    ground.wait(20.0)
    assert math.dist(ground.position_enu_m, (5.0, 6.0, 12.0)) < 1.0


def test_reposition_changes_the_mode_only_if_told_to() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    ground.set_mode(LOITER)

    assert ground.reposition(5.0, 5.0, 10.0, change_mode=False) == DENIED
    assert ground.vehicle.pilot.mode.value == "LOITER"
    assert ground.reposition(5.0, 5.0, 10.0, change_mode=True) == ACCEPTED
    assert ground.vehicle.pilot.mode.value == "GUIDED"


@pytest.mark.parametrize(
    ("frame", "lat_e7", "height_m"),
    [
        (mavlink.MAV_FRAME_LOCAL_NED, 473977000, 10.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 1_000_000_000, 10.0),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 473977000, math.nan),
        (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 473977000, 1e6),
    ],
)
def test_impossible_targets_are_denied_and_the_old_one_stays(
    frame: int, lat_e7: int, height_m: float
) -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(10.0)
    ground.reposition(0.0, 20.0, 10.0)
    command = mavlink.MAV_CMD_DO_REPOSITION

    assert ground.command_int(command, frame, lat_e7, 85455940, height_m, -1, 1) == DENIED
    ground.wait(4.0)
    assert near(ground, 0.0, 20.0, 10.0)


def test_target_given_on_the_ground_is_accepted_and_not_flown() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()

    assert ground.reposition(5.0, 5.0, 10.0) == ACCEPTED
    ground.wait(5.0)
    assert ground.position_enu_m == (0.0, 0.0, 0.0)


def test_position_target_message_is_flown_in_guided_only() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(10.0)
    lat_e7, lon_e7 = ground.place_e7(0.0, 10.0)
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
    target = mavlink.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, 3576, lat_e7, lon_e7, 10.0, *[0.0] * 8
    )
    ground.set_mode(LOITER)
    ground.send(target)
    ground.wait(5.0)
    assert near(ground, 0.0, 0.0, 10.0)
    ground.set_mode(GUIDED)
    ground.send(target)
    ground.wait(2.0)
    assert near(ground, 0.0, 10.0, 10.0)


def test_changed_speed_counts_at_once_in_flight() -> None:
    ground = ground_station(cruise_m_s=10.0)
    ground.take_off(10.0)
    ground.reposition(0.0, 100.0, 10.0)
    ground.wait(2.0)
    assert ground.command(CHANGE_SPEED, 1, 5.0, -1) == ACCEPTED

    ground.wait(2.0)
    assert near(ground, 0.0, 30.0, 10.0)
    ground.reposition(0.0, 0.0, 10.0)
    ground.wait(2.0)
    assert near(ground, 0.0, 20.0, 10.0)


def test_speed_changed_before_the_first_target_after_take_off_is_lost_as_on_arducopter() -> None:
    ground = ground_station(cruise_m_s=10.0)
    ground.take_off(10.0)
    assert ground.command(CHANGE_SPEED, 1, 5.0, -1) == ACCEPTED
    ground.reposition(0.0, 100.0, 10.0)

    ground.wait(2.0)
    assert near(ground, 0.0, 20.0, 10.0)


def test_speed_parameter_counts_from_the_next_leg() -> None:
    ground = ground_station(cruise_m_s=10.0)
    ground.take_off(10.0)
    ground.send(mavlink.MAVLink_param_set_message(1, 1, b"WP_SPD", 4.0, 9))
    ground.reposition(0.0, 100.0, 10.0)

    ground.wait(5.0)
    assert near(ground, 0.0, 20.0, 10.0)


@pytest.mark.parametrize("speed_m_s", [0.0, -1.0, math.nan, math.inf])
def test_impossible_speeds_are_refused(speed_m_s: float) -> None:
    ground = ground_station()
    ground.take_off(10.0)

    assert ground.command(CHANGE_SPEED, 1, speed_m_s) == FAILED


def test_speed_is_refused_in_modes_that_have_none() -> None:
    ground = ground_station()
    ground.wait(5.0)

    assert ground.command(CHANGE_SPEED, 1, 5.0) == FAILED


def test_return_climbs_flies_home_waits_lands_and_disarms() -> None:
    ground = ground_station(cruise_m_s=5.0, start_enu_m=(0.0, 0.0, 2.0))
    ground.take_off(10.0)
    ground.reposition(0.0, 50.0, 10.0)
    ground.wait(10.1)
    assert ground.command(mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH) == ACCEPTED
    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == RTL

    ground.wait(2.0)
    assert near(ground, 0.0, 50.0, 17.0)  # climbs 5 m at 2.5 m/s
    ground.wait(10.0)
    assert near(ground, 0.0, 0.0, 17.0)
    ground.wait(5.0 + 2.0)
    assert near(ground, 0.0, 0.0, 14.0)  # waits 5 s, lands at 1.5 m/s
    assert landed_state(ground) == LANDING
    ground.wait(8.0 + 0.5)
    assert ground.position_enu_m[2] == 2.0
    assert "Disarming motors" not in ground.texts()
    ground.wait(0.6)
    assert ground.texts()[-1] == "Disarming motors"
    assert landed_state(ground) == ON_GROUND
    ground.wait(1.0)
    last = only(ground.heard, "HEARTBEAT")[-1]
    assert (last.custom_mode, last.base_mode, last.system_status) == (RTL, 81, 3)


def test_return_keeps_a_greater_height() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(30.0)
    ground.reposition(0.0, 50.0, 30.0)
    ground.wait(10.1)
    ground.set_mode(RTL)

    ground.wait(5.0)
    assert near(ground, 0.0, 25.0, 30.0)


def test_landing_can_be_broken_off() -> None:
    ground = ground_station()
    ground.take_off(15.0)
    assert ground.command(mavlink.MAV_CMD_NAV_LAND) == ACCEPTED
    ground.wait(4.0)
    assert ground.set_mode(GUIDED) == ACCEPTED

    ground.wait(20.0)
    assert near(ground, 0.0, 0.0, 9.0)


def test_landing_disarms_where_the_vehicle_is() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(3.0)
    ground.reposition(0.0, 10.0, 3.0)
    ground.wait(2.1)
    ground.set_mode(LAND)

    ground.wait(3.1)
    assert ground.texts()[-1] == "Disarming motors"
    assert near(ground, 0.0, 10.0, 0.0)
    # The next flight begins there, and so does its home.
    ground.set_mode(GUIDED)
    ground.arm()
    assert only(ground.heard, "HOME_POSITION")[-1].latitude == ground.place_e7(0.0, 10.0)[0]


def test_pilot_who_takes_over_stops_the_flight() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(10.0)
    ground.reposition(0.0, 50.0, 10.0)
    ground.wait(2.0)
    assert ground.set_mode(STABILIZE) == ACCEPTED

    ground.wait(10.0)
    assert near(ground, 0.0, 10.0, 10.0)


def test_motors_are_not_stopped_in_the_air_unless_forced() -> None:
    ground = ground_station()
    ground.take_off(10.0)

    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == FAILED
    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196) == ACCEPTED
    assert ground.arm() == FAILED
    ground.wait(1.0)
    assert near(ground, 0.0, 0.0, 0.0)


def test_home_that_was_set_stays_when_arming() -> None:
    ground = ground_station()
    ground.wait(5.0)
    lat_e7, lon_e7 = ground.place_e7(100.0, 0.0)
    frame = mavlink.MAV_FRAME_GLOBAL
    command = mavlink.MAV_CMD_DO_SET_HOME

    assert ground.command_int(command, frame, 0, 0, 0.0) == DENIED
    assert ground.command_int(command, frame, lat_e7, lon_e7, 488.0) == ACCEPTED
    assert only(ground.heard, "HOME_POSITION")[-1].longitude == lon_e7
    ground.set_mode(GUIDED)
    ground.arm()
    assert only(ground.heard, "HOME_POSITION")[-1].longitude == lon_e7
    assert ground.command(command, 1) == ACCEPTED
    assert only(ground.heard, "HOME_POSITION")[-1].longitude == ground.place_e7(0.0, 0.0)[1]


def test_flight_does_not_depend_on_how_often_the_vehicle_is_called() -> None:
    often, seldom = ground_station(), ground_station()
    for ground in (often, seldom):
        ground.take_off(10.0)
        ground.reposition(0.0, 40.0, 10.0)
        ground.set_mode(RTL)
    for _ in range(300):
        often.wait(0.1)
    seldom.now_s += 30.0
    seldom.step(TimeAdvanced())

    assert often.position_enu_m == pytest.approx(seldom.position_enu_m, abs=1e-9)
    assert often.texts()[-1] == seldom.texts()[-1]


def test_battery_drains_while_armed() -> None:
    ground = ground_station(endurance_s=100.0)
    ground.take_off(10.0)
    ground.wait(50.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)

    assert the(ground.heard, "BATTERY_STATUS").battery_remaining == pytest.approx(46, abs=1)


def test_battery_stays_full_without_an_endurance() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    ground.wait(500.0)
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_SYS_STATUS)

    assert the(ground.heard, "SYS_STATUS").battery_remaining == 100
