"""Who lands at a base when: slots that are held, waited for, or blocked by the lost."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import GoTo, Home, Swap
from agent.core.states import AgentState
from swarm.protocol.uav_messages import BaseStage, ClaimPhase, StatusPhase
from tests.support.base_visitor import NEAR_BASE, beside_slots, on_its_way
from tests.support.builders import entry
from tests.support.field_agent import (
    BASE,
    BUDGET_S,
    FAR_BASE,
    SWAP_S,
    FieldAgent,
    Script,
    visiting,
)
from tests.support.lone_agent import orders


def test_it_waits_above_a_base_whose_slot_is_held_and_lands_when_that_is_left(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)

    assert (agent.state(), agent.stage) == (AgentState.ABOVE_BASE, BaseStage.WAITING)
    assert agent.core.phase is StatusPhase.FLYING
    agent.run_until(60.0)
    assert agent.state() is AgentState.ABOVE_BASE
    agent.hear("u1", visiting(BaseStage.PARKED, 5.0), 61.0)
    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)
    assert isinstance(agent.last_order, Swap)


def test_of_two_that_wait_the_first_to_arrive_lands_first(script: Script) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.WAITING, 40.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.run_until(60.0)
    assert agent.state() is AgentState.ABOVE_BASE

    agent.hear("u1", visiting(BaseStage.WAITING, 55.0), 61.0)

    assert agent.state() is AgentState.SWAPPING


def test_a_claim_that_others_may_still_object_to_does_not_land(script: Script) -> None:
    agent = FieldAgent(bases=[FAR_BASE])
    agent.fly_to(entry("t0", 100.0))
    agent.be_at((0.0, 299.9, 10.0), None)
    script.items = ["base:b1"]
    agent.start_mission()

    agent.arrive(0.1)

    if agent.stage is BaseStage.APPROACHING:  # no limit of slots needs no window
        agent.run_until(1.0)
    assert agent.state() is AgentState.SWAPPING


def test_a_base_with_a_dead_slot_holder_is_left_until_the_operator_says_it_is_ready(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)

    agent.lose("u1", 60.0)

    assert agent.state() is AgentState.IDLE
    assert script.turns[-1].blocking == {"u1": "b0"}
    script.items = ["base:b0"]
    agent.vouched("u1", 70.0)
    assert script.turns[-1].blocking == {}
    agent.run_until(70.9)
    agent.arrive(71.0)
    assert agent.state() is AgentState.SWAPPING


def test_who_waits_longer_than_it_said_turns_to_a_base_that_is_ready_earlier(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1", bases=[BASE, NEAR_BASE])
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.run_until(50.0 + 0.9 * agent.timing.patience_s)
    assert agent.state() is AgentState.ABOVE_BASE

    agent.run_until(50.0 + 1.5 * agent.timing.patience_s)

    assert agent.state() is AgentState.FLYING_TO_BASE
    assert agent.flight.position_enu_m == (50.0, 30.0, 10.0)
    assert agent.claim is not None
    assert (agent.claim.base, agent.stage) == ("b1", BaseStage.APPROACHING)


@pytest.mark.parametrize("ready_s", [95.0, 75.0])
def test_it_waits_on_where_another_base_is_ready_no_earlier(script: Script, ready_s: float) -> None:
    """Of the other base the time to fly there counts, and who is ahead there."""
    agent = on_its_way(script, "u1", "u2", bases=[BASE, NEAR_BASE])
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0, ready_s=ready_s))
    agent.hear("u2", visiting(BaseStage.LANDED, 5.0, base="b1", ready_s=100.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.run_until(70.0)

    assert (agent.state(), agent.stage) == (AgentState.ABOVE_BASE, BaseStage.WAITING)


def test_with_nothing_to_do_it_flies_to_another_base_where_the_nearest_is_blocked(
    script: Script,
) -> None:
    agent = FieldAgent("u1", bases=[BASE, NEAR_BASE])
    agent.fly_to(entry("t0", 100.0))
    agent.be_at((60.0, 0.0, 10.0), None)
    agent.start_mission()
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.lose("u1", 20.0)
    agent.run_until(BUDGET_S - 20.0)

    assert agent.state() is AgentState.FLYING_TO_BASE
    assert agent.claim is not None
    assert agent.claim.base == "b1"
    assert agent.claim.arrives_s is not None
    assert agent.claim.arrives_s <= BUDGET_S


def test_who_was_lost_on_its_way_blocks_nothing(script: Script) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.APPROACHING, 5.0))
    agent.run_until(29.0)
    agent.lose("u1", 30.0)
    agent.arrive(50.0)

    assert agent.state() is AgentState.SWAPPING


def test_without_a_slot_it_lands_beside_them_and_swaps_from_there_when_one_is_free(
    script: Script,
) -> None:
    agent = beside_slots(script)
    agent.happen(Home(), BUDGET_S + 1.0)
    agent.be_at((50.0, 0.0, 0.0), 0.0)  # an empty battery is none to flee from on the ground
    agent.run_until(BUDGET_S + 50.0)
    assert (agent.state(), agent.phase) == (AgentState.BESIDE_SLOTS, ClaimPhase.HELD)
    assert agent.core.phase is StatusPhase.SERVING

    agent.hear("u1", visiting(BaseStage.PARKED, 5.0), BUDGET_S + 51.0)

    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)
    assert agent.landing.position_enu_m == (50.0, 0.0, 0.0)
    agent.touch_down(BUDGET_S + 51.0)
    script.items = ["t0"]
    agent.get_full(BUDGET_S + 51.0 + SWAP_S)
    assert agent.state() is AgentState.FLYING
    assert agent.claim is not None
    assert agent.claim.sortie_end_s == BUDGET_S + 51.0 + SWAP_S + BUDGET_S


def test_who_waits_on_the_ground_lets_those_in_the_air_go_first(script: Script) -> None:
    agent = beside_slots(script)

    agent.hear("u1", visiting(BaseStage.APPROACHING, 50.0 + SWAP_S), BUDGET_S + 51.0)
    agent.run_until(BUDGET_S + 60.0)
    assert agent.state() is AgentState.BESIDE_SLOTS
    agent.hear("u1", replace(visiting(BaseStage.PARKED, 900.0), sortie_end_s=910.0), 910.0)
    assert agent.state() is AgentState.SWAPPING


def test_who_waits_on_the_ground_lets_nobody_pass_who_comes_a_swap_later(script: Script) -> None:
    """Else it would starve where others come again and again."""
    agent = beside_slots(script)

    agent.hear("u1", visiting(BaseStage.WAITING, 51.0 + SWAP_S), BUDGET_S + 51.0)

    assert agent.state() is AgentState.SWAPPING


def test_who_is_in_the_air_lets_those_pass_who_have_waited_on_the_ground_for_a_swap(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1")
    parked = replace(visiting(BaseStage.PARKED, 49.0 - SWAP_S), sortie_end_s=40.0)
    agent.hear("u1", parked)
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.run_until(55.0)
    assert (agent.state(), agent.stage) == (AgentState.ABOVE_BASE, BaseStage.WAITING)

    agent.hear("u1", replace(parked, arrives_s=51.0 - SWAP_S), 56.0)

    assert agent.state() is AgentState.SWAPPING


def test_who_comes_when_it_said_lands_before_those_who_said_they_come_later(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1", "u2")
    agent.hear("u1", visiting(BaseStage.APPROACHING, 50.1))
    agent.run_until(49.0)
    agent.arrive(50.0)

    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)


def test_who_comes_just_before_the_slot_is_left_lands_when_it_is(script: Script) -> None:
    agent = on_its_way(script, "u1", "u2")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.hear("u2", visiting(BaseStage.APPROACHING, 60.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    assert agent.stage is BaseStage.WAITING

    agent.hear("u1", visiting(BaseStage.PARKED, 5.0), 50.01)

    assert agent.state() is AgentState.SWAPPING


@pytest.mark.parametrize("arrives_s", [45.0, 55.0])
def test_who_comes_when_nobody_expects_it_waits_for_objections(
    script: Script, arrives_s: float
) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.APPROACHING, 60.0))
    agent.run_until(arrives_s - 1.0)
    agent.arrive(arrives_s)

    assert (agent.state(), agent.stage) == (AgentState.ABOVE_BASE, BaseStage.WAITING)
    agent.run_until(arrives_s + 2.0 * agent.timing.objection_window_s)
    assert agent.state() is AgentState.SWAPPING


def test_beside_slots_that_stay_blocked_its_mission_is_over(script: Script) -> None:
    agent = beside_slots(script)

    agent.lose("u1", BUDGET_S + 5.0)

    agent.run_until(BUDGET_S + 5.0 + agent.timing.clear_s - 0.1)
    assert agent.state() is AgentState.BESIDE_SLOTS
    agent.run_until(BUDGET_S + 5.0 + agent.timing.clear_s + 1.0)
    assert agent.phase is ClaimPhase.OUT


def test_who_learns_above_a_base_that_its_slots_are_blocked_comes_down_beside_them(
    script: Script,
) -> None:
    """As who has come down before: it waits for somebody to clear a slot, and goes on then."""
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)
    script.items = []

    agent.lose("u1", 60.0)
    assert agent.state() is AgentState.IDLE, "it may yet find something to do"
    agent.run_until(BUDGET_S - 0.5 * agent.timing.patience_s)
    assert (agent.state(), agent.stage) == (AgentState.FLYING_TO_BASE, BaseStage.APPROACHING)
    assert agent.claim is not None
    assert agent.claim.arrives_s is not None
    assert agent.claim.arrives_s <= BUDGET_S
    agent.arrive(BUDGET_S - 0.4 * agent.timing.patience_s)
    agent.run_until(BUDGET_S)
    assert (agent.state(), agent.stage) == (AgentState.BESIDE_SLOTS, BaseStage.PARKED)
    assert agent.phase is ClaimPhase.HELD

    agent.vouched("u1", BUDGET_S + 0.9 * agent.timing.clear_s)
    agent.run_until(BUDGET_S + 0.9 * agent.timing.clear_s + 1.0)
    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)


def test_on_its_way_to_stand_beside_blocked_slots_it_takes_one_that_is_cleared(
    script: Script,
) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    script.items = []
    agent.lose("u1", 20.0)
    agent.be_at((60.0, 0.0, 10.0), None)
    agent.run_until(BUDGET_S - 5.0)
    assert agent.state() is AgentState.FLYING_TO_BASE

    agent.vouched("u1", BUDGET_S - 2.0)
    agent.arrive(BUDGET_S - 1.0)

    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)


def test_on_its_way_to_slots_that_become_blocked_it_flies_on_without_a_stop(script: Script) -> None:
    """Its battery lasts for nothing else: one step gives the base up, and goes on to it."""
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    script.items = []
    agent.be_at((58.0, 0.0, 10.0), None, BUDGET_S - 8.5)
    told = len(orders(agent.log))

    agent.lose("u1", BUDGET_S - 8.0)

    assert agent.state() is AgentState.FLYING_TO_BASE
    (flight,) = orders(agent.log)[told:]
    assert isinstance(flight, GoTo)
    assert flight.position_enu_m == (50.0, 0.0, 10.0)
