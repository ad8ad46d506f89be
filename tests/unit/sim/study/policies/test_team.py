from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.study.generator import mission_of
from sim.study.policies.situation import TeamNews, TeamSituation
from sim.study.policies.team import fly_team
from sim.world.uncertainty import Realization, Uncertainty
from sim.world.wind import Wind
from swarm.allocation import evaluate
from swarm.model import Mission, UavId
from tests.support.builders import mission, task, uav
from tests.support.problems import random_problem
from tests.unit.sim.study.policies.play import Script, calm, fate_of, times_s

SEEDS = st.integers(0, 2**32 - 1)


def random_lists(rng: np.random.Generator, n_uav: int, n_task: int) -> list[list[int]]:
    routes: list[list[int]] = [[] for _ in range(n_uav)]
    for item in rng.permutation(n_task).tolist():
        routes[rng.integers(n_uav)].append(item)
    return routes


def line(*places_m: float, **uavs_m: float) -> Mission:
    """Tasks a, b, c, … and UAVs on a line; all fly at 1 m/s."""
    tasks = [task("abcdefgh"[i], place_m) for i, place_m in enumerate(places_m)]
    return mission([uav(name, place_m) for name, place_m in uavs_m.items()], tasks)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_without_uncertainty_times_are_those_of_the_objective(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 9)
    routes = random_lists(rng, 3, 9)
    flight = fly_team(calm(problem), Script(routes))
    _, expected_s = evaluate(problem, routes)
    assert times_s(flight) == dict(zip(problem.task_ids, expected_s.tolist(), strict=True))
    ends_s = [visit.completed_s for visit in flight.visits]
    assert ends_s == sorted(ends_s)
    assert flight.released == 0


def test_lost_uav_leaves_its_task_to_others_at_once() -> None:
    script = Script([[0], [0]])
    fate = fate_of(line(10.0, u1=0.0, u2=20.0), lost_at_s={"u1": 4.0})
    flight = fly_team(fate, script)
    assert [(v.uav, v.task, v.completed_s) for v in flight.visits] == [("u2", "a", 14.0)]
    assert flight.lost_uavs == ("u1",)
    assert script.heard[1] == (4.0, {TeamNews.LOST})


def test_uav_lost_while_idle_is_asked_no_more() -> None:
    script = Script([[], [0]])
    flight = fly_team(fate_of(line(10.0, u1=0.0, u2=0.0), lost_at_s={"u1": 4.0}), script)
    assert (4.0, 0) not in script.asked
    assert flight.lost_uavs == ("u1",)


def test_uav_lost_at_the_beginning_does_nothing() -> None:
    flight = fly_team(fate_of(line(10.0, u1=0.0), lost_at_s={"u1": 0.0}), Script([[0]]))
    assert flight.visits == ()


def test_idle_uav_takes_what_appears() -> None:
    late = mission([uav("u1")], [task("a", 2.0), task("b", 5.0, appears_s=7.5)])
    script = Script([[0, 1]])
    assert times_s(fly_team(fate_of(late), script)) == {"a": 2.0, "b": 10.5}
    assert (7.5, {TeamNews.APPEARED}) in script.heard


def test_tasks_are_unknown_before_they_appear() -> None:
    late = mission(
        [uav("u1")],
        [task("z", 1.0, appears_s=3.0), task("a", 2.0), task("y", 9.0, appears_s=3.0)],
    )
    known: list[tuple[float, tuple[str, ...]]] = []

    class Onlooker(Script):
        def choose(self, situation: TeamSituation, uav: int) -> int | None:
            known.append((situation.now_s, situation.problem.task_ids))
            return super().choose(situation, uav)

    fly_team(fate_of(late), Onlooker([[0, 1, 2]]))
    assert known[:3] == [(0.0, ("a",)), (2.0, ("a",)), (3.0, ("a", "z", "y"))]


def test_uav_in_flight_stops_where_its_task_is_withdrawn() -> None:
    fate = fate_of(line(10.0, -10.0, u1=0.0), withdrawn_at_s={"a": 4.0})
    flight = fly_team(fate, Script([[0, 1]]))
    assert times_s(flight) == {"b": 4.0 + 14.0}
    assert flight.released == 1


