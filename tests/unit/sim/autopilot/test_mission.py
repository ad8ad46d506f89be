"""Mission upload, download and flight of the simulated vehicle."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import MavlinkReceived
from sim.autopilot.firmware.px4 import Px4Model
from tests.support.ground_station import (
    ACCEPTED,
    AUTO,
    FAILED,
    GUIDED,
    GroundStation,
    ground_station,
    only,
    the,
)

CANCELLED, INVALID_SEQUENCE, DENIED, NO_SPACE = 15, 13, 14, 4
DENIED_COMMAND = 2


def reached(ground: GroundStation) -> list[int]:
    return [message.seq for message in only(ground.heard, "MISSION_ITEM_REACHED")]


def current(ground: GroundStation) -> tuple[int, int, int, int]:
    ground.command(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_MISSION_CURRENT)
    message = only(ground.heard, "MISSION_CURRENT")[-1]
    return message.seq, message.total, message.mission_state, message.mission_mode


def flying(*items: tuple[float, float], **config: Any) -> GroundStation:
    """A vehicle in AUTO, 12 m above home, with waypoints at those places."""
    ground = ground_station(cruise_m_s=5.0, **config)
    ground.take_off(12.0)
    waypoints = [ground.item(seq, *place) for seq, place in enumerate(items, start=1)]
    assert ground.upload(ground.item(0), *waypoints) == 0
    assert ground.set_mode(AUTO) == ACCEPTED
    return ground


def test_waypoints_are_flown_and_reported_in_order_but_never_home() -> None:
    ground = flying((0.0, 10.0), (10.0, 10.0), (10.0, 0.0))
    ground.wait(30.0)

    assert reached(ground) == [1, 2, 3]
    assert [text for text in ground.texts() if "ission" in text or "command" in text] == [
        "Mission: 1 WP",
        "Reached command #1",
        "Mission: 2 WP",
        "Reached command #2",
        "Mission: 3 WP",
        "Reached command #3",
    ]
    assert current(ground) == (3, 3, 5, 1)
    assert ground.vehicle.pilot.armed


def test_items_are_asked_for_the_old_way_and_acknowledged_at_the_end() -> None:
    ground = ground_station()
    ground.wait(5.0)
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    assert [message.get_type() for message in answer] == ["MISSION_REQUEST"]
    assert (answer[0].target_system, answer[0].target_component) == (255, 190)
    [request] = ground.send(ground.item(0))
    assert request.seq == 1

    answer = ground.send(ground.item(1, 5.0, 5.0))
    assert [message.get_type() for message in answer] == [
        "MISSION_ACK",
        "STATUSTEXT",
        "PARAM_VALUE",
    ]
    assert answer[1].text == "Flight plan received"
    assert (answer[2].param_id, answer[2].param_value) == ("MIS_TOTAL", 2.0)


def test_download_gives_the_mission_back_with_home_as_item_0() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.upload(ground.item(0, 1.0, 1.0), ground.item(1, 5.0, 6.0, 12.5, params=(3.0, 0, 0, 0)))
    request = mavlink.MAVLink_mission_request_list_message(1, 1)
    assert the(ground.send(request), "MISSION_COUNT").count == 2

    [home] = ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 0))
    assert (home.x, home.y) == ground.place_e7(0.0, 0.0)
    assert (home.frame, home.command, home.z) == (0, 16, 488.0)
    [item] = ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 1))
    assert (item.x, item.y) == ground.place_e7(5.0, 6.0)
    assert (item.seq, item.frame, item.z, item.param1) == (1, 3, 12.5, 3.0)
    [old] = ground.send(mavlink.MAVLink_mission_request_message(1, 1, 1))
    assert old.get_type() == "MISSION_ITEM"
    assert old.x == pytest.approx(item.x / 1e7, abs=1e-5)
    beyond = ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 2))
    assert [message.get_type() for message in beyond] == ["MISSION_COUNT", "MISSION_ACK"]
    assert beyond[1].type == mavlink.MAV_MISSION_ERROR


def test_older_float_items_are_taken_too() -> None:
    ground = ground_station()
    ground.wait(5.0)
    lat_e7, lon_e7 = ground.place_e7(5.0, 5.0)
    item = mavlink.MAVLink_mission_item_message(
        1, 1, 1, 3, 16, 0, 1, 0, 0, 0, 0, lat_e7 / 1e7, lon_e7 / 1e7, 12.0
    )

    assert ground.upload(ground.item(0), item) == 0
    [stored] = ground.send(mavlink.MAVLink_mission_request_int_message(1, 1, 1))
    assert stored.x == pytest.approx(lat_e7, abs=40)  # single precision degrees


def test_missing_items_are_asked_for_again_and_given_up_after_a_while() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.upload(ground.item(0), ground.item(1, 5.0, 5.0))
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 3))
    ground.send(ground.item(0))
    said = ground.wait(10.0)

    assert [message.seq for message in only(said, "MISSION_REQUEST")] == [1] * 7
    assert the(said, "MISSION_ACK").type == CANCELLED
    # The mission that stood there before is untouched.
    count = ground.send(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert the(count, "MISSION_COUNT").count == 2


def test_item_out_of_turn_is_refused_and_the_upload_goes_on() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2))

    assert the(ground.send(ground.item(1)), "MISSION_ACK").type == INVALID_SEQUENCE
    assert the(ground.send(ground.item(0)), "MISSION_REQUEST").seq == 1
    assert the(ground.send(ground.item(1)), "MISSION_ACK").type == 0
    assert the(ground.send(ground.item(1)), "MISSION_ACK").type == mavlink.MAV_MISSION_ERROR


@pytest.mark.parametrize(
    ("change", "result"),
    [
        ({"command": mavlink.MAV_CMD_DO_SET_SERVO}, mavlink.MAV_MISSION_UNSUPPORTED),
        ({"frame": mavlink.MAV_FRAME_LOCAL_NED}, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"height_m": float("nan")}, mavlink.MAV_MISSION_INVALID),
        ({"params": (float("inf"), 0.0, 0.0, 0.0)}, mavlink.MAV_MISSION_INVALID),
    ],
)
def test_items_that_cannot_be_flown_are_refused(change: dict[str, Any], result: int) -> None:
    ground = ground_station()
    ground.wait(5.0)

    assert ground.upload(ground.item(0), ground.item(1, 5.0, 5.0, **change)) == result


def test_too_many_items_and_other_kinds_of_missions_are_refused() -> None:
    ground = ground_station()
    ground.wait(5.0)
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 1000))
    assert the(answer, "MISSION_ACK").type == NO_SPACE
    rally = mavlink.MAV_MISSION_TYPE_RALLY
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2, rally))
    assert (answer[0].type, answer[0].mission_type) == (mavlink.MAV_MISSION_UNSUPPORTED, rally)


def test_firmware_without_fences_says_so() -> None:
    ground = ground_station(takes_fences=False)
    ground.wait(5.0)
    fence = mavlink.MAV_MISSION_TYPE_FENCE
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2, fence))
    assert (answer[0].type, answer[0].mission_type) == (mavlink.MAV_MISSION_UNSUPPORTED, fence)


def test_second_ground_station_cannot_break_into_an_upload() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    other = GroundStation(ground.vehicle, channel=1, now_s=ground.now_s)
    other._outgoing._mav.srcSystem = 254

    answer = other.send(mavlink.MAVLink_mission_count_message(1, 1, 5))
    assert the(answer, "MISSION_ACK").type == DENIED
    assert the(other.send(other.item(0)), "MISSION_ACK").type == DENIED
    assert the(ground.send(ground.item(0)), "MISSION_REQUEST").seq == 1


def test_mission_replaced_in_flight_is_flown_at_once() -> None:
    ground = flying((0.0, 50.0))
    ground.wait(4.0)
    said_before = len(ground.texts())
    assert ground.upload(ground.item(0), ground.item(1, 30.0, 20.0)) == 0

    assert ground.texts()[said_before:] == [
        "Flight plan received",
        "Mission: 1 WP",
        "Auto mission changed, restarted command",
    ]
    ground.wait(6.1)
    assert ground.position_enu_m == pytest.approx((30.0, 20.0, 12.0), abs=0.02)
    assert reached(ground) == [1]


def test_same_mission_uploaded_again_in_flight_changes_nothing() -> None:
    ground = flying((0.0, 50.0))
    ground.wait(4.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 50.0))

    assert ground.texts()[-1] == "Flight plan received"
    ground.wait(6.1)
    assert reached(ground) == [1]


def test_shorter_mission_in_flight_ends_the_flight() -> None:
    ground = flying((0.0, 10.0), (0.0, 50.0))
    ground.wait(3.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 10.0))

    assert ground.texts()[-1] == "Auto mission changed but failed to restart command"
    assert current(ground)[2] == 5


def test_finished_mission_uploaded_again_starts_nothing_by_itself() -> None:
    ground = flying((0.0, 10.0))
    ground.wait(5.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 10.0))
    assert ground.set_mode(AUTO) == ACCEPTED
    ground.wait(5.0)
    assert reached(ground) == [1]

    ground.send(mavlink.MAVLink_mission_set_current_message(1, 1, 1))
    ground.wait(5.0)
    assert reached(ground) == [1]
    # Only now: set to go on, then told to start.
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.wait(5.0)
    assert reached(ground) == [1, 1]


def test_mission_left_and_entered_again_goes_on_with_its_current_item() -> None:
    ground = flying((0.0, 10.0), (0.0, 50.0))
    ground.wait(4.0)
    ground.set_mode(GUIDED)
    assert current(ground) == (2, 2, 4, 0)
    ground.wait(5.0)
    ground.set_mode(AUTO)
    assert ground.texts()[-1] == "Mission: 2 WP"
    ground.wait(20.0)

    assert reached(ground) == [1, 2]


def test_set_current_goes_there_at_once() -> None:
    ground = flying((0.0, 10.0), (20.0, 0.0))
    said = ground.send(mavlink.MAVLink_mission_set_current_message(1, 1, 2))

    assert [message.get_type() for message in said] == ["STATUSTEXT", "MISSION_CURRENT"]
    ground.wait(4.1)
    assert reached(ground) == [2]
    assert ground.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 9) == FAILED
    assert ground.command(mavlink.MAV_CMD_DO_SET_MISSION_CURRENT, 1) == ACCEPTED


def test_waypoint_is_reached_when_its_hold_time_is_over() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(12.0)
    hold = (4.0, 0.0, 0.0, 0.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 10.0, params=hold), ground.item(2, 5.0, 10.0))
    ground.set_mode(AUTO)

    ground.wait(5.9)
    assert reached(ground) == []
    ground.wait(0.2)
    assert reached(ground) == [1]
    ground.wait(1.0)
    assert reached(ground) == [1, 2]


def giving_way(limit_s: float) -> GroundStation:
    """A vehicle in AUTO, 12 m above home, whose mission gives way to targets before its place."""
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(12.0)
    assert ground.upload(*_items_giving_way(ground, limit_s)) == 0
    assert ground.set_mode(AUTO) == ACCEPTED
    return ground


def _items_giving_way(ground: GroundStation, limit_s: float, hold_s: float = 0.0) -> list[Any]:
    speed, limits = mavlink.MAV_CMD_DO_CHANGE_SPEED, mavlink.MAV_CMD_DO_GUIDED_LIMITS
    return [
        ground.item(0),
        ground.item(1, command=speed, params=(1.0, 4.0, -1.0, 0.0)),
        ground.item(2, command=limits, params=(limit_s, 0.0, 0.0, 0.0)),
        ground.item(3, command=mavlink.MAV_CMD_NAV_GUIDED_ENABLE, params=(1.0, 0.0, 0.0, 0.0)),
        ground.item(4, 0.0, 20.0, params=(hold_s, 0.0, 0.0, 0.0)),
    ]


def test_mission_gives_way_to_targets_for_a_time_and_then_goes_on_at_its_own_speed() -> None:
    ground = giving_way(10.0)
    assert reached(ground) == [1, 2]
    assert current(ground)[0] == 3
    assert ground.reposition(20.0, 0.0, 12.0, change_mode=False) == ACCEPTED
    ground.wait(4.1)
    assert ground.position_enu_m == pytest.approx((20.0, 0.0, 12.0), abs=0.01), "it forgot 4 m/s"
    assert current(ground)[0] == 3
    ground.wait(5.8)
    assert reached(ground) == [1, 2]
    ground.wait(0.2)
    assert reached(ground) == [1, 2, 3]
    ground.wait(6.9)
    assert reached(ground) == [1, 2, 3], "28 m at 4 m/s"
    ground.wait(0.2)
    assert reached(ground) == [1, 2, 3, 4]


def test_a_speed_told_after_the_target_is_flown() -> None:
    ground = giving_way(30.0)
    ground.reposition(20.0, 0.0, 12.0, change_mode=False)
    assert ground.command(mavlink.MAV_CMD_DO_CHANGE_SPEED, 1.0, 2.0, -1.0) == ACCEPTED
    ground.wait(5.0)
    assert ground.position_enu_m[0] == pytest.approx(10.0, abs=0.1)


def test_a_mission_that_gives_way_no_more_takes_no_targets() -> None:
    ground = giving_way(2.0)
    ground.wait(2.1)
    assert current(ground)[0] == 4
    assert ground.reposition(20.0, 0.0, 12.0, change_mode=False) == DENIED_COMMAND


def test_another_mission_does_not_end_the_time_for_targets() -> None:
    ground = giving_way(10.0)
    ground.reposition(20.0, 0.0, 12.0, change_mode=False)
    ground.wait(2.0)
    assert ground.upload(*_items_giving_way(ground, 10.0, hold_s=3.0)) == 0
    ground.wait(2.2)
    assert ground.position_enu_m == pytest.approx((20.0, 0.0, 12.0), abs=0.01)
    ground.wait(6.0)
    assert current(ground)[0] == 4


def test_px4_knows_no_missions_that_give_way() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    limits = ground.item(0, command=mavlink.MAV_CMD_DO_GUIDED_LIMITS, frame=2)
    assert ground.upload(limits, ground.item(1)) == mavlink.MAV_MISSION_UNSUPPORTED


def test_whole_flight_from_take_off_to_landing_by_mission() -> None:
    ground = ground_station(cruise_m_s=10.0)
    ground.wait(5.0)
    items = [
        ground.item(0),
        ground.item(1, height_m=10.0, command=mavlink.MAV_CMD_NAV_TAKEOFF),
        ground.item(2, command=mavlink.MAV_CMD_DO_CHANGE_SPEED, params=(1.0, 2.0, -1.0, 0.0)),
        ground.item(3, 0.0, 10.0, 10.0),
        ground.item(4, command=mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH),
    ]
    assert ground.upload(*items) == 0
    ground.set_mode(GUIDED)
    assert ground.arm() == ACCEPTED
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED

    ground.wait(4.0 + 5.0)
    assert reached(ground) == [1, 2, 3]
    assert ground.position_enu_m == pytest.approx((0.0, 10.0, 10.0), abs=0.02)
    ground.wait(60.0)
    assert reached(ground) == [1, 2, 3, 4]
    assert ground.texts()[-1] == "Disarming motors"
    assert ground.position_enu_m == (0.0, 0.0, 0.0)
    assert current(ground) == (0, 4, 5, 1)


def test_mission_landing_flies_to_its_place_first() -> None:
    ground = ground_station(cruise_m_s=5.0)
    ground.take_off(12.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 20.0, 0.0, command=mavlink.MAV_CMD_NAV_LAND))
    ground.set_mode(AUTO)

    ground.wait(4.1)
    assert ground.position_enu_m[2] == pytest.approx(12.0, abs=0.2)
    ground.wait(10.0)
    assert reached(ground) == [1]
    assert ground.position_enu_m == pytest.approx((0.0, 20.0, 0.0), abs=0.02)
    assert not ground.vehicle.pilot.armed


def test_auto_on_the_ground_needs_a_take_off_and_a_start() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 10.0))
    ground.set_mode(GUIDED)
    ground.arm()
    assert ground.set_mode(AUTO) == FAILED
    assert "Auto: Missing Takeoff Cmd" in ground.texts()

    take_off = ground.item(1, height_m=10.0, command=mavlink.MAV_CMD_NAV_TAKEOFF)
    ground.upload(ground.item(0), take_off)
    assert ground.set_mode(AUTO) == ACCEPTED
    ground.wait(5.0)
    assert ground.position_enu_m == (0.0, 0.0, 0.0)
    assert ground.command(mavlink.MAV_CMD_MISSION_START) == ACCEPTED
    ground.wait(5.0)
    assert ground.position_enu_m == (0.0, 0.0, 10.0)
    assert ground.command(mavlink.MAV_CMD_MISSION_START, 1, 2) == 2


def test_mission_is_cleared_unless_it_is_being_flown() -> None:
    ground = flying((0.0, 50.0))
    clear = mavlink.MAVLink_mission_clear_all_message(1, 1)
    assert the(ground.send(clear), "MISSION_ACK").type == mavlink.MAV_MISSION_ERROR
    ground.set_mode(GUIDED)
    assert the(ground.send(clear), "MISSION_ACK").type == 0
    assert current(ground) == (0, 0, 1, 0)
    assert ground.set_mode(AUTO) == FAILED


def test_fetched_item_of_a_lost_channel_is_no_longer_asked_for() -> None:
    from sim.autopilot.events import Disconnected

    ground = ground_station()
    ground.wait(5.0)
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, 2))
    ground.step(Disconnected(0))

    assert only(ground.wait(20.0), "MISSION_ACK") == []


def test_zero_items_empty_the_mission() -> None:
    ground = ground_station()
    ground.wait(5.0)
    ground.upload(ground.item(0), ground.item(1, 0.0, 10.0))
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, 0))

    assert the(answer, "MISSION_ACK").type == 0
    assert current(ground)[:3] == (0, 0, 1)


def test_mission_with_many_landings_does_not_exhaust_the_stack() -> None:
    ground = ground_station()
    ground.take_off(3.0)
    landings = [
        ground.item(seq, height_m=0.0, command=mavlink.MAV_CMD_NAV_LAND) for seq in range(1, 700)
    ]
    assert ground.upload(ground.item(0), *landings) == 0
    ground.set_mode(AUTO)
    ground.wait(60.0)

    assert reached(ground)[0] == 1
    assert not ground.vehicle.pilot.armed


def test_several_messages_in_one_step_keep_their_order() -> None:
    ground = ground_station()
    ground.wait(5.0)
    message = mavlink.MAVLink_ping_message(1, 2, 0, 0)
    frame = ground._outgoing.encode(message)
    [decoded] = ground._to_ground.decode(frame)

    assert ground.step(MavlinkReceived(0, decoded))[0].get_type() == "PING"
