"""What an agent makes of the wishes of a ground station beside its vehicle, and what that sees."""

from __future__ import annotations

import pytest

from agent.core.interface import Action, Held, Hold, Prepare, Ready, Return, VehicleReady
from agent.core.states import AgentState
from agent.core.station_words import (
    AnswerStation,
    ShowStations,
    StationAsked,
    StationVerdict,
    StationWish,
)
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.messages import CommandKind, OperatorCommand
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.base_visitor import swapping
from tests.support.builders import done, entry, uav
from tests.support.field_agent import Script
from tests.support.lone_agent import LoneAgent, finishes, orders

HOLD, RESUME, RETURN, READY, ABORT = StationWish
DONE, NOT_NOW, DENIED = StationVerdict


def ask(
    agent: LoneAgent, wish: StationWish, mission_s: float | None = None
) -> tuple[StationVerdict, list[Action]]:
    """The answer to a wish, and all that came of it."""
    actions = agent.happen(StationAsked(3, wish), mission_s)
    (answer,) = (action for action in actions if isinstance(action, AnswerStation))
    assert answer.number == 3
    assert (answer.verdict is DONE) or answer.reason
    return answer.verdict, actions


def tell(agent: LoneAgent, kind: CommandKind, mission_s: float | None = None) -> list[Action]:
    target = FLEET if kind is CommandKind.ABORT else "u0"
    return agent.hear(OPERATOR, OperatorCommand(target, kind, 1, ""), mission_s)


def on_its_way(*, shows_stations: bool = False) -> LoneAgent:
    """``u0`` of two flies to ``near`` since mission time 0."""
    uavs = uav("u0"), uav("u1", east_m=99.0, near=0.0)
    agent = LoneAgent(*uavs, shows_stations=shows_stations)
    agent.fly_to(entry("near", 5.0), entry("far", 50.0, number=1))
    agent.start_mission()
    assert agent.task == "near"
    return agent


# -- what follows from a wish -----------------------------------------------------------------


def test_a_held_uav_gives_its_task_up_and_goes_on_when_told_to() -> None:
    agent = on_its_way()

    verdict, actions = ask(agent, HOLD, 2.0)

    assert (verdict, orders(actions)) == (DONE, [Hold("held at a ground station")])
    assert (agent.phase, agent.task) == (ClaimPhase.PAUSED, None)
    agent.happen(Held())
    verdict, actions = ask(agent, RESUME, 5.0)
    assert verdict is DONE
    assert [type(order) for order in orders(actions)] == [Prepare]
    agent.happen(VehicleReady())
    assert agent.task == "near"


def test_what_is_asked_for_twice_is_done_once_and_answered_twice() -> None:
    agent = on_its_way()
    ask(agent, HOLD, 2.0)

    assert ask(agent, HOLD, 3.0)[0] is DONE
    assert orders(ask(agent, HOLD, 4.0)[1]) == []
    ask(agent, RESUME, 5.0)
    verdict, actions = ask(agent, RESUME, 6.0)
    assert (verdict, orders(actions)) == (DONE, [])
    assert [type(order) for order in orders(ask(agent, RETURN, 7.0)[1])] == [Return]
    verdict, actions = ask(agent, RETURN, 8.0)
    assert (verdict, orders(actions)) == (DONE, [])


def test_one_that_was_sent_home_takes_no_further_part() -> None:
    agent = on_its_way()

    verdict, actions = ask(agent, RETURN, 2.0)

    (order,) = orders(actions)
    assert verdict is DONE
    assert isinstance(order, Return)
    assert order.reason == "sent home at a ground station"
    assert agent.phase is ClaimPhase.OUT
    assert ask(agent, RESUME, 3.0)[0] is DENIED


@pytest.mark.parametrize("wish", [RESUME, RETURN, ABORT])
def test_what_the_operator_holds_neither_goes_on_nor_home(wish: StationWish) -> None:
    agent = on_its_way()
    tell(agent, CommandKind.HOLD, 2.0)

    verdict, actions = ask(agent, wish, 3.0)

    assert (verdict, orders(actions)) == (DENIED, [])
    assert agent.core.state is AgentState.PAUSED


def test_the_operator_lets_go_on_what_a_ground_station_holds() -> None:
    agent = on_its_way()
    ask(agent, HOLD, 2.0)

    assert [type(order) for order in orders(tell(agent, CommandKind.RESUME, 3.0))] == [Prepare]


def test_an_abort_brings_it_home() -> None:
    verdict, actions = ask(on_its_way(), ABORT, 2.0)

    (order,) = orders(actions)
    assert verdict is DONE
    assert isinstance(order, Return)
    assert order.reason == "aborted at a ground station"


