"""Flights under constraints: round zones, within windows, along lines, on one battery."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.flights import Flights
from agent.core.interface import Arrived, GoTo, Hold, NotReady, Refused, Return
from agent.core.states import AgentState
from swarm.model.ids import FLEET, OPERATOR
from swarm.protocol.field_messages import BaseSpec
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, TaskEntry
from swarm.protocol.uav_messages import AttemptResult, BaseStage, ClaimPhase
from tests.support.builders import entry, epoch
from tests.support.field_agent import (
    BASE,
    BUDGET_S,
    ENDURANCE_S,
    FAR_BASE,
    FieldAgent,
    Script,
    square,
)
from tests.support.lone_agent import ABOVE_START, claims, notes, orders, statuses

WALL = square("wall", 50.0, 0.0)
LINE = ((100.0, 0.0, 0.0), (100.0, 20.0, 0.0), (100.0, 50.0, 0.0))


def flying(script: Script, item: str = "t0", **task: object) -> FieldAgent:
    """It has just set off for `t0`, 100 m away and 5 s long, at mission time 0."""
    agent = FieldAgent(bases=[FAR_BASE])
    agent.fly_to(replace(entry("t0", 100.0, service_s=5.0), **task))  # type: ignore[arg-type]
    agent.be_at((0.0, 0.0, 10.0), None)
    script.items = [item]
    agent.start_mission()
    assert agent.state() is AgentState.FLYING
    return agent


def about_to_arrive(script: Script, base: BaseSpec, *others: TaskEntry) -> FieldAgent:
    """In a second it is at `t0`, 40 m away, which is all that it finds to do."""
    agent = FieldAgent(bases=[base])
    agent.fly_to(entry("t0", 40.0), *others)
    script.items = ["t0"]
    agent.start_mission()
    agent.run_until(39.0)
    return agent


def test_why_it_was_not_ready_is_told_no_more_once_it_is_there(script: Script) -> None:
    """From a base the vehicle gets ready on its way, and says so by arriving."""
    agent = flying(script)
    agent.happen(NotReady("climbing to 16 m"))
    agent.run_until(99.0)
    assert statuses(agent.log)[-1].note == "climbing to 16 m"

    agent.arrive(100.0)
    agent.run_until(101.0)

    assert agent.state() is AgentState.SERVING
    assert statuses(agent.log)[-1].note == ""


def test_it_flies_round_a_zone_as_it_reckons(script: Script) -> None:
    agent = FieldAgent(bases=[FAR_BASE], zones=[WALL])
    agent.fly_to(entry("t0", 100.0))
    script.items = ["t0"]
    agent.start_mission()

    flight, claim = agent.flight, agent.claim
    assert flight.position_enu_m == (100.0, 0.0, 10.0)
    assert {abs(north_m) for _, north_m, _ in flight.via_enu_m} == {5.0}
    assert [up_m for _, _, up_m in flight.via_enu_m] == [10.0, 10.0]
    assert claim is not None
    assert claim.completion_s > 100.0


def test_without_constraints_it_decides_as_ever(script: Script) -> None:
    agent = FieldAgent(bases=[], endurance_s=None)
    agent.fly_to(entry("t0", 100.0))
    agent.start_mission()

    assert script.turns == []
    assert agent.task == "t0"
    assert agent.claim is not None
    assert (agent.claim.sortie_end_s, agent.claim.reversed) == (None, None)
    agent.end_mission(1.0)
    assert agent.way_home == Return("over", False, ABOVE_START)


# -- windows ---------------------------------------------------------------------------


def test_it_waits_at_its_task_until_that_opens(script: Script) -> None:
    agent = flying(script, opens_s=150.0)
    assert agent.claim is not None
    assert agent.claim.completion_s == 155.0
    agent.run_until(99.0)

    agent.arrive(100.0)

    agent.run_until(154.9)
    assert agent.state() is AgentState.SERVING
    agent.run_until(155.0)
    assert (agent.outcome.result, agent.outcome.completed_s) == (AttemptResult.DONE, 155.0)


@pytest.mark.parametrize(
    ("limits", "in_time_s"), [({"closes_s": 110.0}, 110.0), ({"due_s": 115.0}, 110.0)]
)
def test_who_comes_too_late_does_not_begin(
    script: Script, limits: dict[str, float], in_time_s: float
) -> None:
    agent = flying(script, "t0", **limits)
    agent.run_until(99.0)
    agent.arrive(in_time_s)
    assert agent.state() is AgentState.SERVING

    late = flying(script, "t0", **limits)
    late.run_until(in_time_s + 0.01)

    assert late.state() is AgentState.IDLE
    assert "released" in notes(late.log)


# -- lines -----------------------------------------------------------------------------


@pytest.mark.parametrize("backwards", [False, True])
def test_it_flies_a_line_from_end_to_end(script: Script, backwards: bool) -> None:
    item = "-t0" if backwards else "t0"
    agent = flying(script, item, path_enu_m=LINE, opens_s=200.0)
    first, last = (LINE[2], LINE[0]) if backwards else (LINE[0], LINE[2])
    assert agent.flight.position_enu_m[:2] == first[:2]
    assert agent.claim is not None
    assert agent.claim.reversed is backwards
    agent.run_until(119.0)
    agent.arrive(120.0)

    agent.run_until(199.9)
    assert agent.flight.position_enu_m[:2] == first[:2]
    agent.run_until(200.0)
    assert agent.flight.position_enu_m == (*last[:2], 10.0)
    assert agent.flight.via_enu_m == ((100.0, 20.0, 10.0),)
    assert agent.flight.task == "t0"
    agent.run_until(249.0)
    agent.arrive(250.0)
    agent.run_until(255.0)

    assert (agent.outcome.completed_s, agent.outcome.reversed) == (255.0, backwards)


def test_late_news_of_the_way_to_a_line_is_not_its_end(script: Script) -> None:
    agent = flying(script, path_enu_m=LINE)
    to_line = agent.leg
    agent.run_until(99.0)
    agent.arrive(100.0)

    agent.happen(Arrived(to_line), 101.0)
    agent.run_until(120.0)

    assert agent.state() is AgentState.SERVING


def test_a_task_with_its_own_height_is_flown_there(script: Script) -> None:
    agent = flying(script, height_m=60.0)

    assert agent.flight.position_enu_m == (100.0, 0.0, 60.0)


def test_who_hovers_at_a_tasks_own_height_reckons_from_there(script: Script) -> None:
    agent = flying(script, height_m=60.0)
    agent.run_until(99.0)
    agent.arrive(100.0)
    agent.be_at((100.0, 0.0, 60.0), None, 101.0)

    agent.run_until(106.0)

    assert script.turns[-1].now_s == 105.0
    assert script.turns[-1].place_enu_m == (100.0, 0.0, 60.0)


def test_who_flies_on_from_there_is_in_its_layer_again(script: Script) -> None:
    agent = flying(script, height_m=60.0)
    agent.post(entry("t1", 200.0))
    agent.run_until(99.0)
    script.items = ["t1"]
    agent.arrive(100.0)
    agent.run_until(105.0)
    assert agent.task == "t1"
    agent.be_at((110.0, 0.0, 20.0), None, 106.0)

    agent.post(entry("t1", 200.0, withdrawn=True))

    assert script.turns[-1].place_enu_m == (110.0, 0.0, 10.0)


# -- zones drawn in flight ----------------------------------------------------------------


def test_a_zone_drawn_before_it_is_flown_round_at_once(script: Script) -> None:
    agent = flying(script)
    first = agent.flight
    agent.be_at((20.0, 0.0, 10.0), None, 20.0)

    agent.drawn(WALL, 20.0)

    second = agent.flight
    assert (second.position_enu_m, second.task) == (first.position_enu_m, "t0")
    assert second.attempt == first.attempt
    assert second.leg > first.leg
    assert {abs(north_m) for _, north_m, _ in second.via_enu_m} == {5.0}
    assert agent.claim is not None
    assert agent.claim.completion_s > 105.0
    agent.drawn(WALL, 21.0, withdrawn=True)
    assert agent.flight.via_enu_m == ()


def test_a_zone_drawn_over_it_is_left_by_the_shortest_way_first(script: Script) -> None:
    agent = flying(script)
    agent.be_at((46.0, 0.0, 10.0), None, 46.0)

    agent.drawn(WALL, 46.0)

    via_m = agent.flight.via_enu_m
    assert via_m[0][:2] == pytest.approx((45.0, 0.0), abs=0.01)
    assert agent.flight.position_enu_m == (100.0, 0.0, 10.0)


def test_an_idle_one_leaves_a_zone_that_is_drawn_over_it(script: Script) -> None:
    agent = flying(script)
    agent.post(entry("t0", 100.0, service_s=5.0, withdrawn=True))
    agent.be_at((46.0, 0.0, 10.0), None, 46.0)
    assert agent.state() is AgentState.IDLE

    agent.drawn(WALL, 46.0)

    assert agent.flight.position_enu_m[:2] == pytest.approx((45.0, 0.0), abs=0.01)


@pytest.mark.parametrize("there", [False, True])
def test_a_task_in_a_new_zone_is_released(script: Script, there: bool) -> None:
    agent = flying(script)
    agent.be_at((99.0, 0.0, 10.0), None, 99.0)
    if there:
        agent.be_at((100.0, 0.0, 10.0), None, 100.0)
        agent.arrive(100.0)

    agent.drawn(square("new", 100.0, 0.0), 101.0)

    assert agent.state() is AgentState.IDLE
    assert agent.phase is ClaimPhase.IDLE


# -- the battery ------------------------------------------------------------------------


def test_a_battery_that_drains_faster_ends_the_sortie_earlier(script: Script) -> None:
    agent = FieldAgent(bases=[BASE])
    agent.fly_to()
    agent.be_at((0.0, 0.0, 10.0), 1.0)
    agent.start_mission()

    # 0.9 less the reserve of 0.2, of 500 s, from 10 s on.
    agent.be_at((0.0, 0.0, 10.0), 0.9, 10.0)
    agent.post(entry("t0", 100.0))

    assert script.turns[-1].sortie_end_s == pytest.approx(10.0 + 0.7 * ENDURANCE_S)
    agent.be_at((0.0, 0.0, 10.0), 0.999 * (400.0 - 20.0) / 500.0 + 0.2, 20.0)
    assert script.turns[-1].sortie_end_s <= BUDGET_S


def test_who_waits_in_the_air_for_the_mission_to_begin_comes_home_on_what_is_left() -> None:
    """Nobody counts the time before that: its coordinator may be dead."""
    agent = FieldAgent(bases=[BASE])
    agent.fly_to(entry("t0", 100.0))
    just_enough_frac = 0.2 + (agent.timing.patience_s + 10.0) / ENDURANCE_S

    agent.be_at((10.0, 0.0, 10.0), just_enough_frac + 0.01)
    agent.tick_when_due()
    assert agent.state() is AgentState.IDLE
    agent.be_at((10.0, 0.0, 10.0), just_enough_frac - 0.01)
    agent.tick_when_due()

    assert agent.phase is ClaimPhase.OUT
    assert agent.way_home.reason == "its battery is about to be used up"


def test_who_is_held_when_the_mission_ends_comes_home_on_what_is_left(script: Script) -> None:
    agent = flying(script)
    agent.told(CommandKind.HOLD, 10.0)
    agent.hear("coordinator", epoch("u0", phase=MissionPhase.ENDED, reason="over", number=2), 20.0)
    agent.be_at((10.0, 0.0, 10.0), 0.25, 30.0)
    agent.run_until(35.0)
    assert isinstance(agent.last_order, Hold)

    agent.be_at((10.0, 0.0, 10.0), 0.21, 40.0)
    agent.run_until(45.0)
    assert agent.way_home.reason == "its battery is about to be used up"


def test_a_task_that_the_battery_does_not_last_for_is_given_up(script: Script) -> None:
    agent = flying(script)
    agent.be_at((50.0, 0.0, 10.0), 0.9, 50.0)
    assert agent.state() is AgentState.FLYING

    # 55 s to the end of the task and 100 s home to its start: 155 s, but 0.3 of 500 s are left.
    agent.be_at((50.0, 0.0, 10.0), 0.5, 50.0)

    assert agent.state() is AgentState.IDLE
    assert script.turns[-1].sortie_end_s == pytest.approx(200.0)
    # With a full battery it may last by all that is known there: it is not tried again at once.
    assert script.turns[-1].excluded == {"t0"}


def test_with_nothing_to_do_it_goes_to_the_nearest_base_in_time(script: Script) -> None:
    agent = about_to_arrive(script, BASE)
    agent.arrive(40.0)
    assert agent.state() is AgentState.IDLE

    agent.run_until(BUDGET_S - 10.0 - agent.timing.patience_s - 0.1)
    assert agent.state() is AgentState.IDLE
    agent.run_until(BUDGET_S - 10.0)

    assert agent.state() is AgentState.FLYING_TO_BASE
    claim = agent.claim
    assert claim is not None
    assert (claim.base, claim.stage) == ("b0", BaseStage.APPROACHING)
    agent.arrive(BUDGET_S)
    assert agent.state() is AgentState.SWAPPING


def test_with_nothing_to_do_it_goes_to_its_start_for_good_if_that_is_nearest(
    script: Script,
) -> None:
    agent = about_to_arrive(script, FAR_BASE)
    agent.arrive(40.0)

    agent.run_until(BUDGET_S - 40.0)

    assert agent.state() is AgentState.RETURNING_VIA_START
    assert agent.way_home.via_enu_m == ABOVE_START
    assert agent.way_home.land
    assert agent.phase is ClaimPhase.OUT


def test_on_its_way_home_it_works_out_its_way_no_more(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its battery stays about to be used up, and it tells where it is many times a second."""
    agent = about_to_arrive(script, FAR_BASE)
    agent.arrive(40.0)
    agent.run_until(BUDGET_S - 40.0)
    assert agent.state() is AgentState.RETURNING_VIA_START
    asked: list[object] = []
    monkeypatch.setattr(Flights, "way_home", asked.append)

    for step in range(20):
        agent.be_at((40.0 - step, 0.0, 10.0), 0.3, BUDGET_S - 40.0 + step)

    assert asked == []


