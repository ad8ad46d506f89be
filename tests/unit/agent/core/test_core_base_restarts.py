"""A visit to a base that is broken off from outside: held, ended, or by an agent started again."""

from __future__ import annotations

import pytest

from agent.core.interface import Prepare, Refused, Return, Swap
from agent.core.states import AgentState
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind, MissionPhase
from swarm.protocol.uav_messages import BaseStage, ClaimPhase
from tests.support.base_visitor import ABOVE_BASE, beside_slots, on_its_way, swapping
from tests.support.builders import entry, epoch
from tests.support.field_agent import (
    BUDGET_S,
    FieldAgent,
    Script,
    visiting,
)
from tests.support.lone_agent import ABOVE_START, finishes, orders

# -- stopped and sent home -------------------------------------------------------------


@pytest.mark.parametrize("above", [False, True])
def test_held_in_the_air_it_gives_the_base_up_and_decides_anew_afterwards(
    script: Script, above: bool
) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(20.0)
    if above:
        agent.arrive(50.0)

    agent.told(CommandKind.HOLD, 51.0)

    claim = agent.claim
    assert claim is not None
    assert (claim.phase, claim.base, claim.sortie_end_s) == (ClaimPhase.PAUSED, None, BUDGET_S)
    agent.told(CommandKind.RESUME, 60.0)
    assert agent.state() is AgentState.PREPARING


def test_held_at_a_base_it_stays_there_and_goes_on_from_there(script: Script) -> None:
    agent = swapping(script)

    agent.told(CommandKind.HOLD, 55.0)

    claim = agent.claim
    assert claim is not None
    assert (claim.phase, claim.base, claim.stage) == (ClaimPhase.PAUSED, "b0", BaseStage.LANDED)
    agent.told(CommandKind.RESUME, 60.0)
    assert agent.state() is AgentState.SWAPPING
    assert isinstance(agent.last_order, Swap)
    agent.get_full(80.0)
    assert agent.state() is AgentState.READY_ON_GROUND


def test_held_beside_the_slots_it_waits_for_one_again_afterwards(script: Script) -> None:
    agent = beside_slots(script)

    agent.told(CommandKind.HOLD, BUDGET_S + 5.0)
    agent.hear("u1", visiting(BaseStage.PARKED, 5.0), BUDGET_S + 6.0)
    assert agent.state() is AgentState.PAUSED
    agent.told(CommandKind.RESUME, BUDGET_S + 10.0)

    assert agent.state() is AgentState.BESIDE_SLOTS
    agent.run_until(BUDGET_S + 12.0)
    assert agent.state() is AgentState.SWAPPING


def test_a_hold_long_enough_to_use_the_battery_up_ends_with_the_way_home(script: Script) -> None:
    agent = on_its_way(script)
    agent.be_at((20.0, 0.0, 10.0), None, 20.0)
    agent.told(CommandKind.HOLD, 20.0)

    # The own start is 20 m away, the base 30 m.
    agent.run_until(BUDGET_S - 20.0 - agent.timing.patience_s - 0.1)
    assert agent.state() is AgentState.PAUSED
    agent.run_until(BUDGET_S - 20.0)

    assert agent.state() is AgentState.RETURNING_VIA_START
    assert agent.way_home.via_enu_m == ABOVE_START
    assert agent.way_home.land, "its own way may lead to a base that it took off from"


def test_at_the_end_of_the_mission_who_stands_at_a_base_is_home(script: Script) -> None:
    agent = swapping(script)

    agent.hear("coordinator", epoch("u0", phase=MissionPhase.ENDED, reason="over", number=2), 60.0)

    assert agent.way_home == Return("over", False, ABOVE_BASE, land=True)
    claim = agent.claim
    assert claim is not None
    assert (claim.phase, claim.stage) == (ClaimPhase.OUT, BaseStage.PARKED)
    assert finishes(agent.log) == []


# -- started again -----------------------------------------------------------------------


def test_started_again_on_its_way_it_flies_on_to_the_base(script: Script) -> None:
    agent = on_its_way(script)
    agent.run_until(10.0)
    life = agent.next_life()
    assert life.state() is AgentState.PREPARING
    life.be_at((12.0, 0.0, 10.0), None)

    life.happen_ready()

    assert life.state() is AgentState.FLYING_TO_BASE
    assert life.flight.position_enu_m == ABOVE_BASE
    claim = life.claim
    assert claim is not None
    assert (claim.phase, claim.base, claim.stage) == (ClaimPhase.HELD, "b0", BaseStage.APPROACHING)
    assert claim.sortie_end_s == BUDGET_S


