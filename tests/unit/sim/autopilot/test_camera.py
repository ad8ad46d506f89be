"""A camera's trigger and what it is kept on: by command and as items, in each flavour."""

from __future__ import annotations

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.firmware.px4 import Px4Model
from tests.support.ground_station import ACCEPTED, AUTO, FAILED, GroundStation, ground_station, only

TRIGGER = mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST


def fly_a_line(ground: GroundStation, first: int, height_m: float = 10.0) -> None:
    """From one place to another with the camera on, and a bit beyond."""
    items = [ground.item(0)] if first else []
    frame = mavlink.MAV_FRAME_MISSION
    on, off = (20.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    items += [
        ground.item(first, 0.0, 10.0, height_m),
        ground.item(first + 1, command=TRIGGER, params=on, frame=frame),
        ground.item(first + 2, 0.0, 60.0, height_m),
        ground.item(first + 3, command=TRIGGER, params=off, frame=frame),
        ground.item(first + 4, 0.0, 80.0, height_m),
    ]
    assert ground.upload(*items) == ACCEPTED
    ground.wait(3.0)


def test_arducopter_obeys_a_command() -> None:
    ground = ground_station()
    ground.take_off(10.0)

    assert ground.command(TRIGGER, 20.0, 0.0, 1.0) == ACCEPTED
    assert ground.command(TRIGGER, -1.0) == FAILED
    assert ground.command(TRIGGER, math.nan) == FAILED
    assert ground.vehicle.pilot.camera.distance_m == 20.0
    assert ground.command(TRIGGER, 0.0) == ACCEPTED
    assert ground.vehicle.pilot.camera.orders == [20.0, 0.0]


def test_px4_leaves_the_answer_to_the_camera() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    order = mavlink.MAVLink_command_long_message(1, 1, TRIGGER, 0, 20.0, 0, 1.0, 0, 0, 0, 0)

    assert only(ground.send(order), "COMMAND_ACK") == []
    assert ground.vehicle.pilot.camera.orders == [20.0]


def test_arducopter_turns_it_on_and_off_in_a_mission_and_tells_of_the_places_alone() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    fly_a_line(ground, 1)
    ground.set_mode(AUTO)
    ground.wait(20.0)

    assert ground.vehicle.pilot.camera.orders == [20.0, 0.0]
    assert [each.seq for each in only(ground.heard, "MISSION_ITEM_REACHED")] == [1, 3, 5]
    assert "Mission: 2 SetCamTrigDst" in ground.texts()


def test_px4_tells_the_camera_of_the_items_of_a_mission() -> None:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    ground.set_mode(4, 3)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(12.0)
    fly_a_line(ground, 0)
    ground.set_mode(4, 4)
    ground.wait(30.0)

    told = [each for each in only(ground.heard, "COMMAND_LONG") if each.command == TRIGGER]
    assert [(each.target_component, each.param1, each.param3) for each in told] == [
        (0, 20.0, 1.0),
        (0, 0.0, 0.0),
    ]
    assert ground.vehicle.pilot.camera.orders == [20.0, 0.0]


LOOK_AT = mavlink.MAV_CMD_DO_SET_ROI_LOCATION
LOOK_AHEAD = mavlink.MAV_CMD_DO_SET_ROI_NONE
EAST, NORTH, WEST = 90.0, 0.0, 270.0
FRAMES = (mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT)


def look_at(ground: GroundStation, east_m: float, north_m: float) -> int:
    """Ask for the camera to be kept on a place 10 m above home."""
    place_e7 = ground.place_e7(east_m, north_m)
    return ground.command_int(LOOK_AT, FRAMES[0], *place_e7, 10.0)


def heading_deg(ground: GroundStation) -> float:
    """As the vehicle tells it now, rounded."""
    order = mavlink.MAVLink_command_long_message(
        *(1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0),
        *(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, 0, 0, 0, 0, 0, 0),
    )
    (told,) = only(ground.send(order), "GLOBAL_POSITION_INT")
    return round(float(told.hdg) / 100.0) % 360


def test_arducopter_turns_its_nose_until_the_next_target() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    ground.reposition(0.0, 60.0, 10.0)
    assert look_at(ground, 40.0, 0.0) == ACCEPTED
    assert heading_deg(ground) == EAST
    ground.wait(30.0)
    assert heading_deg(ground) == round(180.0 - math.degrees(math.atan2(40.0, 60.0)))
    assert ground.command(LOOK_AHEAD) == ACCEPTED
    ground.reposition(-40.0, 60.0, 10.0)
    ground.wait(2.0)
    assert heading_deg(ground) == WEST
    look_at(ground, -20.0, 100.0)
    ground.reposition(60.0, 60.0, 10.0)
    ground.wait(4.0)

    assert heading_deg(ground) == EAST
    assert [each is None for each in ground.vehicle.pilot.camera.looks] == [False, True, False]


def test_arducopter_takes_no_place_for_nowhere_and_none_off_the_globe_for_a_place() -> None:
    ground = ground_station()
    ground.take_off(10.0)
    assert look_at(ground, 40.0, 0.0) == ACCEPTED
    assert ground.command_int(LOOK_AT, 0, 950_000_000, 0, 10.0) == FAILED
    assert ground.vehicle.pilot.camera.looks_at_enu_m is not None
    assert ground.command_int(LOOK_AT, 0, 0, 0, 0.0) == ACCEPTED
    assert ground.vehicle.pilot.camera.looks_at_enu_m is None


def px4_in_the_air() -> GroundStation:
    ground = ground_station(Px4Model())
    ground.wait(5.0)
    ground.set_mode(4, 3)
    ground.arm()
    ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 498.0)
    ground.wait(12.0)
    return ground