def test_with_nothing_open_it_asks_for_no_ways_to_other_bases_while_it_hovers(
    script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    agent = about_to_arrive(script, FAR_BASE)
    asked: list[str] = []
    monkeypatch.setattr(Flights, "way_to_base", lambda _flights, base: asked.append(base))

    agent.arrive(40.0)
    agent.run_until(50.0)

    assert agent.state() is AgentState.IDLE
    assert asked == []


@pytest.mark.parametrize(("east_m", "goes_on"), [(60.0, True), (300.0, False)])
def test_with_nothing_to_do_but_a_task_open_it_goes_for_another_battery(
    script: Script, east_m: float, goes_on: bool
) -> None:
    """Somebody else is to do it, who may be lost; but not where no battery lasts for it."""
    agent = about_to_arrive(script, FAR_BASE, entry("t1", east_m, number=1))
    agent.arrive(40.0)
    way_s = math.hypot(40.0, 300.0)

    agent.run_until(BUDGET_S - way_s - agent.timing.patience_s - 0.1)
    assert agent.state() is AgentState.IDLE
    agent.run_until(BUDGET_S - way_s)
    assert agent.state() is (AgentState.FLYING_TO_BASE if goes_on else AgentState.IDLE)
    assert agent.claim is not None
    assert agent.claim.base == ("b1" if goes_on else None)
    if not goes_on:
        agent.run_until(BUDGET_S - 40.0)
        assert agent.state() is AgentState.RETURNING_VIA_START


# -- the way home --------------------------------------------------------------------------


@pytest.mark.parametrize("why", ["end", "return", "abort", "hurry"])
def test_every_way_home_leads_round_zones_to_the_nearest_base(script: Script, why: str) -> None:
    agent = FieldAgent(zones=[square("wall", 80.0, 0.0)])
    agent.fly_to(entry("t0", 200.0))
    agent.be_at((100.0, 0.0, 10.0), None)
    script.items = ["t0"]
    agent.start_mission()

    if why == "end":
        agent.end_mission(10.0)
    elif why == "hurry":
        agent.stop(10.0)
    else:
        target = FLEET if why == "abort" else "u0"
        command = OperatorCommand(target, CommandKind(why), agent.brief.run, "")
        agent.hear(OPERATOR, command, 10.0)

    home = agent.way_home
    assert home.land
    assert home.via_enu_m == (50.0, 0.0, 10.0)
    assert {abs(corner[1]) for corner in home.path_enu_m} == {5.0}


def test_a_zone_drawn_on_the_way_home_is_flown_round(script: Script) -> None:
    agent = flying(script)
    agent.be_at((100.0, 0.0, 10.0), None, 90.0)
    agent.end_mission(91.0)
    assert not agent.way_home.path_enu_m

    agent.drawn(WALL, 92.0)

    assert agent.way_home.via_enu_m == ABOVE_START
    assert {abs(corner[1]) for corner in agent.way_home.path_enu_m} == {5.0}


def test_a_vehicle_that_flies_no_corners_home_returns_by_its_own_way(script: Script) -> None:
    agent = flying(script)
    agent.be_at((100.0, 0.0, 10.0), None, 90.0)
    agent.drawn(WALL, 91.0)
    agent.hear("coordinator", epoch("u0", phase=MissionPhase.ENDED, reason="over", number=2), 92.0)

    agent.happen(Refused(agent.way_home, "no corners"), 93.0)

    assert agent.way_home == Return("over", False)
    assert agent.state() is AgentState.RETURNING_VIA_START


def test_a_resumed_line_is_flown_in_the_direction_claimed(script: Script) -> None:
    agent = flying(script, "-t0", path_enu_m=LINE)
    agent.run_until(10.0)
    life = agent.next_life()
    life.be_at((12.0, 6.0, 10.0), None)
    life.happen_ready()

    assert life.state() is AgentState.FLYING
    assert life.flight.position_enu_m == (100.0, 50.0, 10.0)
    assert life.claim == replace(claims(agent.log)[-1], phase=ClaimPhase.HELD)
    assert len([order for order in orders(life.log) if isinstance(order, GoTo)]) == 1


def test_started_again_it_counts_a_battery_that_drains_faster_once(script: Script) -> None:
    agent = flying(script)
    for at_s in (0.0, 20.0, 40.0, 60.0):  # it drains 1.5 times as fast as planned
        agent.be_at((at_s, 0.0, 10.0), 1.0 - 1.5 * at_s / ENDURANCE_S, at_s)
    agent.run_until(60.0)
    ends_s = agent.core._tasking._sortie.end_s
    assert ends_s == pytest.approx(BUDGET_S / 1.5, abs=1.0)
    agent.arrive(100.0)
    script.items = ["t1"]
    agent.post(entry("t1", 120.0))
    agent.run_until(105.0)
    assert agent.task == "t1"

    life = agent.next_life()
    life.be_at((101.0, 0.0, 10.0), None)
    life.happen_ready()

    assert life.core._tasking._sortie.end_s == pytest.approx(ends_s)
