"""A mission of the field in a terminal: zones and bases on the map, visits, charge and orders."""

from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.presentation import UNICODE
from coordinator.mission_view.scene import scene_of
from coordinator.terminal.live_view import live_picture
from coordinator.terminal.status_table import status_as_json, status_table
from swarm.model import Area, AreaId, Base, BaseId, Mission, TaskId, Zone, ZoneId
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.model.plan import LeftOut, Plan
from swarm.protocol.field_messages import ZoneEdit, ZoneSpec
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimPhase, StatusPhase
from swarm.separation.straight_pieces import still_ahead
from tests.support import field_registers
from tests.support.builders import brief_of, entries_of, epoch, mission, task, uav
from tests.support.observed_mission import Teller

POND = Zone(ZoneId("pond"), ((40.0, 20.0), (60.0, 20.0), (60.0, 60.0), (40.0, 60.0)))
BARN = Base(BaseId("barn"), (0.0, 40.0, 0.0), swap_s=30.0, slots=1)
SIZE = (120, 34)


def pasture() -> Mission:
    flown = mission(
        [replace(uav("u0"), endurance_s=100.0), replace(uav("u1", 20.0), endurance_s=100.0)],
        [task("t0", 100.0), replace(task("t1", 100.0), position_enu_m=(100.0, 80.0, 0.0))],
    )
    return replace(flown, bases=(BARN,), zones=(POND,))


def visiting(stage: BaseStage, phase: ClaimPhase = ClaimPhase.HELD, **more: object) -> Claim:
    claim = Claim(phase, None, 5.0, 0, 40.0, base="barn", stage=stage)
    return replace(claim, **more)  # type: ignore[arg-type]


@pytest.fixture
def teller() -> Teller:
    """Both fly, in a mission that has begun."""
    flown = pasture()
    told = Teller(flown)
    told.say(COORDINATOR, brief_of(flown))
    for entry in entries_of(flown):
        told.say(COORDINATOR, entry)
    told.begin()
    for each in flown.uavs:
        told.status(each.id, StatusPhase.FLYING, 0.5)
    return told


def picture(mission_state: MissionState, now_s: float = 1.0) -> str:
    console = Console(file=io.StringIO(), width=SIZE[0], color_system=None)
    with console.capture() as captured:
        console.print(live_picture(mission_state, now_s, width=SIZE[0], height=SIZE[1]))
        console.print(status_table(scene_of(mission_state, now_s), SIZE[0], UNICODE))
    return captured.get()


def test_zones_and_bases_are_on_the_map_and_in_the_status(teller: Teller) -> None:
    text = picture(teller.mission_state)

    assert "⌂barn" in text
    assert any("⢸" in line or "⡇" in line for line in text.splitlines())  # the pond's border
    assert "bases        barn (1 slot)" in text
    assert "zones        pond" in text


def test_borders_of_areas_are_on_the_map() -> None:
    corners = ((5.0, 5.0), (35.0, 5.0), (35.0, 75.0), (5.0, 75.0))
    flown = replace(pasture(), zones=())
    covered = replace(flown, areas=(Area(AreaId("field"), corners, 1.0, spacing_m=10.0),))

    drawn = [dots(picture(Teller(each).mission_state)) for each in (flown, covered)]

    assert drawn[0] == 0
    assert drawn[1] > 50


def dots(text: str) -> int:
    """Cells of the map that lines go through."""
    return sum("\u2800" < sign <= "\u28ff" for sign in text)


def test_ways_lead_round_zones_by_bases_and_home(teller: Teller) -> None:
    teller.say(COORDINATOR, field_registers.brief_of(pasture()))
    lists = {"u0": ("t1", "t0"), "u1": ()}
    said = replace(epoch("u0", "u1", number=2, rule="guided"), routes=lists)
    teller.say(COORDINATOR, said)
    teller.say("u0", Claim(ClaimPhase.HELD, "t1", 0.0, 0, 14.0))

    view = scene_of(teller.mission_state, 1.0).uavs[0]

    assert view.ways is not None
    assert view.ways.flown == ()
    assert view.ways.leg[0] == (0.0, 0.0)
    assert view.ways.leg[-1] == view.ways.ahead[0] == (100.0, 80.0)
    assert set(view.ways.leg[1:-1]) <= set(POND.polygon_enu_m)
    assert len(view.ways.leg) > 2, "not through the pond"
    assert view.ways.ahead[-1] in (BARN.position_enu_m[:2], (0.0, 0.0))


