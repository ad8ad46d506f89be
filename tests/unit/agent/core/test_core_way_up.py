"""One agent whose vehicle stands at a base and waits there for its way up."""

from __future__ import annotations

from dataclasses import replace

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import Arrived, GoTo, Hold, Return, Swap
from agent.core.states import AgentState
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind, TaskEntry
from swarm.protocol.uav_messages import BaseStage, Claim, ClaimedWay, ClaimPhase
from tests.support.builders import entry
from tests.support.field_agent import BASE, BUDGET_S, FAR_BASE, FieldAgent, Script, square
from tests.support.lone_agent import orders

BAND_M = 8.0, 12.0
FAR_AWAY = (-900.0, 0.0, 10.0)
ABOVE, ON_GROUND = (50.0, 0.0, 10.0), (50.0, 0.0, 0.0)
BEHIND = entry("t0", 100.0)
NEXT_BASE = replace(FAR_BASE, id="b1", position_enu_m=(50.0, 30.0, 0.0))


class WaitingOnGround:
    """``u0`` has got a full battery at 70 s, and sets off; ``u1`` hovers above its base.

    Unless that one hovers elsewhere then.
    """

    def __init__(
        self,
        script: Script,
        next_item: str,
        then_enu_m: Point = ABOVE,
        task: TaskEntry = BEHIND,
    ) -> None:
        self.agent = agent = FieldAgent("u1", bases=[BASE, NEXT_BASE])
        agent.brief = replace(agent.brief, separation_m=5.0, band_m=BAND_M)
        agent.fly_to(task, entry("t1", 0.0))
        self.other_is(FAR_AWAY)
        agent.be_at((0.0, 0.0, 10.0), None)
        script.items = ["base:b0"]
        agent.start_mission()
        agent.be_at(agent.flight.position_enu_m, None, 49.0)
        agent.arrive(50.0)
        agent.touch_down(51.0)
        agent.be_at(ON_GROUND, None, 69.0)
        self.other_is(then_enu_m)
        script.items = [next_item]
        self.since = len(orders(agent.log))
        agent.get_full(70.0)
        if then_enu_m == ABOVE:
            agent.be_at(ON_GROUND, None, 70.5)

    def other_is(self, place_enu_m: Point, **claims: object) -> None:
        """The other one hovers there."""
        said = Claim(ClaimPhase.IDLE, None, 0.0, 1, 0.0, way=ClaimedWay(0, (place_enu_m,), True))
        self.agent.hear("u1", replace(said, **claims))  # type: ignore[arg-type]  # real fields

    def flights(self) -> list[GoTo]:
        """Where it was sent since it set off."""
        return [o for o in orders(self.agent.log)[self.since :] if isinstance(o, GoTo)]

    def stands_as_before(self) -> None:
        """It is at its base, where somebody sees to its battery, and nowhere else."""
        assert self.flights() == []
        assert self.agent.state() is AgentState.SWAPPING
        assert isinstance(self.agent.last_order, Swap)
        assert self.agent.stage is BaseStage.LANDED
        claim = self.agent.claim
        assert claim is not None
        assert (claim.task, claim.base) == (None, "b0")
        assert claim.way is None or not claim.way.path_enu_m


def in_band(flight: GoTo) -> bool:
    """Whether all of it is as high as the fleet flies."""
    low_m, high_m = BAND_M
    return all(low_m <= up <= high_m for *_, up in (*flight.via_enu_m, flight.position_enu_m))


def test_who_loses_its_task_to_a_stronger_claim_stays_at_its_base(script: Script) -> None:
    waiting = WaitingOnGround(script, "t0")
    agent = waiting.agent
    assert (agent.task, agent.state()) == ("t0", AgentState.FLYING)
    assert waiting.flights() == []

    stronger = {"phase": ClaimPhase.HELD, "task": "t0", "completion_s": 90.0}
    waiting.other_is(ABOVE, **stronger)
    waiting.stands_as_before()

    waiting.other_is(FAR_AWAY, **stronger)
    script.items = ["t1"]
    agent.get_full(95.0)
    assert agent.flight.task == "t1"
    assert agent.flight.position_enu_m[:2] == (0.0, 0.0)
    assert in_band(agent.flight)