def fly_to(ground: GroundStation, east_m: float, north_m: float, yaw_rad: float) -> None:
    """By a target with a heading."""
    assert (
        ground.command_int(
            *(mavlink.MAV_CMD_DO_REPOSITION, mavlink.MAV_FRAME_GLOBAL),
            *ground.place_e7(east_m, north_m),
            *(498.0, -1.0, 1.0, 0.0, yaw_rad),
        )
        == ACCEPTED
    )


def test_px4_takes_its_heading_from_the_target_whatever_it_is_to_look_at() -> None:
    ground = px4_in_the_air()
    assert look_at(ground, 40.0, 0.0) == ACCEPTED
    fly_to(ground, 0.0, 60.0, math.nan)
    ground.wait(5.0)
    assert heading_deg(ground) == NORTH
    fly_to(ground, 0.0, 60.0, math.radians(-90.0))
    assert heading_deg(ground) == WEST
    fly_to(ground, 0.0, 80.0, math.nan)
    ground.wait(1.0)
    assert heading_deg(ground) == NORTH


@pytest.mark.parametrize("flavour", [ArduCopterModel, Px4Model])
def test_in_missions_both_turn_their_noses_from_item_to_item_and_by_command(
    flavour: type[FirmwareModel],
) -> None:
    ground = ground_station() if flavour is ArduCopterModel else px4_in_the_air()
    first = int(flavour is ArduCopterModel)
    if first:
        ground.take_off(10.0)
    items = [ground.item(0)] if first else []
    items += [
        ground.item(first, 0.0, 20.0, 10.0),
        ground.item(first + 1, 40.0, 60.0, 10.0, command=LOOK_AT),
        ground.item(first + 2, 0.0, 60.0, 10.0, params=(30.0, 0.0, 0.0, 0.0)),
        ground.item(first + 3, command=LOOK_AHEAD, frame=mavlink.MAV_FRAME_MISSION),
        ground.item(first + 4, 0.0, 400.0, 10.0),
    ]
    assert ground.upload(*items) == ACCEPTED
    ground.wait(3.0)
    ground.heard.clear()
    ground.set_mode(*((AUTO,) if first else (4, 4)))
    ground.wait(25.0)
    assert heading_deg(ground) == EAST
    assert look_at(ground, -40.0, 60.0) == ACCEPTED
    assert heading_deg(ground) == WEST
    ground.wait(25.0)

    assert heading_deg(ground) == NORTH
    assert [each is None for each in ground.vehicle.pilot.camera.looks] == [False, False, True]
    told = [each for each in only(ground.heard, "COMMAND_LONG") if each.command in LOOKING]
    if first:
        assert told == []
        assert "Mission: 2 SetROILocation" in ground.texts()
        reached = [each.seq for each in only(ground.heard, "MISSION_ITEM_REACHED")]
        assert reached == [1, 2, 3, 4]
    else:
        lat_e7, lon_e7 = ground.place_e7(40.0, 60.0)
        assert [each.command for each in told] == [LOOK_AT, LOOK_AHEAD]
        place = (told[0].param5, told[0].param6, told[0].param7)
        assert place == pytest.approx((lat_e7 / 1e7, lon_e7 / 1e7, 498.0), rel=1e-6)


LOOKING = {LOOK_AT, LOOK_AHEAD}


@pytest.mark.parametrize("flavour", [ArduCopterModel, Px4Model])
def test_what_the_last_mission_looked_at_is_forgotten(flavour: type[FirmwareModel]) -> None:
    ground = ground_station(flavour())
    ground.take_off(10.0) if flavour is ArduCopterModel else ground.wait(5.0)
    look_at(ground, 40.0, 0.0)
    assert ground.upload(ground.item(0), ground.item(1, 0.0, 50.0)) == ACCEPTED
    ground.wait(3.0)
    ground.set_mode(*((AUTO,) if flavour is ArduCopterModel else (4, 4)))

    assert ground.vehicle.pilot.camera.looks_at_enu_m is None