def test_of_a_leg_only_what_is_still_ahead_is_left() -> None:
    leg = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0))

    assert still_ahead(leg, (4.0, 1.0)) == ((4.0, 1.0), (10.0, 0.0), (10.0, 10.0))
    assert still_ahead(leg, (10.0, 4.0)) == ((10.0, 4.0), (10.0, 10.0))
    assert still_ahead((), (1.0, 2.0)) == ((1.0, 2.0),)


@pytest.mark.parametrize(
    ("claim", "word"),
    [
        (visiting(BaseStage.APPROACHING, sortie_end_s=21.0), "to base"),
        (visiting(BaseStage.WAITING, sortie_end_s=21.0), "waiting"),
        (visiting(BaseStage.LANDED), "swapping"),
        (visiting(BaseStage.LANDED, ClaimPhase.IDLE), "at base"),
        (visiting(BaseStage.PARKED, ClaimPhase.IDLE), "parked"),
    ],
)
def test_a_visit_to_a_base_is_told_in_a_word_with_what_is_left_of_the_sortie(
    teller: Teller, claim: Claim, word: str
) -> None:
    teller.say("u0", claim)

    row = next(line for line in picture(teller.mission_state).splitlines() if "▲ u0" in line)
    told = status_as_json(scene_of(teller.mission_state, 1.0))["uavs"][0]

    assert word in row
    assert "barn" in row
    assert (told["base"], told["stage"]) == ("barn", claim.stage)
    assert (told["sortie_left_s"] is not None) == (claim.sortie_end_s is not None)


def test_a_battery_that_was_changed_is_counted(teller: Teller) -> None:
    teller.say("u0", visiting(BaseStage.APPROACHING))
    teller.say("u0", visiting(BaseStage.LANDED, arrives_s=10.0))

    told = status_as_json(scene_of(teller.mission_state, 1.0))["uavs"]

    assert [row["swaps"] for row in told] == [1, 0]


def test_zones_that_the_operator_draws_stand_among_his_orders_and_on_the_map(
    teller: Teller,
) -> None:
    brief = teller.mission_state.replica.brief
    assert brief is not None
    field = Zone(ZoneId("crowd"), ((70.0, 0.0), (90.0, 0.0), (80.0, 30.0)))
    for zone, withdrawn in ((field, False), (POND, True)):
        edit = ZoneEdit(ZoneSpec.of(zone), withdrawn, brief.run, "fair")
        teller.say(OPERATOR, edit)

    text = picture(teller.mission_state)
    told = status_as_json(scene_of(teller.mission_state, 1.0))

    assert "orders zone crowd drawn by the operator: fair" in text
    assert "operator     zone pond taken away by the operator: fair" in text
    assert told["zones"] == ["crowd"]
    assert told["zone_edits"]["pond"] == {"withdrawn": True, "reason": "fair"}


def test_what_the_plan_leaves_out_is_told_with_the_reason(teller: Teller) -> None:
    teller.say(COORDINATOR, epoch("u0", "u1", number=2, left_out={"energy": ("t1",)}))

    text = picture(teller.mission_state)
    told = status_as_json(scene_of(teller.mission_state, 1.0))

    assert "left out     t1 (energy)" in text
    assert "○ 1 open  ◌ 1 left out" in text
    assert "◌t1" in text
    assert told["left_out"] == {"t1": "energy"}
    assert told["tasks"]["open"] == 2


def test_who_has_the_plan_shows_what_it_leaves_out_before_the_mission_begins() -> None:
    flown = pasture()
    teller = Teller(flown)
    left = {TaskId("t1"): LeftOut.ENERGY}
    plan = Plan("test", "greedy", {}, 0.0, {}, None, None, 1, 0.0, 0, schedule={}, left_out=left)
    teller.mission_state.take_plan(plan)

    assert "left out     t1 (energy)" in picture(teller.mission_state)

    teller.begin()  # what the epoch says counts from here on

    assert "left out" not in picture(teller.mission_state)
