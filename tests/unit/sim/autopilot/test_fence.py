"""Fences that ground stations upload: taken, read back, refused, heeded."""

from __future__ import annotations

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import Reboot
from sim.autopilot.fence import FenceError, fence_of
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.mission_item import StoredMissionItem
from swarm.model.frames import DEFAULT_ORIGIN, wgs84_from_enu
from tests.support.ground_station import (
    ACCEPTED,
    FAILED,
    GUIDED,
    RTL,
    GroundStation,
    ground_station,
    only,
    the,
)

FENCE = mavlink.MAV_MISSION_TYPE_FENCE
INSIDE = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
OUTSIDE = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
FIELD = [(-200.0, -200.0), (200.0, -200.0), (200.0, 200.0), (-200.0, 200.0)]
VILLAGE = [(-20.0, 40.0), (20.0, 40.0), (20.0, 60.0), (-20.0, 60.0)]
HERE = [(-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)]
HOLD = 4, 3


def corner(seq: int, command: int, number: float, east_m: float, north_m: float) -> Any:
    lat_deg, lon_deg, _ = wgs84_from_enu(DEFAULT_ORIGIN, (east_m, north_m, 0.0))
    place = round(lat_deg * 1e7), round(lon_deg * 1e7), 0.0
    head = 1, 1, seq, mavlink.MAV_FRAME_GLOBAL, command, 0, 1
    return mavlink.MAVLink_mission_item_int_message(*head, number, 0, 0, 0, *place, FENCE)


def corners(*areas: tuple[int, list[tuple[float, float]]]) -> list[Any]:
    listed = [(command, len(places), *place) for command, places in areas for place in places]
    return [corner(seq, *each) for seq, each in enumerate(listed)]


def upload(ground: GroundStation, items: list[Any]) -> int:
    answer = ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), FENCE))
    while not (acks := only(answer, "MISSION_ACK")):
        [request] = only(answer, "MISSION_REQUEST") + only(answer, "MISSION_REQUEST_INT")
        assert request.mission_type == FENCE
        answer = ground.send(items[request.seq])
    assert acks[0].mission_type == FENCE
    return int(acks[0].type)


def read_back(ground: GroundStation) -> list[tuple[int, float, int, int]]:
    answer = ground.send(mavlink.MAVLink_mission_request_list_message(1, 1, FENCE))
    found = []
    for seq in range(the(answer, "MISSION_COUNT").count):
        asked = mavlink.MAVLink_mission_request_int_message(1, 1, seq, FENCE)
        item = the(ground.send(asked), "MISSION_ITEM_INT")
        assert (item.seq, item.mission_type) == (seq, FENCE)
        found.append((item.command, item.param1, item.x, item.y))
    return found


def set_parameter(ground: GroundStation, name: bytes, value: float) -> None:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    ground.send(mavlink.MAVLink_param_set_message(1, 1, name, value, kind))


def fenced_copter(*areas: tuple[int, list[tuple[float, float]]]) -> GroundStation:
    ground = ground_station()
    ground.wait(5.0)
    assert upload(ground, corners(*areas)) == ACCEPTED
    set_parameter(ground, b"FENCE_ENABLE", 1.0)
    return ground


def flying_px4(*areas: tuple[int, list[tuple[float, float]]]) -> GroundStation:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    assert upload(ground, corners(*areas)) == ACCEPTED
    ground.set_mode(*HOLD)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(12.0)
    return ground


def fly_px4(ground: GroundStation, north_m: float) -> None:
    place = ground.place_e7(0.0, north_m)
    ground.command_int(mavlink.MAV_CMD_DO_REPOSITION, 5, *place, 498.0, -1.0, 1.0)


def test_a_fence_is_read_back_as_it_was_sent_and_outlasts_a_reboot() -> None:
    for ground in (ground_station(), ground_station(Px4Model())):
        ground.wait(5.0)
        items = corners((INSIDE, FIELD), (OUTSIDE, VILLAGE))
        assert read_back(ground) == []
        assert upload(ground, items) == ACCEPTED
        sent = [(item.command, item.param1, item.x, item.y) for item in items]
        assert read_back(ground) == sent
        ground.step(Reboot())
        ground.wait(5.0)
        assert read_back(ground) == sent

        ground.send(mavlink.MAVLink_mission_clear_all_message(1, 1, FENCE))
        assert read_back(ground) == []


