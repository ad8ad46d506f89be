"""A visit to a base, from the decision to the departure, and whatever comes between."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import GoTo, Home, KeepOut, Prepare, Ready, Refused, Return, Swap
from agent.core.states import AgentState
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind, MissionPhase
from swarm.protocol.uav_messages import BaseStage, ClaimPhase, StatusPhase
from tests.support.builders import entry, epoch
from tests.support.field_agent import (
    BASE,
    BUDGET_S,
    FAR_BASE,
    SWAP_S,
    FieldAgent,
    Script,
    square,
    visiting,
)
from tests.support.lone_agent import ABOVE_START, claims, finishes, orders, statuses

ABOVE_BASE = (50.0, 0.0, 10.0)


def inside(place_enu_m: Point, east_m: float, north_m: float, half_m: float = 5.0) -> bool:
    """Whether a place is in the zone of `square`."""
    return max(abs(place_enu_m[0] - east_m), abs(place_enu_m[1] - north_m)) < half_m


def on_its_way(script: Script, *others: str, **more: object) -> FieldAgent:
    """It has just decided to fly to the base, at mission time 0."""
    agent = FieldAgent(*others, **more)  # type: ignore[arg-type]  # each test names real ones
    agent.fly_to(entry("t0", 100.0))
    script.items = ["base:b0"]
    agent.start_mission()
    assert agent.state() is AgentState.FLYING_TO_BASE
    return agent


def swapping(script: Script, *others: str, **more: object) -> FieldAgent:
    """It has touched down at 50 s."""
    agent = on_its_way(script, *others, **more)
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    assert agent.state() is AgentState.SWAPPING
    return agent


def test_it_flies_to_the_base_that_it_decided_on_and_claims_it(script: Script) -> None:
    agent = on_its_way(script)

    claim = agent.claim
    assert claim is not None
    assert (claim.phase, claim.task, claim.base) == (ClaimPhase.PROPOSED, None, "b0")
    assert (claim.stage, claim.arrives_s) == (BaseStage.APPROACHING, 50.0)
    assert (claim.completion_s, claim.sortie_end_s) == (50.0 + SWAP_S, BUDGET_S)
    assert agent.flight.position_enu_m == ABOVE_BASE
    assert agent.core.phase is StatusPhase.FLYING
    agent.run_until(1.0)
    assert agent.phase is ClaimPhase.HELD


def test_it_lands_at_once_where_nobody_else_needs_the_slot(script: Script) -> None:
    agent = on_its_way(script)
    agent.run_until(49.0)
    agent.arrive(50.0)

    assert agent.landing.position_enu_m == (50.0, 0.0, 0.0)
    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)
    assert agent.claim is not None
    assert agent.claim.completion_s == 50.0 + SWAP_S
    agent.touch_down(51.0)
    assert agent.claim.completion_s == 51.0 + SWAP_S
    assert agent.claim.sortie_end_s is None


def test_a_full_battery_makes_it_free_and_with_nothing_to_do_it_leaves_the_slot(
    script: Script,
) -> None:
    agent = swapping(script)

    agent.get_full(70.0)

    assert script.turns[-1].landed_at == "b0"
    assert not script.turns[-1].parked
    assert agent.state() is AgentState.READY_ON_GROUND
    assert (agent.phase, agent.stage) == (ClaimPhase.IDLE, BaseStage.PARKED)
    assert agent.core.phase is StatusPhase.IDLE
    assert not isinstance(agent.last_order, GoTo)


def test_it_takes_off_for_its_next_task_with_a_new_sortie(script: Script) -> None:
    agent = swapping(script)
    script.items = ["t0"]

    agent.get_full(70.0)

    assert agent.state() is AgentState.FLYING
    assert agent.flight.position_enu_m == (100.0, 0.0, 10.0)
    claim = agent.claim
    assert claim is not None
    assert (claim.task, claim.base, claim.stage, claim.departs_s) == ("t0", None, None, None)
    assert (claim.completion_s, claim.sortie_end_s) == (120.0, 70.0 + BUDGET_S)


def test_it_holds_its_slot_until_it_has_to_depart(script: Script) -> None:
    agent = FieldAgent()
    agent.fly_to(entry("t0", 100.0, opens_s=200.0))
    script.items = ["base:b0", "t0"]
    agent.start_mission()
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    agent.get_full(70.0)

    claim = agent.claim
    assert claim is not None
    assert agent.state() is AgentState.DEPARTING
    assert (claim.task, claim.base, claim.stage) == ("t0", "b0", BaseStage.LANDED)
    assert claim.departs_s == 150.0
    assert isinstance(agent.last_order, Swap)
    agent.run_until(149.9)
    assert agent.state() is AgentState.DEPARTING
    assert agent.phase is ClaimPhase.HELD
    agent.run_until(150.0)
    assert agent.state() is AgentState.FLYING
    assert agent.flight.position_enu_m == (100.0, 0.0, 10.0)
    claim = agent.claim
    assert claim is not None
    assert (claim.phase, claim.task, claim.base) == (ClaimPhase.HELD, "t0", None)
    assert claim.sortie_end_s == 150.0 + BUDGET_S


def departing(script: Script) -> FieldAgent:
    """It stands at the base until it is to take off for a task that opens at 200 s."""
    agent = FieldAgent()
    agent.fly_to(entry("t0", 100.0, opens_s=200.0))
    script.items = ["base:b0", "t0"]
    agent.start_mission()
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    agent.get_full(70.0)
    assert agent.state() is AgentState.DEPARTING
    return agent


def test_a_zone_on_the_way_makes_who_waits_on_the_ground_decide_anew(script: Script) -> None:
    agent = departing(script)
    script.items = ["t0"]

    agent.drawn(square("z", 75.0, 0.0, 10.0), 80.0)

    assert agent.state() is AgentState.DEPARTING
    assert agent.claim is not None
    assert agent.claim.task == "t0"
    assert agent.claim.departs_s is not None
    assert agent.claim.departs_s < 150.0 - 1.0


def test_a_zone_over_its_task_leaves_who_waits_on_the_ground_there(script: Script) -> None:
    agent = departing(script)

    agent.drawn(square("z", 100.0, 0.0), 80.0)

    assert agent.state() is AgentState.READY_ON_GROUND
    assert agent.claim is not None
    assert (agent.claim.task, agent.stage) == (None, BaseStage.PARKED)
    agent.run_until(160.0)
    assert agent.state() is AgentState.READY_ON_GROUND


def test_a_zone_elsewhere_changes_nothing_for_who_waits_on_the_ground(script: Script) -> None:
    agent = departing(script)
    turns = len(script.turns)

    agent.drawn(square("z", 300.0, 300.0), 80.0)

    assert agent.state() is AgentState.DEPARTING
    assert len(script.turns) == turns


def test_a_task_lost_before_take_off_leaves_it_on_the_ground(script: Script) -> None:
    agent = FieldAgent()
    agent.fly_to(entry("t0", 100.0, opens_s=200.0))
    script.items = ["base:b0", "t0"]
    agent.start_mission()
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    agent.get_full(70.0)

    agent.post(entry("t0", 100.0, opens_s=200.0, withdrawn=True))

    assert agent.state() is AgentState.READY_ON_GROUND
    assert (agent.phase, agent.stage) == (ClaimPhase.IDLE, BaseStage.PARKED)
    assert not isinstance(agent.last_order, GoTo)


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


NEAR_BASE = replace(FAR_BASE, id="b1", position_enu_m=(50.0, 30.0, 0.0), slots=1)


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


def beside_slots(script: Script) -> FieldAgent:
    """It has waited above the base, whose slot is taken, until its battery was used up."""
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.arrive(50.0)

    agent.run_until(BUDGET_S - 0.1)
    assert agent.state() is AgentState.ABOVE_BASE
    agent.run_until(BUDGET_S)

    assert agent.way_home.land
    assert agent.way_home.via_enu_m == ABOVE_BASE
    assert agent.way_home.path_enu_m == ()
    assert (agent.state(), agent.stage) == (AgentState.BESIDE_SLOTS, BaseStage.PARKED)
    return agent


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


def test_held_beside_the_slots_it_waits_for_one_again_afterwards(script: Script) -> None:
    agent = beside_slots(script)

    agent.told(CommandKind.HOLD, BUDGET_S + 5.0)
    agent.hear("u1", visiting(BaseStage.PARKED, 5.0), BUDGET_S + 6.0)
    assert agent.state() is AgentState.PAUSED
    agent.told(CommandKind.RESUME, BUDGET_S + 10.0)

    assert agent.state() is AgentState.BESIDE_SLOTS
    agent.run_until(BUDGET_S + 12.0)
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


@pytest.mark.parametrize("above", [False, True])
def test_a_base_that_a_zone_cuts_off_is_given_up(script: Script, above: bool) -> None:
    agent = on_its_way(script, "u1")
    agent.hear("u1", visiting(BaseStage.LANDED, 5.0))
    agent.run_until(49.0)
    agent.be_at(ABOVE_BASE if above else (40.0, 0.0, 10.0), None)
    if above:
        agent.arrive(50.0)

    agent.drawn(square("new", 50.0, 0.0), 51.0)

    # Out of the zone by the shortest way, or not into it.
    assert agent.state() is AgentState.IDLE
    assert agent.flight.position_enu_m != ABOVE_BASE
    assert not inside(agent.flight.position_enu_m, 50.0, 0.0)


def test_a_vehicle_that_will_not_land_leaves_the_base_alone_for_a_while(script: Script) -> None:
    agent = on_its_way(script)
    agent.run_until(49.0)
    agent.be_at(ABOVE_BASE, None)
    agent.arrive(50.0)
    script.items = ["base:b0"]

    agent.happen(Refused(agent.landing, "no pad seen"), 51.0)

    claim = agent.claim
    assert claim is not None
    assert agent.state() is AgentState.IDLE
    assert (claim.phase, claim.base, claim.sortie_end_s) == (ClaimPhase.IDLE, None, BUDGET_S)
    script.items = ["base:b0"]
    agent.run_until(51.0 + agent.timing.reconsider_s - 0.1)
    assert agent.state() is AgentState.IDLE
    agent.run_until(51.0 + agent.timing.reconsider_s)
    assert agent.state() is AgentState.FLYING_TO_BASE


def test_a_vehicle_that_will_not_take_off_stands_there_still(script: Script) -> None:
    agent = swapping(script)
    script.items = ["t0"]
    agent.get_full(70.0)

    agent.happen(Refused(agent.flight, "not armable"), 71.0)

    assert (agent.state(), agent.stage) == (AgentState.SWAPPING, BaseStage.LANDED)
    assert isinstance(agent.last_order, Swap)
    agent.get_full(72.0)
    assert agent.state() is AgentState.READY_ON_GROUND
    assert script.turns[-1].excluded == {"t0"}


def test_it_may_fly_from_base_to_base(script: Script) -> None:
    agent = swapping(script, bases=[*FieldAgent().brief.bases, FAR_BASE])
    script.items = ["base:b1"]

    agent.get_full(70.0)

    assert agent.state() is AgentState.FLYING_TO_BASE
    claim = agent.claim
    assert claim is not None
    assert (claim.base, claim.stage) == ("b1", BaseStage.APPROACHING)
    assert claim.sortie_end_s == 70.0 + BUDGET_S


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


def test_its_status_tells_of_the_visit(script: Script) -> None:
    agent = swapping(script)
    agent.run_until(60.0)

    said = statuses(agent.log)[-1]
    assert said.phase is StatusPhase.SERVING
    assert said.note == "swaps its battery at base b0"
    assert [claim.stage for claim in claims(agent.log)][-1] is BaseStage.LANDED


def test_the_operators_word_lets_a_vehicle_on_the_ground_start_again(script: Script) -> None:
    agent = on_its_way(script)
    agent.vouched("u0", 10.0)  # of nothing that is to come
    agent.run_until(49.0)
    agent.arrive(50.0)
    agent.touch_down(50.0)
    assert agent.landing.swap_s == SWAP_S
    agent.vouched("u1", 55.0)
    agent.run_until(60.0)
    assert isinstance(agent.last_order, Swap)

    agent.vouched("u0", 61.0)
    agent.run_until(70.0)

    assert [each for each in orders(agent.log) if isinstance(each, Ready)] == [Ready(agent.leg)]
    assert agent.state() is AgentState.SWAPPING, "its vehicle has not said that it is full"


def test_its_vehicle_learns_of_zones_before_what_heeds_them(script: Script) -> None:
    zone, drawn = square("z0", 500.0, 0.0), square("z1", 400.0, 300.0)
    agent = on_its_way(script, zones=(zone,))
    told = orders(agent.log)
    assert told[0] == KeepOut((zone.zone(),), 0.0)
    assert isinstance(told[1], Prepare)

    agent.drawn(drawn, 10.0)

    assert orders(agent.log)[-2:] == [KeepOut((zone.zone(), drawn.zone()), 0.0), agent.flight]