def test_started_again_while_it_waits_it_keeps_its_place(script: Script) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.run_until(60.0)
    life = agent.next_life()
    life.see("u1")
    life.hear("u1", visiting(BaseStage.LANDED, 5.0))
    life.be_at(ABOVE_BASE, None)
    life.happen_ready()

    life.arrive(63.0)

    assert (life.state(), life.stage) == (AgentState.ABOVE_BASE, BaseStage.WAITING)
    assert life.claim is not None
    assert life.claim.arrives_s == 50.0
    life.hear("u1", visiting(BaseStage.PARKED, 5.0), 70.0)
    assert life.state() is AgentState.SWAPPING


def test_started_again_beside_the_slots_it_still_waits_for_one(script: Script) -> None:
    agent = beside_slots(script)
    life = agent.next_life()
    life.see("u1")
    life.hear("u1", visiting(BaseStage.LANDED, 5.0))
    life.run_until(BUDGET_S + 10.0)

    assert (life.state(), life.stage) == (AgentState.BESIDE_SLOTS, BaseStage.PARKED)
    assert life.way_home.land, "it may have been on its way down"
    assert life.way_home.resume
    assert life.way_home.via_enu_m == ABOVE_BASE
    assert life.claim is not None
    assert life.claim.arrives_s == 50.0
    life.hear("u1", visiting(BaseStage.PARKED, 5.0), BUDGET_S + 11.0)
    assert life.state() is AgentState.SWAPPING


@pytest.mark.parametrize("full", [False, True])
def test_started_again_on_the_ground_it_stays_there(script: Script, full: bool) -> None:
    agent = swapping(script)
    if full:
        agent.get_full(70.0)
    life = agent.next_life()

    assert life.state() is AgentState.SWAPPING
    assert [type(order) for order in orders(life.log)] == [Swap]
    assert life.stage is (BaseStage.PARKED if full else BaseStage.LANDED)
    life.get_full(80.0)
    assert life.state() is AgentState.READY_ON_GROUND


def test_started_again_before_it_departs_it_decides_anew_from_the_ground(script: Script) -> None:
    agent = FieldAgent()
    agent.fly_to(entry("t0", 100.0, opens_s=200.0))
    script.items = ["base:b0", "t0"]
    agent.start_mission()
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    agent.get_full(70.0)
    life = agent.next_life()
    assert life.state() is AgentState.SWAPPING
    script.items = ["t0"]

    life.get_full(73.0)

    assert life.state() is AgentState.DEPARTING
    assert life.task == "t0"


def killed_on_departure(script: Script, *others: str) -> FieldAgent:
    """Its next life, which has been told that it departed, and looks for its vehicle."""
    agent = swapping(script, *others)
    script.items = ["t0"]
    agent.get_full(70.0)
    assert (agent.state(), agent.task) == (AgentState.FLYING, "t0")
    life = agent.next_life()
    for other in others:
        life.see(other)
    assert isinstance(life.last_order, Prepare)
    assert life.last_order.left_in_air
    return life


def test_killed_before_it_took_off_it_is_found_at_the_base_and_gets_ready_anew(
    script: Script,
) -> None:
    life = killed_on_departure(script)
    life.be_at((58.0, 3.0, 0.2), 1.0)

    life.happen(Refused(life.last_order, "it stands on the ground", stands=True), 74.0)

    assert life.state() is AgentState.BESIDE_SLOTS, "others may have come to the slot"
    assert (life.task, life.stage) == (None, BaseStage.PARKED)
    life.run_until(74.0 + life.timing.objection_window_s)
    assert life.state() is AgentState.SWAPPING
    assert life.landing.position_enu_m == (50.0, 0.0, 0.0)
    script.items = ["t0"]
    life.get_full(100.0)
    assert (life.state(), life.task) == (AgentState.FLYING, "t0")
    assert life.claim is not None
    assert life.claim.sortie_end_s == 100.0 + BUDGET_S


def test_found_at_a_base_whose_slot_another_has_taken_it_waits_for_it(script: Script) -> None:
    life = killed_on_departure(script, "u1")
    life.hear("u1", visiting(BaseStage.LANDED, 72.0))
    life.be_at((50.0, 0.0, 0.0), 1.0)

    life.happen(Refused(life.last_order, "it stands on the ground", stands=True), 74.0)
    life.run_until(90.0)
    assert life.state() is AgentState.BESIDE_SLOTS

    life.hear("u1", visiting(BaseStage.PARKED, 72.0), 91.0)
    assert life.state() is AgentState.SWAPPING


@pytest.mark.parametrize(
    ("place_enu_m", "stands"), [((76.0, 0.0, 0.0), True), ((50.0, 0.0, 0.0), False)]
)
def test_found_elsewhere_or_in_the_air_it_is_left_alone(
    script: Script, place_enu_m: Point, stands: bool
) -> None:
    life = killed_on_departure(script)
    life.be_at(place_enu_m, 1.0)

    life.happen(Refused(life.last_order, "it stands on the ground", stands=stands), 74.0)

    assert isinstance(life.last_order, Return)
    assert life.claim is not None
    assert life.claim.phase is ClaimPhase.OUT
