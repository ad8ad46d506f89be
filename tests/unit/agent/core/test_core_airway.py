"""What one agent says of the air that it takes, where UAVs are kept apart."""

from __future__ import annotations

from dataclasses import replace

from agent.core.interface import Held, Home, MotorsRun, Prepare, VehicleReady
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.messages import CommandKind, OperatorCommand
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.shared_air import SharedAir, air_of_brief
from swarm.separation.taken_ways import is_home
from tests.support.builders import uav
from tests.support.lone_agent import ABOVE_START, LoneAgent, orders

THROUGH = ((-50.0, 0.0, 10.0), ABOVE_START, (50.0, 0.0, 10.0))
"""A way through where ``u0`` is to hover."""


def on_the_ground() -> LoneAgent:
    """``u0`` of two that are to keep 5 m apart has been told to get ready."""
    agent = LoneAgent(uav("u0"), uav("u1", east_m=-50.0))
    agent.brief = replace(agent.brief, separation_m=5.0)
    agent.see(COORDINATOR, "u1")
    actions = agent.learn(agent.statement(COORDINATOR, agent.brief))
    assert [type(order) for order in orders(actions)] == [Prepare]
    return agent


def command(agent: LoneAgent, kind: CommandKind, number: int = 1) -> None:
    target = FLEET if kind is CommandKind.ABORT else "u0"
    agent.hear(OPERATOR, OperatorCommand(target, kind, number, ""))


def own_claim(agent: LoneAgent) -> Claim:
    return agent.core.replica.claims["u0"]


def lets_through(agent: LoneAgent) -> bool:
    """Whether whoever keeps that air grants somebody else a way through where it is to hover."""
    air = air_of_brief(agent.brief)
    assert isinstance(air, SharedAir)
    asks = Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=ClaimedWay(1, THROUGH))
    claims = {**agent.core.replica.claims, "u1": asks}
    return any(air.granted(keeper, claims, {"u0", "u1"}, ()) for keeper in ("u0", "u1"))


def test_who_is_held_before_it_takes_off_keeps_the_air_above_its_start() -> None:
    agent = on_the_ground()

    command(agent, CommandKind.HOLD)
    agent.happen(Held())

    assert own_claim(agent).phase is ClaimPhase.PAUSED
    assert not lets_through(agent)
    command(agent, CommandKind.RESUME)
    agent.happen(VehicleReady())
    way = own_claim(agent).way
    assert way is not None
    assert (way.path_enu_m, way.flies, way.grounded) == ((ABOVE_START,), True, False)


def test_a_later_life_of_one_that_was_held_on_the_ground_keeps_that_air_too() -> None:
    before = on_the_ground()
    command(before, CommandKind.HOLD)

    agent = before.reborn()
    agent.see(COORDINATOR, "u1")
    agent.learn_what_was_known_to(before)

    assert own_claim(agent).phase is ClaimPhase.PAUSED
    assert not lets_through(agent)


def test_who_ends_without_having_taken_off_keeps_no_air() -> None:
    agent = on_the_ground()

    command(agent, CommandKind.ABORT)

    assert is_home(own_claim(agent))


def test_who_may_be_on_its_way_up_keeps_that_air_until_it_has_landed() -> None:
    agent = on_the_ground()
    agent.happen(MotorsRun(ours=True))

    command(agent, CommandKind.RETURN)

    assert own_claim(agent).phase is ClaimPhase.OUT
    assert not lets_through(agent)
    agent.happen(Home())
    assert is_home(own_claim(agent))


def test_who_may_have_set_off_in_an_earlier_life_keeps_the_way_that_it_asked_for() -> None:
    """That life may have died before it said so."""
    before = on_the_ground()
    asked = ClaimedWay(5, (ABOVE_START, (40.0, 0.0, 10.0)))
    agent = before.reborn()
    agent.see(COORDINATOR, "u1")
    said = agent.statement("u0", Claim(ClaimPhase.HELD, "t0", 1.0, 0, 9.0, way=asked))
    agent.learn(agent.statement(COORDINATOR, agent.brief), said)

    command(agent, CommandKind.HOLD)
    agent.happen(Held())

    way = own_claim(agent).way
    assert way is not None
    assert own_claim(agent).phase is ClaimPhase.PAUSED
    assert (way.path_enu_m, way.number, way.flies) == (asked.path_enu_m, 5, False)
