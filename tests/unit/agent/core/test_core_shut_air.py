"""One agent that waits for air that another takes: a line that closes, zones drawn over it."""

from __future__ import annotations

import pytest

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import Arrived, GoTo, Refused, Return, VehicleReady
from agent.core.last_departure import LEAVES_ZONE_S
from agent.core.states import AgentState
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import LinkChanged
from swarm.protocol.messages import CommandKind
from swarm.protocol.uav_messages import ClaimPhase
from tests.support.builders import entry
from tests.support.field_agent import FieldAgent, Script, square
from tests.support.lone_agent import claims, notes, orders
from tests.support.shut_air import FAR_AWAY, SOON_S, Fleet

ACROSS = ((30.0, -80.0, 10.0), (30.0, 80.0, 10.0))
"""Between where this one is and what lies east of it."""
OVER = square("over", 0.0, 0.0, 8.0)
"""A zone around where it hovers."""
ROUND = tuple((*OVER.polygon_enu_m[corner], 10.0) for corner in (0, 1, 2, 3, 0))
"""All along the border of that."""
LINE = ((20.0, 0.0, 0.0), (90.0, 0.0, 0.0))


def at_a_line(fleet: Fleet) -> FieldAgent:
    """It has arrived where a line begins, 2 s before that closes."""
    agent = fleet.agent
    agent.be_at((20.0, 0.0, 10.0), None, 20.0)
    agent.arrive(20.0)
    assert agent.state() is AgentState.SERVING
    return agent


def to_a_line(script: Script) -> Fleet:
    """It is on its way there."""
    script.items = ["t0"]
    fleet = Fleet(entry("t0", 20.0, path_enu_m=LINE, closes_s=22.0))
    fleet.agent.run_until(19.0)
    return fleet


def test_a_line_to_which_the_air_is_free_too_late_is_given_up(script: Script) -> None:
    fleet = to_a_line(script)
    fleet.other_flies(*ACROSS)
    agent = at_a_line(fleet)

    agent.run_until(21.9)
    assert agent.state() is AgentState.SERVING
    agent.run_until(22.1)
    fleet.other_flies(*FAR_AWAY)
    agent.run_until(24.0)

    assert agent.state() is AgentState.IDLE
    assert agent.flight.position_enu_m[0] == 20.0


def test_a_line_that_was_begun_in_time_is_flown_to_its_end(script: Script) -> None:
    agent = at_a_line(to_a_line(script))

    agent.run_until(60.0)

    assert agent.state() is AgentState.SERVING
    assert agent.flight.position_enu_m[0] == 90.0


def test_who_knows_too_little_to_decide_leaves_a_new_zone_all_the_same(script: Script) -> None:
    fleet = Fleet()
    agent = fleet.agent
    agent.happen(LinkChanged(False), 1.0)
    agent.happen(LinkChanged(True), 9.0)
    before, turns = len(orders(agent.log)), len(script.turns)

    agent.drawn(OVER, 9.1)

    (left,) = fleet.flights(before)
    assert max(map(abs, left.position_enu_m[:2])) == pytest.approx(8.0, abs=0.01)
    assert len(script.turns) == turns
    agent.run_until(9.3)
    assert len(fleet.flights(before)) == 1


def test_who_waits_in_a_zone_for_a_longer_way_leaves_it_first(script: Script) -> None:
    fleet = Fleet(entry("t0", 100.0))
    agent = fleet.agent
    fleet.other_flies(*ACROSS)
    before = len(orders(agent.log))
    script.items = ["t0"]

    agent.drawn(OVER, 5.0)
    assert agent.task == "t0"
    assert fleet.flights(before) == []
    agent.run_until(5.0 + SOON_S)

    (left,) = fleet.flights(before)
    assert left.leg == STOP_LEG
    out_enu_m = left.position_enu_m
    assert max(map(abs, out_enu_m[:2])) == pytest.approx(8.0, abs=0.01)
    agent.be_at(out_enu_m, None, 14.0)
    agent.happen(Arrived(STOP_LEG))
    agent.run_until(14.5)
    fleet.other_flies(*FAR_AWAY)
    assert agent.flight.task == "t0"
    assert all(max(map(abs, via[:2])) >= 7.99 for via in agent.flight.via_enu_m)


def test_who_finds_no_way_out_of_a_zone_lands_whatever_it_wished_meanwhile(
    script: Script,
) -> None:
    fleet = Fleet(entry("t0", 100.0))
    agent = fleet.agent
    agent.happen(LinkChanged(False), 1.0)
    agent.happen(LinkChanged(True), 5.0)
    fleet.other_flies(*ROUND)
    agent.drawn(OVER, 5.1)
    script.items = ["t0"]
    agent.run_until(7.0)
    assert agent.task is None
    agent.learn()
    agent.learn()
    assert agent.task == "t0"

    agent.run_until(5.1 + LEAVES_ZONE_S - 0.1)
    assert agent.state() is AgentState.FLYING
    agent.run_until(5.1 + LEAVES_ZONE_S + SOON_S)

    order = agent.last_order
    assert isinstance(order, Return)
    assert order.land
    assert "lands where it is" in notes(agent.log)