def test_a_vehicle_whose_battery_was_changed_may_start_again(script: Script) -> None:
    agent = swapping(script)

    verdict, actions = ask(agent, READY)

    assert verdict is DONE
    assert [type(order) for order in orders(actions)] == [Ready]


def test_in_the_air_nothing_is_ready() -> None:
    verdict, actions = ask(on_its_way(), READY, 1.0)

    assert (verdict, orders(actions)) == (NOT_NOW, [])


def test_before_it_knows_what_others_know_it_does_nothing() -> None:
    verdict, actions = ask(LoneAgent(uav("u0")), HOLD)

    assert (verdict, orders(actions)) == (NOT_NOW, [])


# -- a later life -----------------------------------------------------------------------------


@pytest.mark.parametrize("remembers", [True, False])
def test_what_was_held_stays_held_when_its_agent_is_restarted(remembers: bool) -> None:
    earlier = on_its_way()
    ask(earlier, HOLD, 2.0)
    agent = earlier.reborn(remembers=remembers)
    agent.see(COORDINATOR, "u1")

    actions = agent.learn_what_was_known_to(earlier)

    assert [type(order) for order in orders(actions)] == [Hold]
    assert agent.core.state is AgentState.PAUSED
    assert ask(agent, RESUME)[0] is DONE


def test_a_memory_tells_a_hold_after_the_operator_let_it_go_on_from_one_before() -> None:
    earlier = on_its_way()
    tell(earlier, CommandKind.HOLD, 2.0)
    tell(earlier, CommandKind.RESUME, 3.0)
    earlier.happen(VehicleReady())
    ask(earlier, HOLD, 4.0)
    agent = earlier.reborn(remembers=True)
    agent.see(COORDINATOR, "u1")

    actions = agent.learn_what_was_known_to(earlier)

    assert [type(order) for order in orders(actions)] == [Hold]


@pytest.mark.parametrize("remembers", [True, False])
def test_what_the_operator_let_go_on_meanwhile_goes_on(remembers: bool) -> None:
    earlier = on_its_way()
    tell(earlier, CommandKind.HOLD, 2.0)
    agent = earlier.reborn(remembers=remembers)
    agent.see(COORDINATOR, "u1")
    tell(earlier, CommandKind.RESUME, 4.0)  # heard by others only, while this one was down
    known = [m for m in earlier.core.memory(earlier.now_s).messages if m.writer != "u0"]
    claimed = [m for m in agent.core.memory(agent.now_s).messages if m.writer == "u0"]

    actions = agent.learn(*known, *claimed)

    assert not any(isinstance(order, Hold) for order in orders(actions))


def test_one_that_is_to_rejoin_is_held_no_longer() -> None:
    earlier = on_its_way()
    ask(earlier, HOLD, 2.0)
    agent = earlier.reborn(rejoin=True)
    agent.see(COORDINATOR, "u1")

    actions = agent.learn_what_was_known_to(earlier)

    assert [type(order) for order in orders(actions)] == [Prepare]


# -- what is shown ----------------------------------------------------------------------------


def shown(actions: list[Action]) -> list[ShowStations]:
    return [action for action in actions if isinstance(action, ShowStations)]


def test_stations_are_shown_task_numbers_and_words() -> None:
    agent = on_its_way(shows_stations=True)

    (view,) = shown(agent.log)[-1:]

    assert (view.uav, view.phase, view.task) == ("u0", StatusPhase.FLYING, "near")
    assert (view.task_number, view.n_done, view.n_open) == (2, 0, 2)
    assert view.eta_s is not None
    assert view.eta_s > 0.0
    (view,) = shown(ask(agent, HOLD, 2.0)[1])
    assert (view.phase, view.task, view.task_number, view.eta_s) == (
        StatusPhase.HOLDING,
        None,
        0,
        None,
    )
    assert view.note == "being stopped, held at a ground station"


def test_they_are_shown_what_changes_and_nothing_else() -> None:
    agent = on_its_way(shows_stations=True)
    agent.run_until(0.9)

    assert shown(agent.run_until(3.0)) == []
    (view,) = shown(agent.hear("u1", done("far")))
    assert (view.n_done, view.n_open) == (1, 1)


def test_without_stations_nothing_is_shown() -> None:
    assert shown(on_its_way().log) == []


def test_a_uav_that_is_home_ends_though_a_station_watches() -> None:
    agent = on_its_way(shows_stations=True)
    ask(agent, RETURN, 2.0)

    actions = agent.end_mission(3.0)

    assert finishes(actions) == []
    assert agent.core.phase is StatusPhase.RETURNING