def test_an_upload_that_is_no_fence_leaves_the_old_one() -> None:
    ground = fenced_copter((OUTSIDE, VILLAGE))
    before = read_back(ground)

    assert upload(ground, corners((OUTSIDE, VILLAGE[:2]))) == mavlink.MAV_MISSION_ERROR
    assert "Invalid vertex count (2)" in ground.texts()
    assert upload(ground, [corner(0, 16, 1.0, 0.0, 0.0)]) == mavlink.MAV_MISSION_UNSUPPORTED
    assert read_back(ground) == before


def test_an_upload_cut_in_the_middle_leaves_the_old_one() -> None:
    ground = fenced_copter((OUTSIDE, VILLAGE))
    before = read_back(ground)
    items = corners((INSIDE, FIELD))
    ground.send(mavlink.MAVLink_mission_count_message(1, 1, len(items), FENCE))
    ground.send(items[0])
    said = ground.wait(10.0)

    [ack] = only(said, "MISSION_ACK")
    assert (ack.type, ack.mission_type) == (mavlink.MAV_MISSION_OPERATION_CANCELLED, FENCE)
    assert "Fence upload timeout" in ground.texts()
    assert read_back(ground) == before


def test_a_fence_does_not_take_the_place_of_the_mission() -> None:
    ground = ground_station()
    ground.wait(5.0)
    assert ground.upload(ground.item(0), ground.item(1, 5.0, 5.0)) == ACCEPTED
    assert upload(ground, corners((OUTSIDE, VILLAGE))) == ACCEPTED

    answer = ground.send(mavlink.MAVLink_mission_request_list_message(1, 1))
    assert the(answer, "MISSION_COUNT").count == 2
    assert len(read_back(ground)) == 4


def test_arducopter_refuses_targets_beyond_and_returns_where_it_breaks_the_fence() -> None:
    ground = fenced_copter((INSIDE, FIELD), (OUTSIDE, VILLAGE))
    ground.take_off(10.0)
    assert ground.reposition(0.0, 50.0, 10.0) == FAILED
    assert ground.reposition(0.0, 250.0, 10.0) == FAILED
    assert ground.reposition(0.0, 80.0, 10.0) == ACCEPTED  # the way there is nobody's concern
    ground.wait(3.5)
    assert "Polygon fence breached" not in ground.texts()
    ground.wait(1.0)

    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == RTL
    [status] = only(ground.heard, "FENCE_STATUS")
    assert (status.breach_status, status.breach_type) == (1, mavlink.FENCE_BREACH_BOUNDARY)
    assert ground.texts()[-2:] == ["Polygon fence breached", "Manual recovery started"]
    ground.wait(5.0)
    assert ground.texts()[-1] == "Fence breach cleared"


def test_arducopter_that_stands_in_a_zone_is_not_armed() -> None:
    ground = fenced_copter((OUTSIDE, VILLAGE))
    assert upload(ground, corners((OUTSIDE, HERE))) == ACCEPTED
    ground.set_mode(GUIDED)

    assert ground.arm() == FAILED
    assert ground.texts()[-1] == "Arm: Vehicle breaching Polygon fence"


def test_a_fence_that_is_off_is_heeded_by_nobody() -> None:
    ground = fenced_copter((OUTSIDE, VILLAGE))
    set_parameter(ground, b"FENCE_ENABLE", 0.0)
    ground.take_off(10.0)
    assert ground.reposition(0.0, 50.0, 10.0) == ACCEPTED
    ground.wait(10.0)

    assert only(ground.heard, "HEARTBEAT")[-1].custom_mode == GUIDED


def test_arducopter_is_switched_on_and_off_by_command() -> None:
    ground = ground_station()
    ground.wait(5.0)
    switch = (mavlink.MAV_CMD_DO_FENCE_ENABLE, 1, 4, 0, 0, 0, 0, 0)
    assert ground.command(*switch) == mavlink.MAV_RESULT_FAILED  # there is none

    assert upload(ground, corners((OUTSIDE, HERE))) == ACCEPTED
    assert ground.arm() == ACCEPTED
    ground.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 0, 0, 0, 0, 0, 0)
    assert ground.command(*switch) == ACCEPTED
    assert ground.arm() != ACCEPTED
    assert ground.command(*switch[:1], 0, *switch[2:]) == ACCEPTED
    assert ground.arm() == ACCEPTED


