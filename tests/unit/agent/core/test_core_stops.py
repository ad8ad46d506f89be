"""One agent whose vehicle stops on its way to ask for another one, or does not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from agent.core.fleet_air import STOP_LEG
from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    HeardAgain,
    Held,
    MotorsRun,
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
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind, TaskEntry
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from tests.support.builders import entry
from tests.support.field_agent import FAR_BASE, FieldAgent, Script, square
from tests.support.lone_agent import orders
from tests.support.shut_air import FAR_AWAY, SOON_S, Fleet

BESIDE_FAR_AWAY = ((-900.0, 50.0, 10.0),)
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
    agent.happen(Refused(GoTo(STOP_LEG, (21.0, 0.0, 10.0)), "said before that"), 21.3)
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


def test_who_is_refused_to_make_room_again_and_again_tries_more_and_more_seldom(
    script: Script,
) -> None:
    script.items = []
    agent = Fleet(entry("t0", 100.0)).agent
    agent.tick(20.0)
    here, told = (0.0, 0.0, 10.0), len(orders(agent.log))
    way = ClaimedWay(20_000, ((0.0, -60.0, 10.0), (0.0, 60.0, 10.0)))
    agent.hear("u1", Claim(ClaimPhase.PROPOSED, "t0", 0.0, 1, 50.0, way=way))
    tried_s: list[float] = []
    for tenth in range(200, 800):
        agent.run_until(tenth / 10.0)
        news = since(agent, told)
        told += len(news)
        for order in news:
            assert isinstance(order, GoTo)
            if order.position_enu_m == here:
                agent.happen(Arrived(STOP_LEG))
            else:
                tried_s.append(tenth / 10.0)
                agent.happen(Refused(order, "out of its fence"))
            agent.be_at(here, None)
    assert 6 <= len(tried_s) <= 12, tried_s


class Crowd:
    """The agent of ``u0`` among two others, who grant what it asks for when they are told to."""

    def __init__(self, task: TaskEntry, band_m: tuple[float, float]) -> None:
        self.agent = FieldAgent("u1", "u2", bases=[FAR_BASE])
        self.agent.brief = replace(self.agent.brief, separation_m=5.0, band_m=band_m)
        self.agent.fly_to(task)
        self.ways = {
            "u1": ClaimedWay(0, FAR_AWAY, flies=True),
            "u2": ClaimedWay(0, BESIDE_FAR_AWAY),
        }
        self.say("u2", flies=True)
        self.agent.be_at((0.0, 0.0, 10.0), None)
        self.agent.start_mission()

    def say(self, writer: str, *path: Point, flies: bool, grants: int = 0) -> None:
        """That one flies along ``path``, or asks for it, or says the same again."""
        number = 0 if flies else 1
        way = ClaimedWay(number, path or self.ways[writer].path_enu_m, flies=flies)
        self.ways[writer] = way
        for who, its in self.ways.items():
            told = replace(its, grants={"u0": grants} if grants else {})
            self.agent.hear(who, Claim(ClaimPhase.IDLE, None, 0.0, 1, 0.0, way=told))

    def grant(self) -> None:
        """Both grant what it asks for."""
        claim = self.agent.claim
        assert claim is not None
        assert claim.way is not None
        self.say("u2", flies=self.ways["u2"].flies, grants=claim.way.number)


@pytest.mark.parametrize("refused", [False, True], ids=["aside", "on-its-way-aside"])
@pytest.mark.parametrize(
    ("height_m", "highest_m"),
    [(60.0, 12.0), (60.0, 60.0), (None, 12.0)],
    ids=["high", "straight-down", "in-its-layer"],
)
def test_who_has_made_room_where_its_line_begins_flies_all_of_it(
    script: Script, height_m: float | None, highest_m: float, refused: bool
) -> None:
    script.items = ["t0"]
    line = ((20.0, 0.0, 0.0), (90.0, 0.0, 0.0))
    crowd = Crowd(entry("t0", 20.0, path_enu_m=line, height_m=height_m), (8.0, highest_m))
    agent = crowd.agent
    crowd.grant()
    agent.run_until(1.0)
    begins_m = agent.flight.position_enu_m
    up_m = begins_m[2]
    heights_m = (up_m,) if height_m else (8.0, 12.0)
    shut = [(60.0, side_m, at_m) for at_m in heights_m for side_m in (-80.0, 80.0)]
    crowd.say("u1", *shut, *shut[:1], flies=True)
    agent.be_at(begins_m, None, 20.0)
    agent.arrive(20.0)
    agent.run_until(22.0)
    ordered = len(orders(agent.log))
    crowd.say("u2", (20.0, -80.0, up_m), (20.0, 80.0, up_m), flies=False)
    agent.run_until(23.0)
    crowd.grant()
    agent.run_until(23.5)
    (aside,) = since(agent, ordered)
    assert isinstance(aside, GoTo)
    assert aside.task is None
    stands_m = aside.position_enu_m
    if refused:
        stands_m = (20.0 + 0.6 * (stands_m[0] - 20.0), 0.6 * stands_m[1], stands_m[2])
        agent.be_at(stands_m, None, 25.0)
        agent.happen(Refused(aside, "not taken"))
        agent.run_until(27.0)
        crowd.say("u2", *BESIDE_FAR_AWAY, flies=True)
    agent.be_at(stands_m, None, 28.0)
    agent.happen(Arrived(STOP_LEG))
    crowd.say("u1", *FAR_AWAY, flies=True)
    crowd.say("u2", *BESIDE_FAR_AWAY, flies=True)
    for at_s in (29.0, 30.0, 31.0, 34.0):
        agent.run_until(at_s)
        crowd.grant()

    flown = agent.flight
    assert flown.task == "t0"
    assert min(math.dist(begins_m[:2], each[:2]) for each in (*flown.via_enu_m, stands_m)) < 0.1
    if height_m:  # at its own height from there on
        assert begins_m in flown.via_enu_m, flown


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


def test_who_is_held_as_it_takes_off_comes_home_by_its_battery() -> None:
    agent = FieldAgent("u1", bases=[FAR_BASE])
    agent.see(COORDINATOR, "u1")
    agent.learn(agent.statement(COORDINATOR, agent.brief))
    agent.happen(MotorsRun(ours=True))
    agent.told(CommandKind.HOLD, -50.0)
    agent.happen(Held())

    agent.be_at((0.0, 0.0, 5.0), 0.19, -40.0)
    agent.tick(-39.0)
    assert agent.state() is AgentState.RETURNING_VIA_START