def test_who_flies_round_a_zone_goes_on_round_where_it_was_once_that_is_gone(
    script: Script,
) -> None:
    """Another way has to be asked for from a stop, which takes longer than it saves."""
    fleet = Fleet(entry("t0", 100.0))
    agent = fleet.agent
    script.items = ["t0"]
    agent.drawn(square("between", 50.0, 0.0), 1.0)
    round_it = agent.flight
    assert round_it.task == "t0"
    assert round_it.via_enu_m
    agent.be_at((20.0, 0.0, 10.0), None, 20.0)
    before = len(orders(agent.log))

    agent.drawn(square("between", 50.0, 0.0), 21.0, withdrawn=True)
    assert orders(agent.log)[before:] == []

    agent.drawn(square("between", 60.0, 0.0), 22.0)
    assert fleet.flights(before)[0].leg == STOP_LEG


def sent_home_in_a_zone() -> tuple[Fleet, GoTo, int]:
    """It is told to fly home just before it is out of a zone, by where it leaves that.

    Also gives where it is sent first, and how often it has been sent anywhere since.
    """
    fleet = Fleet()
    agent = fleet.agent
    agent.happen(LinkChanged(False), 1.0)
    agent.happen(LinkChanged(True), 9.0)
    agent.be_at((-6.0, 0.0, 10.0), None, 9.0)
    agent.drawn(OVER, 9.1)
    out, since = agent.flight, len(orders(agent.log))
    agent.be_at((-7.0, 0.0, out.position_enu_m[2]), None, 10.0)
    agent.told(CommandKind.RETURN, 10.0)
    return fleet, out, since


def test_who_is_sent_on_from_where_it_flies_to_flies_there_and_asks_there() -> None:
    fleet, out, since = sent_home_in_a_zone()
    agent = fleet.agent
    assert orders(agent.log)[since:] == []

    agent.be_at(out.position_enu_m, None, 11.0)
    agent.happen(Arrived(out.leg))
    agent.run_until(12.0)

    (home,) = orders(agent.log)[since:]
    assert isinstance(home, Return)
    claim = agent.core.replica.claims["u0"]
    assert claim.way is not None
    assert claim.way.path_enu_m[0][0] == pytest.approx(-8.0, abs=0.01)


def test_who_may_not_fly_there_after_all_stops_to_ask() -> None:
    fleet, out, since = sent_home_in_a_zone()

    fleet.agent.happen(Refused(out, "not now"))
    fleet.agent.run_until(10.0 + SOON_S)

    (stopped,) = fleet.flights(since)
    assert stopped.leg == STOP_LEG
    assert stopped.position_enu_m[0] == -7.0


def test_who_may_not_stop_is_told_again_where_it_has_come_to_and_not_at_once() -> None:
    fleet = Fleet(entry("t0", 100.0))
    agent = fleet.agent
    agent.be_at((40.0, 0.0, 10.0), None, 40.0)
    agent.told(CommandKind.RETURN, 40.0)
    stop, since = agent.flight, len(orders(agent.log))
    assert (stop.leg, stop.position_enu_m[0]) == (STOP_LEG, 40.0)

    for east_m, refused in ((42.0, stop), (44.0, GoTo(STOP_LEG, (42.0, 0.0, 10.0)))):
        agent.happen(Refused(refused, "not here"))
        assert fleet.flights(since) == []
        agent.be_at((east_m, 0.0, 10.0), None, east_m)
        agent.run_until(east_m + SOON_S)
        (again,) = fleet.flights(since)
        assert (again.leg, again.position_enu_m[0]) == (STOP_LEG, east_m)
        since = len(orders(agent.log))

    agent.happen(Arrived(STOP_LEG))
    agent.run_until(46.0)
    assert isinstance(agent.last_order, Return)


def test_who_waits_for_its_way_holds_its_task_in_the_word_of_its_departure(script: Script) -> None:
    fleet = Fleet(entry("t0", 100.0))
    agent = fleet.agent
    fleet.other_flies(*ACROSS)
    script.items = ["t1"]
    agent.post(entry("t1", 100.0))
    assert (agent.task, agent.phase) == ("t1", ClaimPhase.PROPOSED)
    assert agent.core.is_contested
    agent.run_until(3.0)
    assert claims(agent.log)[-1].phase is ClaimPhase.PROPOSED
    assert not agent.core.is_contested
    assert agent.core.next_own_deadline_s() is None
    before = len(claims(agent.log))

    fleet.other_flies(*FAR_AWAY)
    agent.run_until(3.0 + SOON_S)

    assert agent.flight.task == "t1"
    told = claims(agent.log)[before:]
    departs = [claim for claim in told if claim.way is not None and claim.way.flies]
    assert {claim.phase for claim in departs} == {ClaimPhase.HELD}
    assert agent.phase is ClaimPhase.HELD


def test_who_waited_for_its_way_in_an_earlier_life_does_not_take_it_for_granted(
    script: Script,
) -> None:
    fleet = Fleet(entry("t0", 100.0))
    fleet.other_flies(*ACROSS)
    script.items = ["t1"]
    fleet.agent.post(entry("t1", 100.0))
    fleet.agent.run_until(3.0)

    agent = fleet.agent.reborn()
    agent.see(COORDINATOR, "u1")
    agent.learn_what_was_known_to(fleet.agent)
    agent.be_at((0.0, 0.0, 10.0))
    agent.happen(VehicleReady())

    assert agent.task == "t1"
    assert [order.leg for order in orders(agent.log) if isinstance(order, GoTo)] == [STOP_LEG]
