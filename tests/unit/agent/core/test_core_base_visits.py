"""A visit to a base, from the decision to the departure, and whatever comes between."""

from __future__ import annotations

import pytest

from agent.core.interface import GoTo, KeepOut, Prepare, Ready, Refused, Swap
from agent.core.states import AgentState
from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import BaseStage, ClaimPhase, StatusPhase
from tests.support.base_visitor import ABOVE_BASE, on_its_way, swapping
from tests.support.builders import entry
from tests.support.field_agent import (
    BUDGET_S,
    FAR_BASE,
    SWAP_S,
    FieldAgent,
    Script,
    square,
    visiting,
)
from tests.support.lone_agent import claims, orders, statuses


def inside(place_enu_m: Point, east_m: float, north_m: float, half_m: float = 5.0) -> bool:
    """Whether a place is in the zone of `square`."""
    return max(abs(place_enu_m[0] - east_m), abs(place_enu_m[1] - north_m)) < half_m


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
