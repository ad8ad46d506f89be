"""What an agent makes of tasks that the operator adds and withdraws."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import GoTo
from swarm.model.ids import COORDINATOR, OPERATOR
from swarm.protocol.messages import MissionPhase
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase
from tests.support.builders import entry, epoch, held, message, order, uav
from tests.support.lone_agent import LoneAgent, notes, orders


def on_its_way(*, coordinator_dies: bool = False) -> LoneAgent:
    """``u0`` of two flies to ``near`` since mission time 0."""
    agent = LoneAgent(uav("u0"), uav("u1", east_m=99.0, near=0.0))
    agent.fly_to(entry("near", 5.0))
    agent.start_mission()
    assert agent.task == "near"
    if coordinator_dies:
        agent.lose(COORDINATOR, 0.5)
    return agent


def idle(*, coordinator_dies: bool) -> LoneAgent:
    """``u0`` has nothing to do while ``u1`` flies to ``t0``."""
    agent = LoneAgent(uav("u0", t0=0.0), uav("u1"))
    agent.fly_to(entry("t0", 5.0))
    agent.start_mission()
    agent.hear("u1", held("t0", 0.0), 0.1)
    if coordinator_dies:
        agent.lose(COORDINATOR, 0.5)
    agent.run_until(30.0)
    assert agent.phase is ClaimPhase.IDLE
    return agent


def test_an_idle_uav_takes_an_added_task_though_the_coordinator_is_dead() -> None:
    agent = idle(coordinator_dies=True)

    actions = agent.hear(OPERATOR, order("op1", 8.0), 30.5)
    actions += agent.run_until(32.0)

    assert agent.task == "op1"
    (flight,) = (each for each in orders(actions) if isinstance(each, GoTo))
    assert (flight.task, flight.position_enu_m) == ("op1", (8.0, 0.0, 10.0))


def test_it_takes_no_task_that_was_added_to_another_flight() -> None:
    agent = idle(coordinator_dies=False)

    agent.hear(OPERATOR, order("op1", 8.0, run=2), 30.5)
    agent.run_until(35.0)

    assert agent.task is None


def test_who_flies_to_a_withdrawn_task_gives_it_up() -> None:
    agent = on_its_way(coordinator_dies=True)

    actions = agent.hear(OPERATOR, order("near", withdrawn=True), 2.0)

    assert "released" in notes(actions)
    assert (agent.phase, agent.task) == (ClaimPhase.IDLE, None)


def test_an_added_task_tempts_a_uav_in_flight() -> None:
    agent = LoneAgent(uav("u0"))
    agent.fly_to(entry("far", 500.0))
    guided = replace(epoch("u0", rule="guided"), routes={"u0": ("far",)})
    agent.hear(COORDINATOR, guided, 0.0)
    assert agent.task == "far"

    actions = agent.hear(OPERATOR, order("op1", 1.0, value=50.0), 0.5)

    assert "turns aside" in notes(actions)
    assert agent.task == "op1"


def test_without_a_coordinator_it_stays_for_what_was_added() -> None:
    agent = on_its_way(coordinator_dies=True)
    agent.arrive(2.0)
    agent.tick(2.0)
    agent.hear(OPERATOR, order("op1", 60.0), 2.5)
    agent.run_until(100.0)

    assert agent.task == "op1"
    assert agent.core.phase is StatusPhase.FLYING


def test_it_answers_for_the_operator_and_keeps_their_orders() -> None:
    agent = on_its_way()
    agent.hear(OPERATOR, order("op1", 8.0), 1.0)
    known = [m.body for m in agent.core.snapshot(agent.now_s).messages if m.writer == OPERATOR]
    assert known == [order("op1", 8.0)]

    again = agent.reborn(remembers=True)
    again.see(COORDINATOR, "u1")
    again.learn(agent.statement(COORDINATOR, agent.brief))

    assert set(again.core.replica.board) == {"near", "op1"}


def test_who_starts_anew_without_memory_learns_of_an_added_task_from_the_others() -> None:
    agent = on_its_way()
    agent.hear(OPERATOR, order("op1", 8.0), 1.0)
    again = agent.reborn()
    again.see(COORDINATOR, "u1")
    again.learn_what_was_known_to(agent)

    assert "op1" in again.core.replica.board


# -- a coordinator that does not know yet which flight is on ------------------------------


def test_at_work_it_takes_no_brief_of_a_coordinator_that_has_not_taken_charge() -> None:
    agent = on_its_way()
    agent.hear(OPERATOR, order("near", 5.0), 1.0)
    other = replace(agent.brief, run=7)
    new_life = message(COORDINATOR, other, 1, incarnation=2)
    agent.learn(new_life)

    assert agent.core.replica.brief == agent.brief
    assert agent.task == "near"


def test_it_takes_the_brief_of_the_coordinator_in_charge() -> None:
    agent = on_its_way()
    other = replace(agent.brief, run=7)
    running = epoch("u0", "u1", phase=MissionPhase.RUNNING, number=2)
    agent.learn(message(COORDINATOR, running, 1, incarnation=2))
    agent.learn(message(COORDINATOR, other, 2, incarnation=2))

    assert agent.core.replica.brief == other
