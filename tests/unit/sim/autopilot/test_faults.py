"""What a simulated vehicle says and does when something goes wrong on request."""

from __future__ import annotations

import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import MavlinkReceived, TimeAdvanced
from sim.autopilot.faults import FaultKind, VehicleFault, parse_fault
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.flight import FlightMode
from sim.autopilot.vehicle import SimulatedAutopilot
from tests.support.ground_station import (
    ACCEPTED,
    AUTO,
    FAILED,
    GUIDED,
    LAND,
    LOITER,
    RTL,
    GroundStation,
    only,
    the,
)

INTERVAL = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
POSITION = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT


def with_faults(*texts: str, **config: Any) -> GroundStation:
    """A ground station of a vehicle to which something happens."""
    parts = VehicleConfig(**{"system_id": 1, "spool_up_s": 0.0, **config})
    faults = tuple(parse_fault(f"uav1:{text}")[1] for text in texts)
    return GroundStation(SimulatedAutopilot(parts, ArduCopterModel(), 0.0), faults=faults)


def asked(ground: GroundStation, message_id: int) -> Any:
    """A message, asked for now."""
    name = mavlink.mavlink_map[message_id].msgname
    before = len(ground.heard)
    assert ground.command(REQUEST, message_id) == ACCEPTED
    return only(ground.heard[before:], name)[-1]


def mode_now(ground: GroundStation) -> int:
    number: int = asked(ground, mavlink.MAVLINK_MSG_ID_HEARTBEAT).custom_mode
    return number


# --- When -------------------------------------------------------------------------------


def test_fault_comes_at_its_instant_after_the_first_arming() -> None:
    ground = with_faults("pilot@7.25")
    ground.take_off(10.0)  # armed at 5 s
    ground.wait(12.24 - ground.now_s)
    assert mode_now(ground) == GUIDED

    ground.wait(0.01)
    assert ground.heard_s[-1] == pytest.approx(12.25)
    assert mode_now(ground) == LOITER


def test_fault_waits_for_the_first_arming() -> None:
    ground = with_faults("reboot@1")
    ground.wait(20.0)
    assert ground.texts().count("ArduPilot Ready") == 1

    ground.set_mode(GUIDED)
    ground.arm()
    ground.wait(5.0)
    assert ground.texts().count("ArduPilot Ready") == 2
    ground.wait(20.0)
    assert ground.texts().count("ArduPilot Ready") == 2


def test_fault_at_0_is_there_from_power_up_and_ends() -> None:
    ground = with_faults("silent@0+20")
    ground.wait(19.0)
    assert not ground.heard

    ground.wait(2.0)
    assert only(ground.heard, "HEARTBEAT")


def test_faults_do_not_depend_on_how_often_the_vehicle_is_called() -> None:
    often, seldom = (with_faults("stuck@6+4.5", "failsafe-rtl@12") for _ in range(2))
    for ground in (often, seldom):
        ground.take_off(10.0)
        ground.reposition(0.0, 90.0, 10.0)
    for _ in range(60):
        often.wait(0.1)
    seldom.now_s += 6.0
    seldom.step(TimeAdvanced())

    assert often.position_enu_m == pytest.approx(seldom.position_enu_m, abs=1e-9)


# --- What -------------------------------------------------------------------------------


def test_reboot_in_flight_drops_the_vehicle_and_begins_anew() -> None:
    ground = with_faults("reboot@10")
    ground.take_off(10.0)
    ground.wait(10.0)

    assert ground.position_enu_m[2] == 0.0
    assert not ground.vehicle.pilot.armed
    assert asked(ground, POSITION).time_boot_ms < 15_000
    assert ground.texts().count("ArduPilot Ready") == 2


def test_reboot_does_not_charge_the_battery() -> None:
    ground = with_faults("reboot@50", endurance_s=100.0)
    ground.take_off(10.0)
    ground.wait(60.0)

    assert asked(ground, mavlink.MAVLINK_MSG_ID_SYS_STATUS).battery_remaining == 50


