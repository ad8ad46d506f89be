"""Targets as missions, and missions known again."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.vehicle.codec import MavlinkCodec
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.profile import Firmware
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.messages import MissionItem
from agent.vehicle.mission_plan import MissionPlan, recognise_plan

PLAN = MissionPlan(47.4, 8.5, 500.0, 4.0, 67)
GIVING_WAY = replace(PLAN, guided_s=33)
FLAVOURS = pytest.mark.parametrize("flavour", [ArduCopter(), Px4Copter()])


def over_the_wire(items: tuple[MissionItem, ...]) -> list[MissionItem]:
    ours, theirs = MavlinkCodec(1, source_component_id=1), MavlinkCodec(255, source_system_id=1)
    data = b"".join(theirs.encode(item) for item in items)
    told = [heard.message for heard in ours.decode(data)]
    return [item for item in told if isinstance(item, MissionItem)]


@FLAVOURS
@pytest.mark.parametrize("plan", [PLAN, GIVING_WAY], ids=["as it was", "giving way"])
def test_mission_is_known_again_after_a_journey_over_the_wire(
    flavour: Firmware, plan: MissionPlan
) -> None:
    known = recognise_plan(over_the_wire(plan.items(flavour)), flavour)
    assert known is not None
    assert known == replace(plan, lat_deg=known.lat_deg, lon_deg=known.lon_deg)
    assert (known.lat_deg, known.lon_deg) == pytest.approx((47.4, 8.5), abs=1e-7)


@FLAVOURS
def test_items_are_numbered_and_begin_with_the_vehicles_own(flavour: Firmware) -> None:
    items = PLAN.items(flavour)
    assert [item.seq for item in items] == list(range(flavour.mission_vehicle_items + 3))
    assert [item.command for item in items[-3:]] == [178, 16, 20]
    assert [item.seq for item in items if item.current] == [flavour.mission_vehicle_items]


def test_the_time_for_targets_is_limited_before_it_begins() -> None:
    items, seqs = GIVING_WAY.items(ArduCopter()), GIVING_WAY.seqs(ArduCopter())
    assert [item.command for item in items] == [16, 178, 222, 92, 16, 20]
    assert [item.seq for item in items] == list(range(seqs.count))
    assert (seqs.speed, seqs.guided, seqs.target, seqs.home) == (1, 3, 4, 5)
    assert (items[2].params[0], items[3].params[0]) == (33.0, 1.0)
    assert PLAN.seqs(ArduCopter()).guided is None


def test_missions_that_give_way_for_ever_are_not_ours() -> None:
    items = list(GIVING_WAY.items(ArduCopter()))
    for place, params in ((2, (0.0,) * 4), (2, (math.nan, 0.0, 0.0, 0.0)), (3, (0.0,) * 4)):
        other = [*items]
        other[place] = replace(items[place], params=params)
        assert recognise_plan(other, ArduCopter()) is None


def test_only_firmwares_that_may_be_told_are_told_nothing_of_the_heading() -> None:
    assert ArduCopter().waypoint_params(60.0) == (60.0, 0.0, 0.0, 0.0)
    hold_s, radius_m, _, heading = Px4Copter().waypoint_params(60.0)
    assert (hold_s, radius_m) == (60.0, 2.0)
    assert math.isnan(heading)


@FLAVOURS
def test_other_missions_are_not_ours(flavour: Firmware) -> None:
    items = PLAN.items(flavour)
    *own, speed, target, home = items
    for other in (
        [],
        items[:-1],
        [*items, home],
        [*own, speed, target, target],
        [*own, target, speed, home],
        [*own, speed, replace(target, params=(0.0, 0.0, 0.0, 0.0)), home],
        [*own, speed, replace(target, params=(math.nan, 0.0, 0.0, 0.0)), home],
        [*own, replace(speed, params=(1.0, 4.0, 50.0, 0.0)), target, home],
    ):
        assert recognise_plan(other, flavour) is None
