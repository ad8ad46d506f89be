"""The trigger of a camera, by command and as an item of a mission, as each firmware takes it."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

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
