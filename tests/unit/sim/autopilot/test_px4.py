"""What the simulated vehicle does otherwise when it runs PX4."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays
from tests.support.ground_station import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    GroundStation,
    only,
    the,
)
from tests.support.px4_ground import (
    HOLD,
    LAND,
    POSITION,
    RETURN,
    TAKEOFF,
    TEMPORARILY_REJECTED,
    airborne,
    ground_station,
    home_alt_m,
    mode,
    reposition,
    take_off,
)


def test_it_boots_into_hold_and_stands_by_when_it_is_up() -> None:
    ground = ground_station(delays=Delays(2.5, 2.5, 2.5, 2.5))
    ground.wait(4.0)

    beats = only(ground.heard, "HEARTBEAT")
    assert {beat.custom_mode for beat in beats} == {4 << 16 | 3 << 24}
    assert [beat.system_status for beat in beats] == [0, 0, 0, 3, 3]
    assert {beat.base_mode for beat in beats} == {29}


def test_it_streams_what_a_bridge_needs_unasked() -> None:
    ground = ground_station()
    ground.wait(5.0)

    heard = {message.get_type() for message in ground.heard}
    assert heard >= {
        "HEARTBEAT",
        "SYS_STATUS",
        "GLOBAL_POSITION_INT",
        "EXTENDED_SYS_STATE",
        "MISSION_CURRENT",
        "HOME_POSITION",
    }


def test_only_the_health_bits_tell_that_it_can_arm() -> None:
    ground = ground_station()
    ground.wait(5.0)

    status = only(ground.heard, "SYS_STATUS")[-1]
    prearm = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    assert status.onboard_control_sensors_health & prearm
    assert not status.onboard_control_sensors_enabled & prearm


def test_arming_before_a_position_is_rejected_for_now() -> None:
    ground = ground_station(delays=Delays(0.1, 0.1, 20.0, 30.0))
    ground.wait(5.0)

    assert ground.arm() == TEMPORARILY_REJECTED
    assert "".join(ground.texts()) == "Arming denied: Resolve system health failures first\t"


def test_long_texts_come_in_numbered_pieces() -> None:
    ground = ground_station(delays=Delays(0.1, 0.1, 20.0, 30.0))
    ground.wait(5.0)
    ground.arm()
    ground.arm()

    pieces = [(text.id, text.chunk_seq) for text in only(ground.heard, "STATUSTEXT")]
    assert pieces == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_a_change_of_mode_is_acknowledged_twice_and_seen_in_the_next_heartbeat() -> None:
    ground = ground_station()
    ground.wait(5.5)
    answer = ground.send(
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, *POSITION, 0, 0, 0, 0)
    )

    assert [message.get_type() for message in answer] == ["COMMAND_ACK", "COMMAND_ACK"]
    assert mode(ground) == POSITION


def test_the_older_message_changes_the_mode_too_and_is_acknowledged_as_the_command() -> None:
    ground = ground_station()
    ground.wait(5.0)
    answer = ground.send(mavlink.MAVLink_set_mode_message(1, 1, POSITION[0] << 16))

    assert the(answer, "COMMAND_ACK").command == mavlink.MAV_CMD_DO_SET_MODE
    assert mode(ground) == POSITION


def test_a_refused_take_off_leaves_no_height_for_a_later_one() -> None:
    ground = ground_station(delays=Delays(0.1, 0.1, 0.2, 20.0))
    ground.wait(5.0)
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1, 21196)
    assert take_off(ground, home_alt_m(ground) + 50.0) == TEMPORARILY_REJECTED
    assert ground.texts()[-2:] == ["Switching to mode 'Takeoff' is currently not avail", "able\t"]
    ground.wait(20.0)
    ground.arm()
    ground.set_mode(*TAKEOFF)
    ground.wait(10.0)

    assert ground.position_enu_m[2] == pytest.approx(2.5)


def test_unknown_modes_are_denied() -> None:
    ground = ground_station()
    ground.wait(5.0)

    assert ground.set_mode(4, 99) == DENIED
    assert ground.set_mode(6) == DENIED  # OFFBOARD needs a stream of targets
    assert mode(ground) == HOLD


def test_it_takes_off_above_the_sea_in_a_mode_of_its_own_and_then_holds() -> None:
    ground = ground_station(climb_m_s=2.0)
    ground.wait(5.0)
    ground.arm()

    assert take_off(ground, home_alt_m(ground) + 10.0) == ACCEPTED
    assert mode(ground) == TAKEOFF
    ground.wait(4.1)
    assert ground.position_enu_m[2] == pytest.approx(10.0)
    assert mode(ground) == HOLD
    assert "Takeoff detected\t" in ground.texts()


@pytest.mark.parametrize("height_m", [math.nan, 1.0, -100.0])
def test_it_rises_at_least_to_its_usual_height(height_m: float) -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.arm()
    take_off(ground, home_alt_m(ground) + height_m)
    ground.wait(5.0)

    assert ground.position_enu_m[2] == pytest.approx(2.5)


def test_a_take_off_ordered_before_arming_begins_with_it() -> None:
    ground = ground_station()
    ground.wait(5.0)
    assert take_off(ground, home_alt_m(ground) + 10.0) == ACCEPTED
    ground.wait(10.0)
    assert ground.position_enu_m[2] == 0.0
    ground.arm()
    ground.wait(6.0)

    assert ground.position_enu_m[2] == pytest.approx(10.0)


def test_motors_that_lift_nothing_are_stopped_after_ten_seconds() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.arm()
    ground.wait(9.9)
    assert ground.vehicle.pilot.armed
    ground.wait(0.2)

    assert not ground.vehicle.pilot.armed
    assert ground.texts()[-1] == "Disarmed by auto preflight disarming\t"


def test_repositioning_needs_the_flag_also_while_holding() -> None:
    ground = airborne()

    assert reposition(ground, 50.0, flags=0.0) == UNSUPPORTED
    assert reposition(ground, 50.0) == ACCEPTED
    ground.wait(10.1)
    assert ground.position_enu_m == pytest.approx((0.0, 50.0, 10.0), abs=0.01)


def test_heights_of_commands_are_above_the_sea_whatever_their_frame_says() -> None:
    ground = airborne()
    relative = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT

    assert reposition(ground, 0.0, frame=relative, alt_m=home_alt_m(ground) + 20.0) == ACCEPTED
    ground.wait(20.0)
    assert ground.position_enu_m[2] == pytest.approx(20.0, abs=0.01)


def test_a_repositioning_may_give_the_speed_of_its_leg_alone() -> None:
    ground = airborne()
    reposition(ground, 100.0, speed_m_s=10.0)
    ground.wait(2.0)
    assert ground.position_enu_m[1] == pytest.approx(20.0, abs=0.01)
    reposition(ground, 100.0)
    ground.wait(2.0)

    assert ground.position_enu_m[1] == pytest.approx(30.0, abs=0.01)


def test_paused_on_its_way_it_brakes_and_does_not_come_back() -> None:
    """It reckons itself where it can stop (navigator_main.cpp of 1.17, preproject_stop_point)."""
    ground = airborne(acceleration_m_s2=2.0)
    reposition(ground, 100.0)
    ground.wait(6.0)
    before_m, nowhere = ground.position_enu_m[1], (math.nan,) * 4
    assert ground.command(mavlink.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, *nowhere) == ACCEPTED
    norths_m = []
    for _ in range(80):
        ground.wait(0.1)
        norths_m.append(ground.position_enu_m[1])

    assert norths_m == sorted(norths_m)
    assert norths_m[-1] - before_m == pytest.approx(
        ground.vehicle.config.cruise_m_s**2 / 4.0, abs=1.5
    )
    assert norths_m[-1] == pytest.approx(norths_m[-20], abs=0.01)


def test_paused_while_it_falls_it_comes_down() -> None:
    ground = airborne(acceleration_m_s2=2.0)
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, 21196.0)
    ground.command(mavlink.MAV_CMD_DO_REPOSITION, -1.0, 1.0, 0.0, *(math.nan,) * 4)
    ground.wait(20.0)

    assert ground.position_enu_m[2] == pytest.approx(0.0, abs=0.01)


def test_an_ordered_speed_holds_for_later_legs_until_hold_is_entered_anew() -> None:
    ground = airborne()
    assert ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1, 8.0, -1) == ACCEPTED
    reposition(ground, 100.0)
    ground.wait(2.0)
    assert ground.position_enu_m[1] == pytest.approx(16.0, abs=0.01)
    ground.set_mode(*POSITION)
    reposition(ground, 100.0)
    ground.wait(2.0)

    assert ground.position_enu_m[1] == pytest.approx(26.0, abs=0.01)


def test_a_target_outside_its_own_fence_is_acknowledged_and_ignored() -> None:
    ground = airborne()
    set_parameter(ground, b"GF_MAX_HOR_DIST", 30.0, mavlink.MAV_PARAM_TYPE_REAL32)

    assert reposition(ground, 50.0) == ACCEPTED
    ground.wait(5.0)
    assert ground.position_enu_m[1] == pytest.approx(0.0, abs=0.01)
    assert ground.texts()[-1] == "Reposition is outside geofence\t"


def test_some_messages_cannot_be_asked_for() -> None:
    ground = ground_station()
    ground.wait(5.0)
    interval = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL

    assert ground.command(interval, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT, 5e5) == FAILED
    assert ground.command(interval, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT, 5e5) == FAILED
    assert ground.command(interval, mavlink.MAVLINK_MSG_ID_SYS_STATUS, 5e5) == ACCEPTED


def test_landing_stops_the_motors_later_and_ends_in_hold() -> None:
    ground = airborne(land_m_s=2.0, touchdown_s=1.0)
    ground.set_mode(*LAND)
    ground.wait(6.1)
    assert ground.texts()[-1] == "Landing detected\t"
    assert ground.vehicle.pilot.armed
    ground.wait(2.0)

    assert ground.texts()[-1] == "Disarmed by landing\t"
    assert mode(ground) == HOLD


def test_returning_rises_flies_home_and_lands() -> None:
    ground = airborne()
    reposition(ground, 50.0)
    ground.wait(10.1)
    ground.set_mode(*RETURN)
    ground.wait(20.0 / 3.0)
    assert ground.position_enu_m == pytest.approx((0.0, 50.0, 30.0), abs=0.1)
    ground.wait(40.0)

    assert ground.position_enu_m == pytest.approx((0.0, 0.0, 0.0), abs=0.01)
    assert not ground.vehicle.pilot.armed
    assert mode(ground) == HOLD


def test_motors_are_not_stopped_in_the_air_unless_forced() -> None:
    ground = airborne()

    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == TEMPORARILY_REJECTED
    assert ground.texts()[-1] == "Disarming denied: not landed\t"
    assert ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 21196) == ACCEPTED


def test_items_are_given_back_with_frames_of_whole_numbers() -> None:
    ground = ground_station()
    ground.upload(ground.item(0, 0.0, 50.0))
    count = ground.send(mavlink.MAVLink_mission_request_list_message(1, 1))
    item = the(
        ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0)), "MISSION_ITEM_INT"
    )

    assert the(count, "MISSION_COUNT").count == 1
    assert item.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT


def set_parameter(ground: GroundStation, name: bytes, value: float, kind: int) -> list[Any]:
    return ground.send(mavlink.MAVLink_param_set_message(1, 1, name, value, kind))


def test_integer_parameters_travel_by_their_bytes() -> None:
    ground = ground_station()
    int32 = mavlink.MAV_PARAM_TYPE_INT32
    answer = set_parameter(
        ground, b"NAV_DLL_ACT", struct.unpack("<f", struct.pack("<i", 2))[0], int32
    )
    values = [each.param_value for each in only(answer, "PARAM_VALUE")]

    # As an answer, and as news to everybody.
    assert [struct.unpack("<i", struct.pack("<f", each)) for each in values] == [(2,), (2,)]
    parameter = ground.vehicle.pilot.parameters.get("NAV_DLL_ACT")
    assert parameter is not None
    assert parameter.value == 2.0
    assert set_parameter(ground, b"NAV_DLL_ACT", 3.0, mavlink.MAV_PARAM_TYPE_REAL32) == []


def test_parameters_asked_by_name_tell_their_index() -> None:
    ground = ground_station()
    request = mavlink.MAVLink_param_request_read_message
    named = the(ground.send(request(1, 1, b"MPC_XY_CRUISE", -1)), "PARAM_VALUE")
    indexed = the(ground.send(request(1, 1, b"", named.param_index)), "PARAM_VALUE")

    assert named.param_value == 5.0
    assert indexed.param_id == "MPC_XY_CRUISE"
    assert ground.send(request(1, 1, b"WP_SPD", -1)) == []


def test_estimator_says_at_rest_that_the_position_is_constant_though_it_has_one() -> None:
    ground = ground_station()
    ground.wait(5.0)

    def flags() -> int:
        request, status = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
        assert ground.command(request, status) == ACCEPTED
        return int(only(ground.heard, "ESTIMATOR_STATUS")[-1].flags)

    assert flags() & mavlink.EKF_CONST_POS_MODE
    assert flags() & mavlink.EKF_POS_HORIZ_ABS
    assert ground.arm() == ACCEPTED
    assert take_off(ground, home_alt_m(ground) + 10.0) == ACCEPTED
    ground.wait(10.0)
    assert not flags() & mavlink.EKF_CONST_POS_MODE
    assert flags() & mavlink.EKF_POS_HORIZ_ABS
