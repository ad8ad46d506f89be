"""What the simulated vehicle does otherwise when it runs PX4."""

from __future__ import annotations

import math
import struct
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.config import Delays
from sim.autopilot.firmware.px4 import Px4Model
from tests.support.ground_station import (
    ACCEPTED,
    DENIED,
    FAILED,
    UNSUPPORTED,
    GroundStation,
    only,
    the,
)
from tests.support.ground_station import ground_station as any_ground_station

TEMPORARILY_REJECTED = 1
TAKEOFF, HOLD, MISSION, RETURN, LAND = (4, 2), (4, 3), (4, 4), (4, 5), (4, 6)
POSITION = (3, 0)
HOME_ALT_M = 488.0


def ground_station(**config: Any) -> GroundStation:
    return any_ground_station(Px4Model(), **{"cruise_m_s": 5.0, **config})


def take_off(ground: GroundStation, alt_m: float = math.nan) -> int:
    nan = math.nan
    return ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, alt_m)


def airborne(height_m: float = 10.0, **config: Any) -> GroundStation:
    """A vehicle that holds its place above home."""
    ground = ground_station(**config)
    ground.wait(5.0)
    assert ground.arm() == ACCEPTED
    assert take_off(ground, home_alt_m(ground) + height_m) == ACCEPTED
    ground.wait(height_m / ground.vehicle.config.climb_m_s + 1.0)
    assert mode(ground) == HOLD
    return ground


def home_alt_m(ground: GroundStation) -> float:
    return ground.vehicle.config.origin.alt_m


def mode(ground: GroundStation) -> tuple[int, int]:
    """Main and sub mode in the next heartbeat."""
    ground.wait(1.0)
    custom_mode = only(ground.heard, "HEARTBEAT")[-1].custom_mode
    return custom_mode >> 16 & 0xFF, custom_mode >> 24


def reposition(ground: GroundStation, north_m: float, speed_m_s: float = -1.0, **to: Any) -> int:
    lat_e7, lon_e7 = ground.place_e7(0.0, north_m)
    return ground.command_int(
        mavlink.MAV_CMD_DO_REPOSITION,
        to.get("frame", mavlink.MAV_FRAME_GLOBAL_INT),
        lat_e7,
        lon_e7,
        to.get("alt_m", home_alt_m(ground) + 10.0),
        speed_m_s,
        to.get("flags", 1.0),
    )


def reached(ground: GroundStation) -> list[int]:
    return [message.seq for message in only(ground.heard, "MISSION_ITEM_REACHED")]


def mission_texts(ground: GroundStation) -> list[str]:
    return [text.rstrip("\t") for text in ground.texts() if "ission" in text]


def checked(ground: GroundStation, *items: Any) -> None:
    """Upload a mission and wait until it can be begun."""
    assert ground.upload(*items) == 0
    ground.wait(2.0)


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