def test_who_loses_the_other_base_that_it_was_to_fly_to_stays_at_its_own(script: Script) -> None:
    waiting = WaitingOnGround(script, "base:b1")
    agent = waiting.agent
    assert agent.state() is AgentState.FLYING_TO_BASE

    agent.drawn(square("over", 50.0, 30.0), 71.0)

    waiting.stands_as_before()


def test_who_is_held_before_its_way_up_is_granted_stands_there_and_goes_on_from_there(
    script: Script,
) -> None:
    waiting = WaitingOnGround(script, "t0")
    agent = waiting.agent

    agent.told(CommandKind.HOLD, 71.0)
    waiting.other_is(FAR_AWAY)
    agent.be_at(ON_GROUND, None, 72.0)

    assert isinstance(agent.last_order, Hold)
    assert waiting.flights() == []
    assert (agent.phase, agent.stage) == (ClaimPhase.PAUSED, BaseStage.LANDED)
    agent.told(CommandKind.RESUME, 73.0)
    waiting.stands_as_before()


def test_who_is_sent_home_before_its_way_up_is_granted_lands_where_it_stands(
    script: Script,
) -> None:
    waiting = WaitingOnGround(script, "t0")
    agent = waiting.agent

    agent.told(CommandKind.RETURN, 71.0)

    home = agent.last_order
    assert isinstance(home, Return)
    assert home.via_enu_m == ABOVE
    assert home.land


def test_a_new_way_for_who_waits_on_the_ground_begins_in_its_layer_above(script: Script) -> None:
    waiting = WaitingOnGround(script, "t0")
    agent = waiting.agent
    agent.drawn(square("between", 75.0, 0.0), 71.0)
    waiting.other_is(FAR_AWAY)

    (flight,) = waiting.flights()
    assert in_band(flight)
    assert len(flight.via_enu_m) > 1


def test_who_loses_its_task_right_after_it_was_sent_off_stops_above_its_base(
    script: Script,
) -> None:
    """Its vehicle has not said yet that it has left the ground, where it came in a lower layer."""
    waiting = WaitingOnGround(script, "t0", then_enu_m=FAR_AWAY)
    agent = waiting.agent
    assert [flight.task for flight in waiting.flights()] == ["t0"]

    taken = {"phase": ClaimPhase.HELD, "task": "t0", "completion_s": 90.0}
    waiting.other_is(FAR_AWAY, **taken)
    assert agent.state() is AgentState.IDLE
    assert waiting.flights()[-1].leg == STOP_LEG
    agent.be_at(ABOVE, None, 71.0)
    agent.happen(Arrived(STOP_LEG))
    agent.run_until(75.0)

    assert waiting.flights()[-1].position_enu_m[:2] == (50.0, 0.0)
    assert all(in_band(flight) for flight in waiting.flights())


def test_a_sortie_begins_when_the_vehicle_leaves_the_ground_though_by_a_longer_way(
    script: Script,
) -> None:
    waiting = WaitingOnGround(script, "t0")
    agent = waiting.agent

    agent.run_until(74.0)
    waiting.other_is(FAR_AWAY)

    (flight,) = waiting.flights()
    assert flight.via_enu_m == ((50.0, 0.0, 8.0),)  # it has asked for another layer
    assert agent.claim is not None
    assert agent.claim.sortie_end_s == 74.0 + BUDGET_S


def test_who_waits_on_the_ground_uses_nothing_of_its_battery_up(script: Script) -> None:
    """Its battery would be too short by now if it had taken off when it asked for its way."""
    near = entry("t0", 52.0, service_s=BUDGET_S - 2.0 * 2.0 - 3.0)
    waiting = WaitingOnGround(script, "t0", task=near)
    agent = waiting.agent

    agent.run_until(77.0)
    assert (agent.task, waiting.flights()) == ("t0", [])
    waiting.other_is(FAR_AWAY)

    assert [flight.task for flight in waiting.flights()] == ["t0"]
    assert agent.claim is not None
    assert agent.claim.sortie_end_s == 77.0 + BUDGET_S