def test_px4_knows_no_switch_of_its_fence() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    switched = ground.command(mavlink.MAV_CMD_DO_FENCE_ENABLE, 1, 4, 0, 0, 0, 0, 0)
    assert switched == mavlink.MAV_RESULT_UNSUPPORTED


def test_px4_ignores_targets_beyond_and_holds_where_it_breaks_the_fence() -> None:
    ground = flying_px4((INSIDE, FIELD), (OUTSIDE, VILLAGE))
    fly_px4(ground, 50.0)
    assert ground.texts()[-1] == "Reposition is outside geofence\t"
    fly_px4(ground, 80.0)
    ground.wait(10.0)

    assert ground.position_enu_m[1] == pytest.approx(40.5, abs=0.6)
    assert ground.texts()[-2:] == [
        "Geofence: approaching or outside geofence",
        "Failsafe activated\t",
    ]
    told = only(ground.heard, "HEARTBEAT")[-1]
    assert told.system_status == mavlink.MAV_STATE_CRITICAL
    ground.set_mode(4, 6)
    ground.wait(1.1)
    assert only(ground.heard, "HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE


def test_a_fence_put_over_a_place_that_is_passed_concerns_nobody() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    ground.set_mode(*HOLD)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(12.0)
    fly_px4(ground, 50.0)
    ground.wait(15.0)
    fly_px4(ground, 150.0)
    ground.wait(5.0)
    assert ground.position_enu_m[1] > 65.0
    assert upload(ground, corners((OUTSIDE, VILLAGE))) == ACCEPTED
    ground.wait(15.0)

    assert ground.position_enu_m[1] == pytest.approx(150.0, abs=0.5)
    assert "Failsafe activated\t" not in ground.texts()


def test_px4_takes_a_fence_around_its_home_for_none() -> None:
    ground = flying_px4((OUTSIDE, HERE))

    assert "Geofence invalid, doesn't contain Home position\t" in ground.texts()
    assert ground.position_enu_m[2] == pytest.approx(10.0, abs=0.5)
    assert only(ground.heard, "HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE


@pytest.mark.parametrize(
    ("areas", "any_allows", "all_allow"),
    [
        ([(INSIDE, FIELD), (INSIDE, VILLAGE)], True, False),
        ([(INSIDE, VILLAGE)], False, False),
        ([(INSIDE, FIELD), (OUTSIDE, HERE)], False, False),
        ([(OUTSIDE, VILLAGE)], True, True),
    ],
)
def test_areas_add_up_as_the_firmware_has_it(
    areas: list[tuple[int, list[tuple[float, float]]]], any_allows: bool, all_allow: bool
) -> None:
    items = tuple(
        StoredMissionItem(0, item.command, (item.param1, 0.0, 0.0, 0.0), item.x, item.y, 0.0)
        for item in corners(*areas)
    )
    fence = fence_of(items, DEFAULT_ORIGIN)

    assert fence.allows((0.0, 0.0), any_inclusion=True) is any_allows
    assert fence.allows((0.0, 0.0), any_inclusion=False) is all_allow


def test_circles_are_areas_too() -> None:
    circle = int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION)
    lat_deg, lon_deg, _ = wgs84_from_enu(DEFAULT_ORIGIN, (30.0, 0.0, 0.0))
    place = round(lat_deg * 1e7), round(lon_deg * 1e7), 0.0
    fence = fence_of((StoredMissionItem(0, circle, (10.0, 0.0, 0.0, 0.0), *place),), DEFAULT_ORIGIN)

    assert fence.allows((19.0, 0.0), any_inclusion=True)
    assert not fence.allows((21.0, 0.0), any_inclusion=True)
    with pytest.raises(FenceError, match="radius"):
        fence_of((StoredMissionItem(0, circle, (0.0, 0.0, 0.0, 0.0), *place),), DEFAULT_ORIGIN)
