"""A UAV that visits a base, brought to each stage of the visit."""

from __future__ import annotations

from dataclasses import replace

from agent.core.states import AgentState
from swarm.protocol.uav_messages import BaseStage
from tests.support.builders import entry
from tests.support.field_agent import (
    BUDGET_S,
    FAR_BASE,
    FieldAgent,
    Script,
    visiting,
)

ABOVE_BASE = (50.0, 0.0, 10.0)


NEAR_BASE = replace(FAR_BASE, id="b1", position_enu_m=(50.0, 30.0, 0.0), slots=1)


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
