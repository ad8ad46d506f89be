"""What an agent makes of the operator's words, and of being without the bus."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import (
    Action,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    NotReady,
    Prepare,
    Refused,
    Return,
    ReturnAdvised,
    VehicleReady,
)
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.events import KeysReplaced, LinkChanged, MessageReceived, Save, Stop
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.builders import PAUSED, entry, epoch, uav
from tests.support.lone_agent import (
    ABOVE_START,
    LoneAgent,
    finishes,
    notes,
    orders,
    outcomes,
    statuses,
)

HOLD, RESUME, RETURN, ABORT = CommandKind


def tell(
    agent: LoneAgent,
    kind: CommandKind,
    mission_s: float | None = None,
    *,
    to: str = "u0",
    reason: str = "",
    run: int = 1,
) -> list[Action]:
    target = FLEET if kind is ABORT else to
    return agent.hear(OPERATOR, OperatorCommand(target, kind, run, reason), mission_s)


def on_its_way() -> LoneAgent:
    """``u0`` of two flies to ``near`` since mission time 0."""
    agent = LoneAgent(uav("u0"), uav("u1", east_m=99.0, near=0.0))
    agent.fly_to(entry("near", 5.0), entry("far", 50.0, number=1))
    agent.start_mission()
    assert agent.task == "near"
    return agent


def test_a_held_uav_gives_its_task_up_stops_and_says_why() -> None:
    agent = on_its_way()

    actions = tell(agent, HOLD, 2.0, reason="helicopter")

    assert (agent.phase, agent.task) == (ClaimPhase.PAUSED, None)
    assert orders(actions) == [Hold("held by the operator: helicopter")]
    assert agent.core.phase is StatusPhase.HOLDING
    assert Save() in actions
    (status,) = statuses(agent.run_until(3.0))[-1:]
    note = "held by the operator: helicopter"
    assert (status.phase, status.note) == (StatusPhase.HOLDING, f"being stopped, {note}")
    agent.happen(Held())
    (status,) = statuses(agent.run_until(5.0))[-1:]
    assert (status.phase, status.note) == (StatusPhase.HOLDING, note)


def test_when_an_operator_loses_its_keys_nothing_it_has_said_is_obeyed_again() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)
    agent.happen(Held())
    tell(agent, ABORT, 3.0)
    assert agent.core.phase is StatusPhase.RETURNING

    assert orders(agent.happen(KeysReplaced(frozenset({OPERATOR})))) == []
    assert agent.core.phase is StatusPhase.RETURNING


def test_what_is_said_for_a_flight_before_its_brief_is_obeyed_once_that_is_known() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0, run=2)
    assert orders(agent.run_until(3.0)) == []

    actions = agent.hear(COORDINATOR, replace(agent.brief, run=2))

    assert orders(actions) == [Hold("held by the operator")]


def test_a_held_uav_stays_held_when_who_held_it_loses_its_keys() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)
    agent.happen(Held())

    assert orders(agent.happen(KeysReplaced(frozenset({OPERATOR})))) == []
    assert agent.core.phase is StatusPhase.HOLDING
    assert orders(tell(agent, RESUME, 4.0)) != []


def test_a_held_uav_takes_no_task_whatever_happens() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)
    before = len(orders(agent.log))

    agent.arrive(5.0)
    agent.post(entry("new", 1.0, number=2))
    agent.hear(COORDINATOR, epoch("u0", "u1", number=2), 6.0)
    agent.lose("u1", 7.0)
    agent.run_until(60.0)

    assert len(orders(agent.log)) == before
    assert agent.phase is ClaimPhase.PAUSED
    assert outcomes(agent.log) == []


def test_resumed_it_is_prepared_where_it_is_and_decides_anew() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)
    agent.be_at((2.0, 0.0, 10.0))

    actions = tell(agent, RESUME, 20.0)
    assert [type(order) for order in orders(actions)] == [Prepare]
    (order,) = orders(actions)
    assert isinstance(order, Prepare)
    assert order.resume
    assert agent.core.phase is StatusPhase.PREPARING

    actions = agent.happen(VehicleReady(), 21.0)
    assert agent.task == "near"
    assert agent.claim is not None
    assert agent.claim.decided_s == pytest.approx(21.0)
    assert [type(order) for order in orders(actions)] == [GoTo]


def test_resumed_with_nothing_to_do_it_hovers_where_it_was_held() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)
    agent.be_at((2.0, 0.0, 10.0))
    for number, name in enumerate(("near", "far")):
        agent.post(entry(name, 5.0, number=number, withdrawn=True))
    tell(agent, RESUME, 20.0)

    (order,) = orders(agent.happen(VehicleReady(), 21.0))
    assert isinstance(order, GoTo)
    assert order.position_enu_m == (2.0, 0.0, 10.0)
    assert agent.phase is ClaimPhase.IDLE


def test_resuming_who_is_not_held_changes_nothing() -> None:
    agent = on_its_way()

    assert orders(tell(agent, RESUME, 1.0)) == []
    assert agent.task == "near"


def test_what_is_said_to_another_uav_changes_nothing() -> None:
    agent = on_its_way()

    for kind in (HOLD, RETURN):
        assert orders(tell(agent, kind, to="u1")) == []
    assert agent.task == "near"


def test_a_command_of_an_earlier_flight_is_none() -> None:
    agent = on_its_way()

    for kind in CommandKind:
        assert orders(tell(agent, kind, run=0)) == []
    assert agent.task == "near"


def test_a_uav_sent_home_takes_no_further_part_and_its_process_ends_with_0() -> None:
    agent = on_its_way()

    actions = tell(agent, RETURN, 2.0, reason="camera")
    assert orders(actions) == [Return("sent home by the operator: camera", via_enu_m=ABOVE_START)]
    assert agent.phase is ClaimPhase.OUT

    tell(agent, RESUME, 3.0)
    assert agent.core.phase is StatusPhase.RETURNING
    assert finishes(agent.happen(Home(), 9.0)) == [0]


def test_an_aborted_mission_brings_it_home_at_once() -> None:
    agent = on_its_way()

    actions = tell(agent, ABORT, 2.0, reason="storm")

    assert orders(actions) == [Return("aborted by the operator: storm", via_enu_m=ABOVE_START)]
    assert agent.phase is ClaimPhase.OUT
    assert finishes(agent.happen(Home(), 9.0)) == [0]


def test_after_an_abort_one_uav_can_be_held_on_its_way_home_and_then_goes_on_home() -> None:
    agent = on_its_way()
    tell(agent, ABORT, 2.0)

    assert [type(o) for o in orders(tell(agent, HOLD, 3.0))] == [Hold]
    assert agent.core.phase is StatusPhase.HOLDING
    assert agent.phase is ClaimPhase.OUT
    agent.run_until(100.0)
    assert agent.core.phase is StatusPhase.HOLDING

    assert [type(o) for o in orders(tell(agent, RESUME, 101.0))] == [Return]
    assert finishes(agent.happen(Home(), 110.0)) == [0]


def test_a_uav_held_on_its_way_home_that_lands_all_the_same_is_home() -> None:
    agent = on_its_way()
    assert finishes(agent.happen(Home())) == []
    tell(agent, ABORT, 2.0)
    tell(agent, HOLD, 3.0)

    assert finishes(agent.happen(Home(), 4.0)) == [0]
    assert agent.core.phase is StatusPhase.HOME


def test_landing_ends_no_hold_of_a_uav_that_takes_part() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 3.0)

    assert finishes(agent.happen(Home(), 4.0)) == []
    assert agent.core.phase is StatusPhase.HOLDING


def test_an_abort_moves_a_uav_that_was_held_before() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)

    assert [type(o) for o in orders(tell(agent, ABORT, 3.0))] == [Return]


def test_whoever_hears_of_abort_and_later_hold_at_once_stays_but_takes_no_part() -> None:
    agent = on_its_way()
    abort = agent.statement(OPERATOR, OperatorCommand(FLEET, ABORT, 1, ""))
    hold = agent.statement(OPERATOR, OperatorCommand("u0", HOLD, 1, ""))

    agent.happen(MessageReceived(hold), 2.0)
    agent.happen(MessageReceived(abort), 2.1)

    assert agent.core.phase is StatusPhase.HOLDING
    assert agent.phase is ClaimPhase.OUT
    assert [type(o) for o in orders(tell(agent, RESUME, 3.0))] == [Return]


def test_the_end_of_the_mission_leaves_a_held_uav_where_it_is() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)

    assert orders(agent.end_mission(5.0)) == []
    assert (agent.core.phase, agent.phase) == (StatusPhase.HOLDING, ClaimPhase.OUT)
    assert [type(o) for o in orders(tell(agent, RESUME, 9.0))] == [Return]


@pytest.mark.parametrize("event", [ReturnAdvised("battery low"), Stop("told to stop")])
def test_a_low_battery_or_the_end_of_its_process_brings_a_held_uav_home(
    event: ReturnAdvised | Stop,
) -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)

    assert [type(o) for o in orders(agent.happen(event, 5.0))] == [Return]
    agent.run_until(20.0)
    assert agent.core.phase is StatusPhase.RETURNING, "the old word does not stop it again"


def test_before_take_off_a_held_uav_is_not_prepared_until_it_may_go_on() -> None:
    agent = LoneAgent(uav("u0"))
    agent.see(COORDINATOR)
    agent.learn(
        agent.statement(COORDINATOR, agent.brief),
        agent.statement(OPERATOR, OperatorCommand("u0", HOLD, 1, "")),
    )

    assert orders(agent.log) == []
    assert (agent.core.phase, agent.phase) == (StatusPhase.HOLDING, ClaimPhase.PAUSED)
    (order,) = orders(tell(agent, RESUME))
    assert isinstance(order, Prepare)
    assert not order.resume, "it is yet to fly to its start"
    agent.happen(VehicleReady())
    assert agent.phase is ClaimPhase.IDLE


def test_a_hold_interrupts_a_preparation() -> None:
    agent = LoneAgent(uav("u0"))
    agent.see(COORDINATOR)
    agent.learn(agent.statement(COORDINATOR, agent.brief))

    assert [type(o) for o in orders(tell(agent, HOLD))] == [Hold]
    agent.happen(VehicleReady())
    assert agent.phase is ClaimPhase.PAUSED


@pytest.mark.parametrize("remembers", [True, False])
def test_a_restarted_agent_holds_what_was_held(remembers: bool) -> None:
    earlier = on_its_way()
    tell(earlier, HOLD, 2.0)
    agent = earlier.reborn(remembers=remembers)
    agent.see(COORDINATOR, "u1")

    actions = agent.learn_what_was_known_to(earlier)

    assert [type(o) for o in orders(actions)] == [Hold]
    assert (agent.core.phase, agent.phase) == (StatusPhase.HOLDING, ClaimPhase.PAUSED)


@pytest.mark.parametrize("kind", [RETURN, ABORT])
def test_a_restarted_agent_learns_that_it_is_to_go_home_before_it_acts(kind: CommandKind) -> None:
    earlier = on_its_way()
    agent = earlier.reborn()
    agent.see(COORDINATOR, "u1")
    tell(earlier, kind, 2.0)  # heard by others only, while this one was down
    known = [m for m in earlier.core.memory(earlier.now_s).messages if m.writer != "u0"]

    actions = agent.learn(*known, mission_s=3.0)

    assert [type(o) for o in orders(actions)] == [Return]
    assert finishes(agent.happen(Home())) == [0]


def test_who_takes_part_again_is_not_sent_home_by_an_old_word() -> None:
    earlier = on_its_way()
    tell(earlier, RETURN, 2.0)
    agent = earlier.reborn(rejoin=True)
    agent.see(COORDINATOR, "u1")

    actions = agent.learn_what_was_known_to(earlier)
    assert [type(o) for o in orders(actions)] == [Prepare]
    assert [type(o) for o in orders(tell(agent, RETURN))] == [Return]


def test_a_vehicle_in_its_pilots_hands_is_never_commanded() -> None:
    agent = on_its_way()
    agent.happen(HandedOver("pilot"), 1.0)

    for kind in (HOLD, RESUME, RETURN):
        assert orders(tell(agent, kind)) == []
    assert agent.core.phase is StatusPhase.OUT
    actions = tell(agent, ABORT)
    assert orders(actions) == []
    assert finishes(actions) == [0]


def test_a_pilot_takes_over_from_a_held_uav() -> None:
    agent = on_its_way()
    tell(agent, HOLD, 2.0)

    agent.happen(HandedOver("pilot"), 3.0)

    assert agent.claim is not None
    assert agent.claim.handed_over
    assert orders(tell(agent, RESUME, 4.0)) == []


def test_a_vehicle_that_cannot_stop_is_told() -> None:
    agent = on_its_way()
    (order,) = orders(tell(agent, HOLD, 2.0))

    agent.happen(Refused(order, "no position"))
    agent.happen(NotReady("whatever"))

    status = statuses(agent.run_until(5.0))[-1]
    assert status.note == "cannot hold: no position"


def test_without_a_coordinator_the_others_do_not_wait_for_a_held_uav() -> None:
    agent = LoneAgent(uav("u0"), uav("u1", east_m=99.0))
    agent.fly_to(entry("near", 5.0))
    tell(agent, HOLD, to="u1")
    agent.hear("u1", PAUSED)

    agent.start_mission("u1", "u0")

    assert agent.task == "near"


def lonely(without_bus_s: float | None) -> LoneAgent:
    agent = LoneAgent(uav("u0"), without_bus_s=without_bus_s)
    agent.fly_to(entry("far", 500.0))
    agent.start_mission()
    return agent


def test_without_the_bus_for_too_long_it_goes_home_and_says_why() -> None:
    agent = lonely(30.0)
    agent.happen(LinkChanged(False), 10.0)

    assert orders(agent.run_until(39.9)) == []
    actions = agent.run_until(40.5)

    assert orders(actions) == [Return("without the bus for 30 s", via_enu_m=ABOVE_START)]
    assert "returning" in notes(actions)
    assert agent.phase is ClaimPhase.OUT


def test_a_link_that_is_back_in_time_is_no_reason() -> None:
    agent = lonely(30.0)
    agent.happen(LinkChanged(False), 10.0)
    agent.happen(LinkChanged(True), 39.0)
    agent.learn()
    agent.happen(LinkChanged(False), 41.0)

    assert orders(agent.run_until(70.0)) == []


def test_by_default_it_flies_on_without_the_bus() -> None:
    agent = lonely(None)
    agent.happen(LinkChanged(False), 10.0)

    assert orders(agent.run_until(400.0)) == []
    assert agent.task == "far"


def test_an_aborted_mission_that_has_not_begun_is_left_too() -> None:
    agent = LoneAgent(uav("u0"))
    agent.see(COORDINATOR)
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.hear(COORDINATOR, epoch("u0", phase=MissionPhase.PREPARING))

    assert [type(o) for o in orders(tell(agent, ABORT))] == [Return]
