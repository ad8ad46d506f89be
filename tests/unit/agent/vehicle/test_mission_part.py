"""Mode and item are told by different messages: a mode in which items are flown waits for one."""

from __future__ import annotations

from agent.vehicle.firmware.arduplane import ArduPlane
from agent.vehicle.firmware.quadplane import QuadPlane
from agent.vehicle.messages import Heartbeat, MissionCurrent
from agent.vehicle.mission_part import MissionPart

PLANE = ArduPlane()
AUTO, RTL, GUIDED = 10, 11, 15
SEARCHED = 5
"""Heartbeats that may come before the item."""


def told(part: MissionPart, custom_mode: int) -> str:
    heartbeat = Heartbeat(3, 1, armed=True, custom_mode=custom_mode, system_status=4)
    return PLANE.mode_name(part.read(heartbeat, PLANE).custom_mode)


def test_auto_counts_once_its_item_is_told() -> None:
    part = MissionPart()
    part.on_message(MissionCurrent(2, 6))  # before it was in AUTO
    assert told(part, RTL) == "RTL"
    assert told(part, AUTO) == "RTL"
    part.on_message(MissionCurrent(4, 6))
    assert told(part, AUTO) == "AUTO (landing)"
    part.on_message(MissionCurrent(2, 6))
    assert told(part, AUTO) == "AUTO (after its take-off)"


def test_an_item_of_an_earlier_time_in_auto_does_not_count() -> None:
    part = MissionPart()
    told(part, AUTO)
    part.on_message(MissionCurrent(1, 6))
    assert told(part, AUTO) == "AUTO (taking off)"
    assert told(part, GUIDED) == "GUIDED"
    assert told(part, AUTO) == "GUIDED"


def test_a_vehicle_that_tells_no_item_is_somebody_elses_soon() -> None:
    part = MissionPart()
    assert told(part, GUIDED) == "GUIDED"
    assert [told(part, AUTO) for _ in range(SEARCHED)] == ["GUIDED"] * SEARCHED
    heartbeat = Heartbeat(3, 1, armed=True, custom_mode=AUTO, system_status=4)
    mode = part.read(heartbeat, PLANE).custom_mode
    assert not PLANE.is_taking_off(mode)
    assert not PLANE.is_returning(mode)
    assert PLANE.is_mission(mode)


def test_one_that_is_met_in_auto_may_be_taking_off_for_us() -> None:
    part = MissionPart()
    heartbeat = Heartbeat(3, 1, armed=True, custom_mode=AUTO, system_status=4)
    mode = part.read(heartbeat, PLANE).custom_mode
    assert PLANE.is_taking_off(mode)
    assert not PLANE.has_taken_off(mode)


def test_of_other_vehicles_nothing_is_changed() -> None:
    part = MissionPart()
    for firmware in (None, QuadPlane()):
        heartbeat = Heartbeat(3, 22, armed=True, custom_mode=AUTO | 1 << 24, system_status=4)
        assert part.read(heartbeat, firmware) == heartbeat