def test_uav_that_serves_a_withdrawn_task_is_free_at_once() -> None:
    served = mission([uav("u1")], [task("a", 10.0, service_s=5.0), task("b", -10.0)])
    flight = fly_team(fate_of(served, withdrawn_at_s={"a": 12.0}), Script([[0, 1]]))
    assert times_s(flight) == {"b": 32.0}


def test_withdrawing_what_is_done_changes_nothing() -> None:
    script = Script([[0, 1]])
    fly_team(fate_of(line(1.0, 9.0, u1=0.0), withdrawn_at_s={"a": 4.0}), script)
    assert [time_s for time_s, _ in script.heard] == [0.0, 1.0]


def test_task_withdrawn_before_it_appears_is_never_there() -> None:
    late = mission([uav("u1")], [task("a", 2.0), task("b", 5.0, appears_s=7.5)])
    script = Script([[0, 1]])
    assert times_s(fly_team(fate_of(late, withdrawn_at_s={"b": 7.5}), script)) == {"a": 2.0}


def test_failed_task_stays_closed() -> None:
    poor = mission([uav("u1", a=0.01, b=0.99)], [task("a", 3.0), task("b", 5.0)])
    fate = fate_of(poor, Uncertainty(outcomes=True))
    flight = fly_team(fate, Script([[0, 1, 0]]))
    assert [(v.task, v.done) for v in flight.visits] == [("a", False), ("b", True)]


@pytest.mark.parametrize("seed", range(4))
def test_failed_task_is_tried_until_it_succeeds_where_the_mission_says_so(seed: int) -> None:
    poor = replace(mission([uav("u1", a=0.3)], [task("a", 3.0)]), reattempt_failed=True)
    fate = fate_of(poor, Uncertainty(outcomes=True), seed=seed)
    script = Script([[0] * 100])
    flight = fly_team(fate, script)
    draws = [fate.succeeds(poor.uavs[0], poor.tasks[0], n) for n in range(1, 101)]
    assert [v.done for v in flight.visits] == draws[: draws.index(True) + 1]
    assert all(TeamNews.REOPENED in news for _, news in script.heard[1:-1])


def test_uav_that_does_not_survive_its_task_flies_no_more() -> None:
    deadly = mission([replace(uav("u1"), survival={"a": 0.0})], [task("a", 3.0), task("b", 5.0)])
    flight = fly_team(fate_of(deadly, Uncertainty(survival=True)), Script([[0, 1]]))
    assert [(v.task, v.done) for v in flight.visits] == [("a", True)]
    assert flight.lost_uavs == ("u1",)


@pytest.mark.parametrize(("drawn", "expected"), [(False, 0.5 * 0.8), (True, 0.8)])
def test_survival_so_far_counts_unless_it_is_drawn(drawn: bool, expected: float) -> None:
    risky = mission([replace(uav("u1"), survival={"a": 0.5, "b": 0.8})], [task("a", 3.0)])
    risky = replace(risky, tasks=(*risky.tasks, task("b", 5.0), task("c", 9.0, appears_s=4.0)))
    seen: list[float] = []

    class Onlooker(Script):
        def hear(self, situation: TeamSituation, news: object) -> tuple[int, ...]:
            if situation.now_s == 4.0:
                seen.append(float(situation.state.survived[0]))
            return ()

    seed = next(
        seed
        for seed in range(20)
        if fate_of(risky, Uncertainty(survival=True), seed=seed).survives(
            risky.uavs[0], risky.tasks[0], 1
        )
    )
    fly_team(fate_of(risky, Uncertainty(survival=drawn), seed=seed), Onlooker([[0, 1, 2]]))
    assert seen == [pytest.approx(expected)]


def test_those_free_at_the_same_moment_are_asked_in_the_order_of_the_sequence() -> None:
    script = Script([[], [], []])
    fly_team(fate_of(line(1.0, u1=0.0, u2=0.0, u3=0.0)), script, sequence=[UavId("u3")])
    assert script.asked == [(0.0, 2), (0.0, 0), (0.0, 1)]


def test_task_that_takes_no_time_is_over_before_the_next_uav_decides() -> None:
    script = Script([[0, 1], [0, 1]])
    flight = fly_team(fate_of(line(0.0, 0.0, u1=0.0, u2=0.0)), script)
    assert [visit.uav for visit in flight.visits] == ["u1", "u1"]


