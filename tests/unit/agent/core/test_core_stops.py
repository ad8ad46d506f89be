"""One agent whose vehicle stops on its way to ask for another one, or does not."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    HeardAgain,
    Held,
    NotReady,
    Refused,
    Return,
    ReturnBegun,
    VehicleOrder,
)
from agent.core.states import AgentState
from agent.core.stop_on_way import StopOnWay
from agent.core.wish import Wish
from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import CommandKind
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from tests.support.builders import entry
from tests.support.field_agent import FAR_BASE, FieldAgent, Script, square
from tests.support.lone_agent import orders
from tests.support.shut_air import SOON_S, Fleet

AHEAD = square("ahead", 60.0, 0.0)
"""A zone across the way to the task."""


def on_its_way(east_m: float = 20.0) -> FieldAgent:
    """It flies east at 1 m/s, to a task 100 m away."""
    agent = Fleet(entry("t0", 100.0)).agent
    agent.be_at((east_m, 0.0, 10.0), None, east_m)
    return agent


def since(agent: FieldAgent, ordered: int) -> Sequence[VehicleOrder]:
    """What it was told since it had been told so often."""
    return orders(agent.log)[ordered:]


def begins_m(agent: FieldAgent) -> float:
    """How far east the way is that it claims or asks for, where it begins."""
    claim = agent.claim
    assert claim is not None
    assert claim.way is not None
    return claim.way.path_enu_m[0][0]


@pytest.mark.parametrize("stands_m", [40.0, 44.0], ids=["where-told", "farther-on"])
def test_its_way_begins_where_it_has_stopped(stands_m: float) -> None:
    agent = on_its_way(40.0)
    agent.drawn(AHEAD, 40.0)
    stop = agent.flight
    assert (stop.leg, stop.position_enu_m[0]) == (STOP_LEG, 40.0)
    if stands_m > 40.0:  # it could not stop there
        agent.happen(Refused(stop, "not here"))
        agent.be_at((stands_m, 0.0, 10.0), None, stands_m)
        agent.run_until(stands_m + SOON_S)
        assert agent.flight.position_enu_m[0] == stands_m

    agent.be_at((stands_m, 0.0, 10.0), None, 46.0)
    agent.happen(Arrived(STOP_LEG))
    assert begins_m(agent) == stands_m
    agent.run_until(50.0)
    goes = agent.flight
    assert goes.task == "t0"
    corners = (*goes.via_enu_m, goes.position_enu_m)
    assert all(east_m >= stands_m for east_m, *_ in corners), corners  # nowhere back
    assert max(abs(north_m) for _, north_m, _ in corners) > 1.0  # round the zone


def test_who_is_heard_again_after_a_stop_that_never_ended_comes_home() -> None:
    agent = on_its_way()
    agent.drawn(AHEAD, 21.0)
    agent.happen(HandedOver("silent", silent=True), 22.0)
    ordered = len(orders(agent.log))
    agent.be_at((25.0, 0.0, 10.0), None, 29.0)
    agent.happen(HeardAgain("heard again"), 30.0)

    (stop,) = since(agent, ordered)
    assert stop == GoTo(STOP_LEG, (25.0, 0.0, 10.0))
    agent.happen(Arrived(STOP_LEG), 31.0)
    agent.run_until(33.0)
    assert isinstance(agent.last_order, Return)


@pytest.mark.parametrize("taken", [HandedOver("its pilot"), ReturnBegun()], ids=["pilot", "mode"])
def test_who_does_not_obey_any_more_is_not_told_to_stop(taken: HandedOver | ReturnBegun) -> None:
    agent = on_its_way()
    agent.drawn(AHEAD, 21.0)
    agent.happen(Refused(agent.flight, "not now"), 21.1)
    agent.happen(taken, 21.2)
    ordered = len(orders(agent.log))

    agent.run_until(60.0)
    assert [order for order in since(agent, ordered) if isinstance(order, GoTo)] == []


def test_who_could_not_make_room_stops_and_tries_again(script: Script) -> None:
    script.items = []
    agent = Fleet(entry("t0", 100.0)).agent
    agent.tick(20.0)

    way = ClaimedWay(20_000, ((0.0, -60.0, 10.0), (0.0, 60.0, 10.0)))
    agent.hear("u1", Claim(ClaimPhase.PROPOSED, "t0", 0.0, 1, 50.0, way=way))
    agent.run_until(22.0)
    aside = agent.flight
    assert aside.position_enu_m[:2] != (0.0, 0.0)
    agent.happen(Refused(aside, "out of its fence"), 22.5)
    agent.be_at((0.0, 0.0, 10.0), None, 22.6)
    agent.run_until(24.0)
    assert agent.flight == GoTo(STOP_LEG, (0.0, 0.0, 10.0))
    agent.happen(Arrived(STOP_LEG), 24.5)
    assert agent.flight == aside


def test_each_refusal_is_followed_by_a_longer_wait_until_it_stops() -> None:
    halt, now_s, waits_s = StopOnWay(0.5), 0.0, []
    for _ in range(6):
        halt.begin((0.0, 0.0, 10.0))
        halt.refused(now_s)
        assert halt.again_s is not None
        waits_s.append(halt.again_s - now_s)
        now_s = halt.again_s
        assert halt.is_due(now_s)
    assert waits_s == [0.5, 1.0, 2.0, 4.0, 8.0, 8.0]
    halt.begin((0.0, 0.0, 10.0))
    assert halt.end() is not None
    halt.refused(now_s)
    assert halt.again_s == now_s + 0.5


def test_who_asks_where_its_way_ends_has_flown_a_part_of_what_it_reckoned() -> None:
    wish = Wish(GoTo(3, (90.0, 0.0, 10.0)), 5.0, ((0.0, 0.0, 10.0),), takes_s=30.0)
    wish.goes_on(17.0)
    assert (wish.since_s, wish.takes_s) == (17.0, 18.0)
    wish.goes_on(math.inf)
    assert wish.takes_s == 0.0


def test_who_is_held_on_the_ground_with_a_low_battery_stays_in_the_mission() -> None:
    agent = FieldAgent("u1", bases=[FAR_BASE])
    agent.see(COORDINATOR, "u1")
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(NotReady("battery at 19%"))
    agent.told(CommandKind.HOLD, -50.0)
    agent.happen(Held())

    agent.be_at((0.0, 0.0, 0.0), 0.19, -40.0)
    agent.tick(-39.0)
    assert agent.state() is AgentState.PAUSED
