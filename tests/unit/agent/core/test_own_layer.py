"""Who has left its height layer where UAVs are kept apart, and at which heights it flies on."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import Arrived, Held, VehicleReady
from agent.core.mission_view import MissionView
from agent.core.own_layer import OwnLayer
from swarm.model.ids import OPERATOR
from swarm.protocol.messages import CommandKind, OperatorCommand, TaskEntry
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from tests.support.builders import entry
from tests.support.field_agent import FieldAgent, Script

LAYERS_M = (10.0, 17.0, 24.0)
"""Of a band of 20 m, 5 m apart and 2 m for errors."""
HIGH_M = 45.0
FAR, IN_THE_WAY = (500.0, 0.0, 17.0), (60.0, 4.0, 22.0)
"""Where the other one hovers: the latter in the way of a slant, and of the middle layer."""


def grant(agent: FieldAgent, hovers_enu_m: tuple[float, float, float]) -> None:
    """The other one, which hovers there, grants what is asked for."""
    claim = agent.core.replica.claims["u0"]
    grants = {} if claim.way is None else {"u0": claim.way.number}
    way = ClaimedWay(1, (hovers_enu_m,), flies=True, grants=grants)
    agent.hear("u1", Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=way))


def apart(script: Script, **task: object) -> FieldAgent:
    """It has just set off for `t0`, 20 m away, in the middle layer."""
    agent = FieldAgent("u1", bases=[])
    specs = tuple(replace(spec, layer_m=17.0) for spec in agent.brief.uavs)
    agent.brief = replace(agent.brief, uavs=specs, separation_m=5.0, band_m=(10.0, 30.0))
    agent.fly_to(replace(entry("t0", 20.0), **task))  # type: ignore[arg-type]
    agent.be_at((0.0, 0.0, 17.0), None)
    script.items = ["t0"]
    agent.start_mission()
    grant(agent, FAR)
    return agent


def hold_and_resume(agent: FieldAgent, at_enu_m: tuple[float, float, float]) -> None:
    """Where it is held there is nothing for it to do."""
    agent.hear(OPERATOR, OperatorCommand("u0", CommandKind.HOLD, 1, ""))
    agent.be_at(at_enu_m, None)
    agent.happen(Held())
    agent.hear(OPERATOR, OperatorCommand("u0", CommandKind.RESUME, 1, ""))
    agent.happen(VehicleReady())
    grant(agent, IN_THE_WAY)
    assert agent.flight.task is None
    agent.happen(Arrived(agent.flight.leg))


def heights_m(agent: FieldAgent) -> set[float]:
    """Of the way that it claims, but for where that begins."""
    claim = agent.core.replica.claims["u0"]
    assert claim.way is not None
    return {round(up_m, 6) for _, _, up_m in claim.way.path_enu_m[1:]}


def assert_flies_on_in_layers(
    agent: FieldAgent, script: Script, task: TaskEntry, mission_s: float
) -> None:
    """A task appears then, and it asks for a way there."""
    script.items = [task.task]
    agent.post(task)
    agent.tick(mission_s)

    assert agent.task == task.task
    assert heights_m(agent)
    assert heights_m(agent) <= {*LAYERS_M}


def test_who_hovers_at_a_height_of_its_task_flies_on_in_layers(script: Script) -> None:
    agent = apart(script, height_m=HIGH_M)
    agent.be_at((20.0, 0.0, HIGH_M), None)
    agent.arrive(30.0)
    hold_and_resume(agent, (20.0, 0.0, HIGH_M))

    assert_flies_on_in_layers(agent, script, entry("t1", 80.0, number=1), 40.0)


def test_who_was_stopped_on_a_slant_from_one_flies_on_in_layers(script: Script) -> None:
    agent = apart(script, height_m=HIGH_M)
    agent.be_at((20.0, 0.0, HIGH_M), None)
    script.items = ["t1"]
    agent.post(entry("t1", 20.0, number=1, position_enu_m=(20.0, 40.0, 0.0)))
    agent.arrive(30.0)
    grant(agent, FAR)
    assert heights_m(agent) == {17.0}, "straight"
    hold_and_resume(agent, (20.0, 20.0, 31.0))

    assert_flies_on_in_layers(agent, script, entry("t2", 80.0, number=2), 60.0)


@pytest.mark.parametrize(("up_m", "misses"), [(17.0, False), (24.5, True), (14.9, True)])
def test_a_layer_lies_above_all_that_is_visited(script: Script, up_m: float, misses: bool) -> None:
    """From the lowest of it, at 0 m, to the highest, at 5 m, and 2 m more for errors."""
    agent = apart(script, position_enu_m=(20.0, 0.0, 5.0))
    replica = agent.core.replica
    layer = OwnLayer(replica, MissionView("m", "u0", replica))

    assert layer.misses((3.0, 4.0, up_m)) is misses
    assert layer.above((3.0, 4.0, up_m)) == (3.0, 4.0, 17.0)


@pytest.mark.parametrize(("up_m", "over"), [(17.0, True), (-1.0, True), (-2.5, False)])
def test_nobody_is_led_below_all_that_is_visited(script: Script, up_m: float, over: bool) -> None:
    """It is at 0 m, 2 m less for errors."""
    agent = apart(script)
    layer = OwnLayer(agent.core.replica, MissionView("m", "u0", agent.core.replica))

    assert layer.is_over([(0.0, 0.0, 17.0), (3.0, 4.0, up_m)]) is over


def test_a_task_that_asks_for_a_height_below_the_origin_is_flown_there(script: Script) -> None:
    """In a quarry, say, on whose rim the fleet starts; its place on the map has no height."""
    agent = apart(script, height_m=-20.0)

    assert agent.flight.task == "t0"
    assert agent.flight.position_enu_m == (20.0, 0.0, -20.0)
