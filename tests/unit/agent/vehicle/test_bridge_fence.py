"""Zones put on the vehicle as its own fence, read back, switched on, and taken off again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Home,
    KeepOut,
    Landed,
    Prepare,
    Ready,
    Return,
    Swap,
    Swapped,
    VehicleReady,
)
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.fence_items import fence_areas
from swarm.model import Zone, ZoneId
from tests.support.bridge_flight import (
    BEHIND,
    ORIGIN,
    START,
    WALL,
    BridgeFlight,
    Spoil,
    rough_link,
    untouched,
)
from tests.support.fake_copter import SWITCH_FENCE, FakeCopter
from tests.support.fake_fences import EXCLUSION, FENCE, INCLUSION, Corner
from tests.support.fake_px4 import FakePx4

FIELD = Zone(
    ZoneId("field"),
    ((-200.0, -200.0), (200.0, -200.0), (200.0, 200.0), (-200.0, 200.0)),
    inclusive=True,
)
FAR = Zone(ZoneId("far"), ((-60.0, 60.0), (-50.0, 60.0), (-50.0, 70.0)))
AROUND = Zone(ZoneId("new"), ((0.0, -15.0), (15.0, -15.0), (15.0, 15.0), (0.0, 15.0)))
"""The start, in the air and on the ground."""


def flight_of(
    fake: type[FakeCopter],
    *zones: Zone,
    style: CommandStyle = CommandStyle.REPOSITION,
    link: Callable[[int], Spoil] = lambda _: untouched,
) -> BridgeFlight:
    """A flight that has not begun, with these zones from the beginning."""
    config = BridgeConfig(
        1, ORIGIN, command=style, zones=zones, zone_margin_m=3.0, position_rate_hz=10.0
    )
    return BridgeFlight(fake(ORIGIN), config, to_vehicle=link(0), to_bridge=link(1))


def corners_of(*zones: Zone) -> list[Corner]:
    return [
        (area.command, float(len(area.corners_e7)), lat_e7, lon_e7)
        for zone in zones
        for area in fence_areas(zone, ORIGIN)
        for lat_e7, lon_e7 in area.corners_e7
    ]


def fence_words(flight: BridgeFlight) -> list[Any]:
    """All that the vehicle heard of fences."""
    heard = flight.copter.heard
    return [m for m in heard if getattr(m, "mission_type", 0) == FENCE]


def is_heeded(flight: BridgeFlight) -> bool:
    return flight.copter.fence.is_on or isinstance(flight.copter, FakePx4)


def test_zones_stand_on_it_and_are_heeded_before_its_motors_start(
    fake: type[FakeCopter], style: CommandStyle
) -> None:
    flight = flight_of(fake, FIELD, WALL, style=style)
    flight.order(START)
    while not flight.copter.armed:
        flight.step()
    assert flight.copter.fence.items == corners_of(FIELD, WALL)
    assert flight.copter.fence.areas() == [(INCLUSION, 4), (EXCLUSION, 4)]
    assert is_heeded(flight)
    flight.run_until(VehicleReady())
    assert flight.cautions == []


def test_they_are_taken_off_when_it_has_landed(fake: type[FakeCopter], style: CommandStyle) -> None:
    flight = flight_of(fake, WALL, style=style).prepared()
    flight.order(Return("over"))
    flight.run(2.0)
    assert flight.copter.fence.items == corners_of(WALL)
    flight.run_until(Home())
    assert flight.copter.fence.items == []
    assert not flight.copter.fence.is_on
    heard = len(fence_words(flight))
    flight.run(10.0)
    assert len(fence_words(flight)) == heard


def test_without_zones_nothing_is_said_of_fences(
    fake: type[FakeCopter], style: CommandStyle
) -> None:
    flight = flight_of(fake, style=style).prepared()
    flight.order(GoTo(1, BEHIND))
    flight.run_until(Arrived(1))
    flight.order(Return("over"))
    flight.run_until(Home())
    asked = {m.param_id for m in flight.copter.heard if hasattr(m, "param_id")}
    assert not asked & flight.copter.fence_names
    assert not fence_words(flight)
    assert not flight.copter.commands(SWITCH_FENCE)


def test_a_zone_that_may_be_flown_over_is_none_of_it(fake: type[FakeCopter]) -> None:
    low = Zone(ZoneId("low"), WALL.polygon_enu_m, ceiling_m=8.0)
    flight = flight_of(fake, low).prepared()
    assert not fence_words(flight)
    assert flight.cautions == []


def test_a_zone_drawn_in_flight_is_added_and_one_that_is_gone_is_cleared_at_once(
    fake: type[FakeCopter], style: CommandStyle
) -> None:
    flight = flight_of(fake, WALL, style=style).prepared()
    flight.order(KeepOut((WALL, FAR), 3.0))
    flight.run(5.0)
    assert flight.copter.fence.items == corners_of(WALL, FAR)
    assert flight.copter.fence.replaced == [4, 7]  # never without, meanwhile

    flight.order(KeepOut((FAR,), 3.0))
    assert flight.copter.fence.replaced[:3] == [4, 7, 0]
    flight.order(GoTo(1, BEHIND))
    flight.run_until(Arrived(1))
    assert flight.copter.fence.items == corners_of(FAR)
    assert is_heeded(flight)

    flight.order(KeepOut((), 3.0))
    flight.run(5.0)
    assert flight.copter.fence.items == []
    assert not flight.copter.fence.is_on
    assert flight.cautions == []


def test_the_first_zone_of_all_may_be_drawn_in_flight(
    fake: type[FakeCopter], style: CommandStyle
) -> None:
    flight = flight_of(fake, style=style).flying()
    flight.order(KeepOut((FAR,), 3.0))
    flight.run(5.0)
    assert flight.copter.fence.items == corners_of(FAR)
    assert is_heeded(flight)


def test_a_zone_drawn_over_it_is_put_there_once_it_is_outside(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, WALL).prepared()
    flight.order(KeepOut((WALL, AROUND), 0.0))
    flight.run(10.0)
    assert flight.copter.fence.items == corners_of(WALL)

    flight.order(GoTo(1, (-20.0, 0.0, 10.0)))
    flight.run_until(Arrived(1))
    flight.run(3.0)
    assert flight.copter.fence.items == corners_of(WALL, AROUND)
    assert flight.cautions == []


def test_a_transfer_rests_while_something_else_keeps_it_on_the_ground(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, WALL)
    flight.copter.fence.mute = True
    flight.order(START)
    while not fence_words(flight):
        flight.step()
    flight.copter.prearm_ok = False
    for _ in range(200):
        flight.step()
        assert flight.bridge.next_deadline_s() > flight.now_s
    flight.copter.prearm_ok, flight.copter.fence.mute = True, False
    flight.run_until(VehicleReady(), limit_s=120.0)
    assert flight.copter.fence.items == corners_of(WALL)


@pytest.mark.parametrize("takes", [0, 1, 3])
def test_an_upload_cut_in_the_middle_leaves_the_old_fence_and_is_tried_again(
    fake: type[FakeCopter], takes: int
) -> None:
    flight = flight_of(fake, WALL).prepared()
    flight.copter.fence.takes = takes
    flight.order(KeepOut((WALL, FAR), 3.0))
    flight.run(15.0)
    assert flight.copter.fence.items in (corners_of(WALL), [])
    flight.copter.fence.takes = 1_000
    flight.run(75.0)
    assert flight.copter.fence.items == corners_of(WALL, FAR)
    assert is_heeded(flight)


def test_one_that_is_cut_every_time_is_flown_without_and_told(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, WALL)
    flight.copter.fence.takes = 2
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=180.0)
    assert flight.copter.fence.items == []
    assert not flight.copter.fence.is_on
    [caution] = flight.cautions
    assert "cannot be put on it as its fence" in caution
    assert "only its agent keeps it out of zones" in caution


def test_one_that_is_read_back_otherwise_is_cleared_and_never_switched_on(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, WALL)
    flight.copter.fence.garbles = True
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=180.0)
    assert flight.copter.fence.items == []
    assert not flight.copter.commands(SWITCH_FENCE)
    assert "item 0 differs" in flight.cautions[-1]


def test_firmware_without_fences_is_flown_all_the_same(
    fake: type[FakeCopter], style: CommandStyle
) -> None:
    flight = flight_of(fake, WALL, style=style)
    flight.copter.fence.supported = False
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=30.0)
    assert flight.cautions == ["its firmware takes no fence: only its agent keeps it out of zones"]
    flight.order(Return("over"))
    flight.run_until(Home())


def test_firmware_that_says_nothing_of_fences_is_flown_after_three_tries(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, WALL)
    flight.copter.fence.mute = True
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=60.0)
    assert "no answer while asking for the count" in flight.cautions[-1]


@pytest.mark.parametrize("kind", [EXCLUSION, 5003], ids=["polygon", "circle"])
def test_somebody_elses_fence_is_left_as_it_is(fake: type[FakeCopter], kind: int) -> None:
    flight = flight_of(fake, WALL)
    theirs = [(kind, number, x, y) for _, number, x, y in corners_of(FAR)]
    flight.copter.fence.items = list(theirs)
    flight.order(START)
    flight.run_until(VehicleReady())
    flight.order(KeepOut((WALL, AROUND), 0.0))
    flight.order(Return("over"))
    flight.run_until(Home())
    assert flight.copter.fence.items == theirs
    assert flight.copter.fence.replaced == []
    assert not flight.copter.commands(SWITCH_FENCE)
    assert flight.cautions == [
        (
            "it has a fence of its own (3 items), which is left as it is: "
            "only its agent keeps it out of zones"
        )
    ]


def test_a_new_life_knows_the_fence_of_the_one_before(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, FIELD, WALL).prepared()
    flight.restart()
    flight.order(Prepare(START.position_enu_m, START.speed_m_s, resume=True))
    flight.run_until(VehicleReady())
    flight.run(5.0)
    assert flight.copter.fence.replaced == [8]
    flight.order(KeepOut((FIELD,), 3.0))
    flight.run(5.0)
    assert flight.copter.fence.items == corners_of(FIELD)
    assert flight.cautions == []


def test_it_stands_on_a_vehicle_that_its_pilot_has_taken(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, WALL).flying(east_m=10.0)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run_until(HandedOver)
    heard = len(fence_words(flight))
    flight.order(KeepOut((), 3.0))
    flight.run(20.0)
    assert flight.copter.fence.items == corners_of(WALL)
    assert len(fence_words(flight)) == heard


def test_a_fence_that_its_pilot_has_changed_meanwhile_is_left_as_it_is(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, WALL).flying(east_m=10.0)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run_until(HandedOver)
    theirs = corners_of(WALL, AROUND)
    flight.copter.fence.items = list(theirs)
    flight.copter.set_mode(flight.copter.own_mode)
    flight.order(Prepare(START.position_enu_m, START.speed_m_s, resume=True))
    flight.run_until(VehicleReady())
    flight.order(KeepOut((FAR,), 3.0))
    flight.order(Return("over"))
    flight.run_until(Home())
    assert flight.copter.fence.items == theirs
    assert "a fence of its own (8 items)" in flight.cautions[-1]


def test_a_vehicle_that_is_taken_in_the_middle_of_an_upload_hears_no_more_of_it(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake, WALL).prepared()
    flight.copter.fence.takes = 1
    flight.order(KeepOut((WALL, FAR), 3.0))
    flight.run(0.5)
    flight.copter.set_mode(flight.copter.pilot_mode)
    flight.run_until(HandedOver)
    heard = len(fence_words(flight))
    flight.run(30.0)
    assert len(fence_words(flight)) == heard


def test_it_stands_on_it_while_it_flies_and_not_at_a_base(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, WALL).prepared()
    flight.copter.battery_percent = 95
    flight.order(Swap(1, (5.0, 0.0, 0.0)))
    flight.run_until(Landed(1))
    assert flight.copter.fence.items == []
    heard = len(fence_words(flight))
    flight.order(Ready(1))
    flight.run_until(Swapped(1))
    flight.run(10.0)
    assert len(fence_words(flight)) == heard
    flight.order(GoTo(2, (5.0, 30.0, 10.0)))
    flight.run_until(Arrived(2))
    assert flight.copter.fence.items == corners_of(WALL)
    assert is_heeded(flight)


def test_it_is_taken_off_a_vehicle_that_never_left_the_ground(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, WALL)
    flight.copter.verdicts[400] = [4] * 40
    flight.order(START)
    flight.run(12.0)
    assert flight.copter.fence.items == corners_of(WALL)
    flight.copter.verdicts.clear()
    flight.order(Return("over"))
    flight.run_until(Home())
    flight.run(2.0)
    assert flight.copter.fence.items == []


def test_an_operators_switch_is_left_alone() -> None:
    flight = flight_of(FakeCopter, WALL)
    flight.copter.parameters["FENCE_ENABLE"] = 1.0
    flight.order(START)
    flight.run_until(VehicleReady())
    flight.order(Return("over"))
    flight.run_until(Home())
    assert flight.copter.fence.replaced == [4, 0]
    assert not flight.copter.commands(SWITCH_FENCE)


def test_what_the_vehicle_says_of_its_fence_is_told() -> None:
    flight = flight_of(FakePx4, WALL).prepared()
    flight.copter.text(2, "Geofence invalid, doesn't contain Home position")
    flight.run(1.0)
    assert "doesn't contain Home position" in flight.cautions[-1]


@pytest.mark.parametrize("seed", [1, 3])
def test_a_rough_link_only_takes_longer(
    fake: type[FakeCopter], style: CommandStyle, seed: int
) -> None:
    flight = flight_of(fake, FIELD, WALL, style=style, link=lambda way: rough_link(seed + 10 * way))
    flight.order(START)
    flight.run_until(VehicleReady(), limit_s=240.0)
    flight.order(KeepOut((WALL, FAR), 3.0))
    flight.run(120.0)
    assert flight.copter.fence.items == corners_of(WALL, FAR)
    assert is_heeded(flight)
    flight.order(Return("over"))
    flight.run_until(Home(), limit_s=180.0)
