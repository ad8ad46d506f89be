"""Where a UAV may make room follows from the zones that are in force at that moment."""

from __future__ import annotations

from dataclasses import replace

from agent.core.room_aside import RoomAside
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.field_messages import ZoneEdit, ZoneSpec
from swarm.protocol.messages import Message, MissionConfig, Stamp
from swarm.protocol.registers import Replica
from tests.support.builders import MISSION, brief, uav

RING = ((20.0, -40.0), (30.0, -40.0), (30.0, 30.0), (20.0, 30.0))
WALL = ZoneSpec("wall", RING, (), None, None, inclusive=False)
THROUGH = ((0.0, 0.0, 30.0), (50.0, 0.0, 30.0))
BESIDE = ((0.0, 0.0, 30.0), (0.0, 50.0, 30.0))


def told(zones: tuple[ZoneSpec, ...] = (), margin_m: float = 5.0) -> Replica:
    replica = Replica()
    known: MissionConfig = replace(brief(uav("u0")), zones=zones, zone_margin_m=margin_m)
    replica.join(Message(MISSION, COORDINATOR, Stamp(1, 1), known))
    return replica


def draw(replica: Replica, zone: ZoneSpec, number: int, *, withdrawn: bool = False) -> None:
    edit = ZoneEdit(zone, withdrawn, 1, "")
    replica.join(Message(MISSION, OPERATOR, Stamp(1, number), edit))


def test_no_zone_is_flown_through_to_make_room() -> None:
    room = RoomAside(told((WALL,)))

    assert not room.is_clear(THROUGH)
    assert not room.is_clear((THROUGH[0], (17.0, 0.0, 30.0))), "within the margin"
    assert room.is_clear((THROUGH[0], (15.5, 0.0, 30.0))), "it hovers on a way along the margin"
    assert room.is_clear(BESIDE)


def test_a_zone_counts_from_when_it_is_drawn_until_it_is_removed() -> None:
    replica = told()
    room = RoomAside(replica)
    assert room.is_clear(THROUGH)

    draw(replica, WALL, 1)
    assert not room.is_clear(THROUGH)

    draw(replica, WALL, 2, withdrawn=True)
    assert room.is_clear(THROUGH)


def test_one_flies_above_a_zone_that_ends_below() -> None:
    room = RoomAside(told((replace(WALL, ceiling_m=20.0),)))

    assert room.is_clear(THROUGH)
    assert not room.is_clear(tuple((east, north, 10.0) for east, north, _ in THROUGH))
