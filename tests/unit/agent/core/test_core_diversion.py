"""Turning in flight to a task that has appeared, where the whole team gains."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import GoTo
from swarm.protocol.uav_messages import ClaimPhase
from tests.support.builders import IDLE, done, entry, epoch, held, uav
from tests.support.lone_agent import LoneAgent, claims, notes, orders

FAR = entry("far", east_m=100.0)
ON_THE_WAY = entry("new", east_m=12.0, number=1)
BEHIND = entry("new", east_m=-300.0, number=1)


def on_its_way(*others: str, rule: str = "guided") -> LoneAgent:
    """``u0``, 1 m/s, ten seconds into its flight to `FAR`; the others are busy elsewhere."""
    agent = LoneAgent(uav("u0"), *(uav(other, east_m=-500.0) for other in others))
    agent.fly_to(FAR)
    lists = {"u0": ("far",)} if rule == "guided" else {}
    agent.hear("coordinator", replace(epoch("u0", *others, rule=rule), routes=lists), 0.0)
    agent.tick_when_due()
    for number, other in enumerate(others):
        agent.hear(other, held(f"elsewhere{number}", 0.0, completion_s=900.0), 1.0)
    agent.tick(10.0)
    agent.be_at((10.0, 0.0, 10.0))
    assert (agent.task, agent.phase) == ("far", ClaimPhase.HELD)
    return agent


def test_it_turns_to_a_task_that_appears_on_its_way_and_takes_its_own_afterwards() -> None:
    agent = on_its_way()
    actions = agent.post(ON_THE_WAY)

    assert [claim.task for claim in claims(actions)] == ["new"]
    assert [o.position_enu_m for o in orders(actions) if isinstance(o, GoTo)] == [(12.0, 0.0, 10.0)]
    assert "turns aside" in notes(actions)

    agent.arrive(12.0)
    assert agent.task == "far"


def test_it_flies_on_when_the_new_task_is_better_done_later() -> None:
    agent = on_its_way()

    assert not claims(agent.post(BEHIND))
    assert agent.task == "far"


def test_by_the_papers_rules_it_flies_on() -> None:
    agent = on_its_way(rule="greedy")

    assert not claims(agent.post(ON_THE_WAY))


def test_it_leaves_the_new_task_to_somebody_who_is_free() -> None:
    agent = on_its_way("u1")
    agent.hear("u1", done("elsewhere0", 11.0), 11.0)
    agent.hear("u1", replace(IDLE, decided_s=11.0))

    assert not claims(agent.post(ON_THE_WAY))


def test_it_turns_to_what_a_lost_uav_was_flying_to() -> None:
    agent = LoneAgent(uav("u0"), uav("u1", east_m=30.0))
    agent.fly_to(FAR, ON_THE_WAY)
    plan = replace(epoch("u1", "u0", rule="guided"), routes={"u0": ("far",), "u1": ("new",)})
    agent.hear("u1", held("new", 0.0, completion_s=18.0))
    agent.hear("coordinator", plan, 0.0)
    agent.be_at((4.0, 0.0, 10.0))
    assert agent.task == "far"

    agent.lose("u1", 4.0)
    assert agent.task == "far", "somebody may have heard its last words"

    agent.learn()
    assert agent.task == "new"


def test_nobody_elses_change_of_mind_and_no_plan_turns_it() -> None:
    agent = on_its_way("u1")
    agent.hear("u1", held("new", 10.0, completion_s=50.0), 10.5)
    agent.post(ON_THE_WAY)
    assert agent.task == "far"

    plan = {"u0": ("new", "far")}
    agent.hear("u1", held("elsewhere0", 11.0, completion_s=900.0), 11.0)
    agent.hear("coordinator", replace(epoch("u0", "u1", rule="guided", number=2), routes=plan))

    assert agent.task == "far"


def test_it_turns_no_more_once_it_serves() -> None:
    agent = LoneAgent(uav("u0"))
    slow = replace(FAR, service_s=30.0)
    agent.fly_to(slow)
    plan = replace(epoch("u0", rule="guided"), routes={"u0": ("far",)})
    agent.hear("coordinator", plan, 0.0)
    agent.arrive(100.0)

    assert not claims(agent.post(entry("new", east_m=101.0, number=1, value=50.0)))
    assert agent.task == "far"