def test_vehicle_without_gps_tells_its_last_place_and_says_that_it_has_none() -> None:
    ground = with_faults("gps-lost@10+10")
    ground.take_off(10.0)
    ground.reposition(0.0, 200.0, 10.0)
    ground.wait(14.9 - ground.now_s)
    assert asked(ground, POSITION).vx == 1000
    ground.wait(0.1)
    before = asked(ground, POSITION)
    ground.wait(5.0)

    stale = asked(ground, POSITION)
    assert (stale.lat, stale.lon) == (before.lat, before.lon)
    assert (stale.vx, stale.vy) == (0, 0)
    status = asked(ground, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    gps = mavlink.MAV_SYS_STATUS_SENSOR_GPS
    assert status.onboard_control_sensors_present & gps
    assert not status.onboard_control_sensors_health & gps
    flags = asked(ground, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT).flags
    assert flags == 37  # attitude and height
    fix = asked(ground, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
    assert (fix.fix_type, fix.satellites_visible) == (mavlink.GPS_FIX_TYPE_NO_FIX, 0)
    assert ground.set_mode(RTL) == FAILED
    ground.wait(3.0)
    assert asked(ground, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT).flags == 167  # gives up


def test_vehicle_flies_on_when_gps_is_back() -> None:
    ground = with_faults("gps-lost@10+10")
    ground.take_off(10.0)
    ground.reposition(0.0, 100.0, 10.0)
    ground.wait(24.9 - ground.now_s)
    held = ground.position_enu_m
    ground.wait(0.2)
    assert ground.position_enu_m[1] > held[1]
    ground.wait(10.0)

    assert ground.position_enu_m == pytest.approx((0.0, 100.0, 10.0), abs=0.02)
    flags = asked(ground, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT).flags
    assert flags & mavlink.EKF_POS_HORIZ_ABS


def test_vehicle_that_never_saw_gps_knows_no_place_until_it_does() -> None:
    ground = with_faults("gps-lost@0+20")
    ground.wait(20.0)
    assert asked(ground, POSITION).lat == 0
    assert ground.texts() == ["ArduPilot Ready"]
    ground.set_mode(GUIDED)
    assert ground.arm() == FAILED
    assert ground.texts()[-1] == "Arm: Need Position Estimate"

    ground.wait(3.0)  # as long as after power-up
    assert "EKF3 IMU0 is using GPS" in ground.texts()
    assert ground.arm() == ACCEPTED


def test_firmware_lands_after_a_while_without_a_position_where_that_is_asked_for() -> None:
    ground = with_faults("gps-lost@10", position_failsafe_s=3.0)
    ground.take_off(10.0)
    ground.wait(17.9 - ground.now_s)
    assert mode_now(ground) == GUIDED
    ground.wait(0.2)
    assert mode_now(ground) == LAND
    assert ground.texts()[-1] == "EKF Failsafe: changed to Land Mode"

    ground.wait(20.0)
    assert ground.position_enu_m[2] == 0.0
    assert not ground.vehicle.pilot.armed


def test_a_failsafe_is_told_in_the_mode_before_it_is_told_in_words() -> None:
    ground = with_faults("failsafe-rtl@10")
    ground.take_off(10.0)
    before = len(ground.heard)
    ground.wait(10.0)

    told = [
        message
        for message in ground.heard[before:]
        if message.get_type() == "STATUSTEXT"
        or (message.get_type() == "HEARTBEAT" and message.custom_mode == RTL)
    ]
    assert told[0].get_type() == "HEARTBEAT"
    assert "Radio Failsafe" in ground.texts()


def test_charge_drops_to_the_stated_level_at_once() -> None:
    ground = with_faults("battery-low=0.35@10")
    ground.take_off(10.0)
    ground.wait(14.9 - ground.now_s)
    assert asked(ground, mavlink.MAVLINK_MSG_ID_SYS_STATUS).battery_remaining == 100
    ground.wait(0.2)

    status = asked(ground, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    battery = asked(ground, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS)
    assert status.battery_remaining == battery.battery_remaining == 35
    assert status.voltage_battery == battery.voltages[0] == round(10_500 + 0.35 * 2100)


def test_silent_vehicle_hears_nothing_and_says_nothing_but_flies_on() -> None:
    ground = with_faults("silent@10+10")
    ground.take_off(10.0)
    ground.command(INTERVAL, POSITION, 1e5)
    ground.reposition(0.0, 300.0, 10.0)
    ground.wait(15.05 - ground.now_s)
    heard = len(ground.heard)
    assert not ground.send(mavlink.MAVLink_command_long_message(1, 1, REQUEST, 0, *[33.0] * 7))
    north_m = ground.position_enu_m[1]
    ground.wait(9.9)
    assert len(ground.heard) == heard
    assert ground.position_enu_m[1] == pytest.approx(north_m + 99.0, abs=0.1)

    ground.wait(1.0)
    assert len(only(ground.heard[heard:], "GLOBAL_POSITION_INT")) >= 9


def test_stuck_vehicle_acknowledges_targets_and_stays_but_returns() -> None:
    ground = with_faults("stuck@10")
    ground.take_off(10.0)
    ground.wait(15.0 - ground.now_s)
    assert ground.reposition(0.0, 30.0, 10.0) == ACCEPTED
    ground.wait(30.0)
    assert ground.position_enu_m == (0.0, 0.0, 10.0)

    assert ground.set_mode(RTL) == ACCEPTED
    ground.wait(40.0)
    assert not ground.vehicle.pilot.armed


def test_vehicle_stuck_on_its_way_goes_on_when_that_ends() -> None:
    ground = with_faults("stuck@10+5")
    ground.take_off(10.0)
    ground.reposition(0.0, 100.0, 10.0)
    ground.wait(16.0 - ground.now_s)
    held = ground.position_enu_m
    assert 0.0 < held[1] < 100.0
    ground.wait(3.9)
    assert ground.position_enu_m == held

    ground.wait(12.0)
    assert ground.position_enu_m == pytest.approx((0.0, 100.0, 10.0), abs=0.02)


def test_stuck_vehicle_does_not_fly_its_mission() -> None:
    ground = with_faults("stuck@10")
    ground.take_off(10.0)
    ground.wait(15.0 - ground.now_s)
    assert ground.upload(ground.item(0), ground.item(1, 0.0, 50.0)) == 0
    assert ground.set_mode(AUTO) == ACCEPTED
    ground.wait(30.0)

    assert ground.position_enu_m == (0.0, 0.0, 10.0)
    assert not only(ground.heard, "MISSION_ITEM_REACHED")


def test_pilot_takes_over_and_gives_back() -> None:
    ground = with_faults("pilot@10+5")
    ground.take_off(10.0)
    ground.reposition(0.0, 200.0, 10.0)
    ground.wait(15.1 - ground.now_s)
    assert mode_now(ground) == LOITER
    held = ground.position_enu_m
    ground.wait(4.0)
    assert ground.position_enu_m == held

    ground.wait(1.0)
    assert mode_now(ground) == GUIDED
    assert ground.position_enu_m == held


def test_failsafe_returns_and_says_why() -> None:
    ground = with_faults("failsafe-rtl@10")
    ground.take_off(10.0)
    ground.reposition(0.0, 20.0, 10.0)
    ground.wait(15.1 - ground.now_s)
    assert mode_now(ground) == RTL
    assert ground.texts()[-1] == "Radio Failsafe"

    ground.wait(60.0)
    assert ground.position_enu_m == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert not ground.vehicle.pilot.armed


def test_vehicle_refuses_arming_and_says_why_until_that_ends() -> None:
    ground = with_faults("refuse-arming@0+40")
    ground.wait(31.0)
    ground.set_mode(GUIDED)
    assert ground.arm() == FAILED
    assert ground.texts()[-2:] == ["PreArm: Compass not healthy", "Arm: Compass not healthy"]
    status = asked(ground, mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    assert not status.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK

    ground.wait(10.0)
    assert ground.arm() == ACCEPTED


def test_vehicle_rejects_missions_and_keeps_the_one_it_has() -> None:
    ground = with_faults("reject-mission@5")
    ground.take_off(10.0)
    assert ground.upload(ground.item(0), ground.item(1, 0.0, 50.0)) == 0
    ground.wait(10.0 - ground.now_s)
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 3))

    assert the(answer, "MISSION_ACK").type == mavlink.MAV_MISSION_ERROR
    assert not only(answer, "MISSION_REQUEST")
    assert len(ground.vehicle.pilot.store.items) == 2


def test_vehicle_with_a_wrong_id_says_it_is_another_and_heeds_only_that_one() -> None:
    ground = with_faults("wrong-id@10+10")
    ground.take_off(10.0)
    ground.wait(15.0 - ground.now_s)
    said = ground.wait(3.0)

    assert only(said, "HEARTBEAT")
    assert {message.get_srcSystem() for message in said} == {2}
    order = mavlink.MAVLink_command_long_message(
        1, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, RTL, 0, 0, 0, 0, 0
    )
    assert not ground.send(order)
    assert ground.vehicle.pilot.mode is FlightMode.GUIDED
    ground.wait(10.0)
    assert ground.heard[-1].get_srcSystem() == 1
    assert ground.set_mode(RTL) == ACCEPTED


def test_faults_outlast_a_reboot() -> None:
    ground = with_faults("refuse-arming@1", "gps-lost@1", "reboot@2")
    ground.wait(5.0)
    ground.set_mode(GUIDED)
    ground.arm()
    ground.wait(30.0)

    assert ground.texts().count("ArduPilot Ready") == 2
    assert not ground.vehicle.pilot.readiness.has_position
    assert ground.arm() == FAILED


def test_broken_input_does_not_break_a_faulty_vehicle() -> None:
    ground = with_faults("reject-mission@0", "wrong-id@0", "stuck@0")
    ground.wait(5.0)
    ground.step(MavlinkReceived(0, mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)))
    ground.send(mavlink.MAVLink_mission_count_message(0, 0, 3))

    assert the(ground.heard, "MISSION_ACK").get_srcSystem() == 2


# --- How it is written --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "uav", "fault"),
    [
        ("uav1:reboot@30", "uav1", VehicleFault(FaultKind.REBOOT, 30.0)),
        ("a:b:silent@0.5+2", "a:b", VehicleFault(FaultKind.SILENT, 0.5, 2.0)),
        ("u:battery-low@9", "u", VehicleFault(FaultKind.BATTERY_LOW, 9.0, math.inf, 0.1)),
        ("u:battery-low=.25@9", "u", VehicleFault(FaultKind.BATTERY_LOW, 9.0, math.inf, 0.25)),
        ("u:wrong-id@0", "u", VehicleFault(FaultKind.WRONG_ID, 0.0)),
    ],
)
def test_fault_is_read(text: str, uav: str, fault: VehicleFault) -> None:
    assert parse_fault(text) == (uav, fault)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "no fault"),
        ("reboot@30", "no fault"),
        ("uav1:reboot", "no fault"),
        ("uav1:reboot@-3", "no fault"),
        ("uav1:reboot@nan", "no fault"),
        ("uav1:silent@3+", "no fault"),
        ("uav1:explode@3", "no kind of fault 'explode'"),
        ("uav1:silent@3+0", "duration must be above 0"),
        ("uav1:reboot@3+5", "takes no duration"),
        ("uav1:battery-low=1.5@3", "within 0..1"),
        ("uav1:silent=0.5@3", "takes no charge"),
        ("uav1:silent@" + "9" * 400, "T must be 0 or more"),
    ],
)
def test_wrong_fault_says_what_is_wrong(text: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        parse_fault(text)