def test_interval_passes_until_nothing_else_is_to_come() -> None:
    script = Script([[0]])
    fly_team(fate_of(line(10.0, u1=0.0)), script, every_s=4.0)
    assert script.heard == [
        (0.0, {TeamNews.BEGUN}),
        (4.0, {TeamNews.TIME}),
        (8.0, {TeamNews.TIME}),
    ]


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_legs_take_as_long_as_fate_has_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 8)
    drawn = Uncertainty(speed_sd_frac=0.2, leg_sd_frac=0.3, wind_m_s=1.5, position_error_m=0.4)
    fate = drawn.draw(mission_of(problem, "rough"), 10.0, seed)
    assert isinstance(fate.wind, Wind)
    routes = random_lists(rng, 3, 8)
    flight = fly_team(fate, Script(routes))
    expected_s = {}
    for row, route in enumerate(routes):
        who, time_s = fate.mission.uavs[row], 0.0
        place = who.position_enu_m
        for item in route:
            what = fate.mission.tasks[item]
            stop = fate.stop_enu_m(who.id, what)
            time_s += math.dist(place, stop) / fate.speed_m_s(who, what.id, place, stop)
            time_s += what.service_s
            expected_s[what.id], place = time_s, stop
    assert times_s(flight) == pytest.approx(expected_s)


def test_uav_stops_where_it_really_is_and_believes_to_be_on_its_way() -> None:
    rough = Uncertainty(position_error_m=2.0)
    fate = fate_of(line(100.0, -10.0, u1=0.0), rough, withdrawn_at_s={"a": 50.0})
    who, (a, b) = fate.mission.uavs[0], fate.mission.tasks
    places: list[tuple[float, ...]] = []

    class Onlooker(Script):
        def choose(self, situation: TeamSituation, uav: int) -> int | None:
            places.append(situation.place_enu_m(uav))
            return super().choose(situation, uav)

    flight = fly_team(fate, Onlooker([[0, 1]]))
    aim = fate.stop_enu_m(who.id, a)
    share = 50.0 / math.dist((0.0, 0.0, 0.0), aim)
    stopped = (share * aim[0], share * aim[1], 0.0)
    assert places[1] == pytest.approx((100.0 * share, 0.0, 0.0))
    home_s = math.dist(stopped, fate.stop_enu_m(who.id, b))
    assert times_s(flight) == {"b": pytest.approx(50.0 + home_s)}


def test_chooser_cannot_have_what_is_not_open_or_beyond_the_uav() -> None:
    class Greedy(Script):
        def choose(self, situation: TeamSituation, uav: int) -> int | None:
            return 0

    with pytest.raises(ValueError, match="u2 cannot take task a"):
        fly_team(fate_of(line(10.0, u1=0.0, u2=0.0)), Greedy([[], []]))
    unable = mission([uav("u1", a=0.0), uav("u2")], [task("a", 10.0)])
    with pytest.raises(ValueError, match="u1 cannot take task a"):
        fly_team(fate_of(unable), Greedy([[], []]))


def test_who_serves_or_waits_gives_nothing_up() -> None:
    class Impatient(Script):
        def hear(self, situation: TeamSituation, news: object) -> tuple[int, ...]:
            return (0,)

    with pytest.raises(ValueError, match="u1 is not in flight"):
        fly_team(fate_of(line(10.0, u1=0.0)), Impatient([[0]]))


@pytest.mark.parametrize("every_s", [0.0, -1.0, math.inf, math.nan])
def test_interval_must_be_positive_and_finite(every_s: float) -> None:
    with pytest.raises(ValueError, match="every_s"):
        fly_team(fate_of(line(10.0, u1=0.0)), Script([[0]]), every_s=every_s)


def test_mission_ends_when_nobody_living_can_do_what_is_left() -> None:
    unable = mission([uav("u1", a=0.0), uav("u2")], [task("a", 10.0), task("b", 1.0)])
    script = Script([[1], [0]])
    fate: Realization = fate_of(unable, lost_at_s={"u2": 5.0, "u1": 1e9})
    flight = fly_team(fate, script, every_s=1.0)
    assert flight.lost_uavs == ("u2",)
    assert script.heard[-1][0] == 4.0
