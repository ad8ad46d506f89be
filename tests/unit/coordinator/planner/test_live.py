"""Planning from the middle of a mission, against plain definitions and brute force."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
import pytest

from coordinator.planner.online import (
    EpochPolicy,
    Prediction,
    Situation,
    complete_lists,
    predicted,
    replan,
    replan_limit_s,
    worth_to_go,
)
from coordinator.planner.options import ShouldStop, after_evaluations, after_time, never
from swarm.allocation.lower_level import TeamState
from swarm.allocation.objective import evaluate
from swarm.protocol.board import TaskBoard
from swarm.protocol.registers import Replica
from swarm.protocol.uav_messages import Claim, ClaimPhase
from tests.support import reference
from tests.support.builders import (
    IDLE,
    MISSION,
    OUT,
    done,
    entry,
    failed,
    held,
    mission,
    proposed,
    random_mission,
    task,
    uav,
)
from tests.support.reference import team_worth
from tests.support.running_mission import RunningMission

GREEDY = EpochPolicy("greedy", (), {})


def fork() -> RunningMission:
    """Two UAVs at 1 m/s and three tasks on a line."""
    fleet = [uav("a"), uav("b", east_m=100.0)]
    return RunningMission(
        mission(fleet, [task("t0", 10.0), task("t1", 30.0), task("t2", 80.0)], horizon_s=500.0)
    )


def midway(seed: int, *, max_uavs: int = 3, max_tasks: int = 7) -> Situation:
    """A random mission in which some tasks are done and some UAVs fly, wait or are lost."""
    rng = np.random.default_rng(seed)
    flown = random_mission(rng, max_uavs=max_uavs, max_tasks=max_tasks)
    running = RunningMission(flown)
    tasks = [str(t.id) for t in flown.tasks]
    for who in [str(u.id) for u in flown.uavs]:
        if tasks and rng.random() < 0.5:
            running.say(who, done(tasks.pop(), float(rng.uniform(0.0, 9.0))))
        if tasks and rng.random() < 0.5:
            running.say(who, held(tasks.pop(), 5.0, completion_s=float(rng.uniform(5.0, 40.0))))
        if len(running.credible) > 1 and rng.random() < 0.2:
            running.lose(who)
    return running.at(10.0)


def indices(situation: Situation, prediction: Prediction) -> list[list[int]]:
    problem = situation.problem
    column: dict[str, int] = {name: index for index, name in enumerate(problem.task_ids)}
    return [[column[name] for name in prediction.lists[who]] for who in problem.uav_ids]


# -- the situation ----------------------------------------------------------------------


def test_a_claimed_task_is_finished_first_and_is_nobody_elses() -> None:
    situation = fork().say("a", held("t1", 0.0, completion_s=30.0)).at(12.0)

    assert situation.state.free_s.tolist() == [30.0, 12.0]
    assert situation.state.place_enu_m[:, 0].tolist() == [30.0, 100.0]
    assert situation.state.open.tolist() == [True, False, True]
    assert situation.under_way == {"a": "t1"}


def test_who_is_overdue_may_be_free_any_moment() -> None:
    situation = fork().say("a", held("t1", 0.0, completion_s=30.0)).at(45.0)

    assert situation.state.free_s.tolist() == [45.0, 45.0]
    assert situation.under_way == {"a": "t1"}


def test_a_uav_stands_where_its_last_task_ended_and_has_survived_all_of_them() -> None:
    fleet = [uav("a"), uav("b")]
    flown = mission(fleet, [task("t0", 10.0), task("t1", 30.0), task("t2", 80.0)])
    running = RunningMission(replace(flown, survival_default=0.5))
    running.say("a", done("t1", 30.0)).say("a", done("t0", 10.0)).say("a", IDLE)
    running.say("b", held("t2", 0.0, completion_s=80.0))

    situation = running.at(40.0)

    assert situation.state.place_enu_m[:, 0].tolist() == [30.0, 80.0]
    assert situation.state.survived.tolist() == [0.25, 0.5]
    assert situation.visited == {"a": ("t0", "t1")}


def test_the_lost_and_those_who_left_take_no_part_and_their_tasks_are_open_again() -> None:
    running = fork().say("a", held("t1", 0.0, completion_s=30.0)).lose("a")

    assert running.at(5.0).taking_part == {"b"}
    assert running.at(5.0).state.open.all()
    assert running.say("b", OUT).at(5.0).taking_part == frozenset()
    assert running.at(5.0).is_settled


def test_of_two_claims_on_one_task_the_stronger_counts() -> None:
    running = fork().say("a", held("t0", 0.0, completion_s=10.0))
    running.say("b", proposed("t0", 0.0, completion_s=90.0))

    situation = running.at(1.0)

    assert situation.under_way == {"a": "t0"}
    assert situation.state.free_s.tolist() == [10.0, 1.0]


def test_what_is_closed_is_not_open() -> None:
    running = fork().say("a", done("t0")).say("b", failed("t1"))
    running.post(entry("t2", east_m=80.0, number=2, withdrawn=True))

    situation = running.at(50.0)

    assert not situation.state.open.any()
    assert situation.is_settled
    assert situation.withdrawn == {"t2"}
    assert situation.failures == 1


def test_a_task_that_failed_and_is_open_again_counts_as_not_visited() -> None:
    running = RunningMission(replace(fork().mission, reattempt_failed=True))
    running.say("a", failed("t0", 10.0)).say("a", done("t1", 30.0))

    situation = running.at(50.0)

    assert situation.visited == {"a": ("t1",)}
    assert situation.state.open.tolist() == [True, False, True]
    assert situation.failures == 1


def test_there_is_no_situation_before_the_brief() -> None:
    assert Situation.of(TaskBoard(Replica(), MISSION), (), 0.0) is None


def test_a_claim_on_a_task_that_is_done_binds_nobody() -> None:
    running = fork().say("a", held("t0", 0.0, completion_s=10.0)).say("a", done("t0", 9.0))

    situation = running.at(9.0)

    assert situation.under_way == {}
    assert situation.state.free_s[0] == 9.0
    assert situation.state.survived[0] == 1.0


# -- where it is heading ----------------------------------------------------------------


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
@pytest.mark.parametrize("seed", range(40))
def test_prediction_equals_the_plain_lower_level_from_the_live_state(rule: str, seed: int) -> None:
    situation = midway(seed)
    order = np.random.default_rng(seed).permutation(situation.problem.n_uav).tolist()
    course = EpochPolicy(rule, tuple(situation.problem.uav_ids[index] for index in order), {})

    found = predicted(situation, course)

    lists, _ = reference.lists_from(situation.problem, situation.state, order, rule)
    worth_of_lists = team_worth(situation.problem, situation.state, lists)
    assert indices(situation, found) == lists
    assert found.objective == pytest.approx(worth_of_lists, abs=1e-9)
    _, completion_s = evaluate(situation.problem, lists, situation.state)
    for who in found.lists:
        for name in found.lists[who]:
            time_s = completion_s[situation.problem.task_ids.index(name)]
            assert found.completion_s[name] == time_s


def test_completion_times_are_those_of_the_mission_clock() -> None:
    running = fork().say("a", held("t1", 0.0, completion_s=30.0)).say("b", OUT)

    found = predicted(running.at(12.0), EpochPolicy("guided", (), {"a": ("t1", "t0", "t2")}))

    assert found.lists == {"a": ("t0", "t2"), "b": ()}
    assert found.completion_s == {"t1": 30.0, "t0": 50.0, "t2": 120.0}
    assert found.objective == pytest.approx(450.0 + 380.0)


def test_guided_predicts_no_less_than_its_lists_are_worth() -> None:
    for seed in range(30):
        situation = midway(seed, max_uavs=4, max_tasks=12)
        plan = replan(situation, GREEDY, "guided", stop=after_evaluations(500))
        lists = plan.prediction.lists

        found = predicted(situation, EpochPolicy("guided", plan.sequence, lists))

        assert found.objective >= plan.prediction.objective - 1e-9


def test_by_an_unknown_rule_nothing_is_done() -> None:
    found = predicted(fork().at(0.0), EpochPolicy("newer", (), {}))

    assert found == Prediction({"a": (), "b": ()}, {}, 0.0)


# -- what would be better ---------------------------------------------------------------


@pytest.mark.parametrize("seed", range(40))
def test_guided_finds_the_best_lists_of_small_missions(seed: int) -> None:
    situation = midway(seed, max_uavs=3, max_tasks=5)

    plan = replan(situation, GREEDY, "guided", seed=seed)

    assert plan.prediction.objective == pytest.approx(best_of_all_lists(situation), abs=1e-9)
    assert plan.prediction.objective >= plan.going_on.objective - 1e-9


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
@pytest.mark.parametrize("seed", range(15))
def test_rules_with_a_sequence_get_the_best_of_all(rule: str, seed: int) -> None:
    situation = midway(seed)

    plan = replan(situation, GREEDY, rule)

    worths = [
        predicted(situation, EpochPolicy(rule, sequence, {})).objective
        for sequence in permutations(sorted(situation.taking_part))
    ]
    assert plan.rule == rule
    assert set(plan.sequence) == situation.taking_part
    assert plan.prediction.objective == pytest.approx(max(worths), abs=1e-9)


def test_only_those_who_take_part_get_tasks() -> None:
    running = fork().say("a", held("t1", 0.0, completion_s=30.0)).lose("b")

    plan = replan(running.at(3.0), GREEDY, "guided")

    assert plan.sequence == ("a",)
    assert sorted(plan.prediction.lists["a"]) == ["t0", "t2"]
    assert plan.prediction.lists["b"] == ()


def test_the_same_seed_and_work_give_the_same_plan() -> None:
    situation = midway(5, max_uavs=8, max_tasks=25)

    a, b = (
        replan(situation, GREEDY, "guided", seed=3, stop=after_evaluations(2000), threads=threads)
        for threads in (1, 2)
    )

    assert a == b


def test_there_may_be_nothing_to_plan() -> None:
    running = fork().lose("a").lose("b")

    plan = replan(running.at(3.0), GREEDY, "guided")

    assert plan.sequence == ()
    assert plan.prediction.objective == plan.going_on.objective == 0.0


def test_a_plan_is_predicted_by_the_lists_that_would_be_published(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    running = fork().say("a", done("t0", 10.0)).say("a", held("t1", 10.0, completion_s=30.0))
    courses: list[EpochPolicy] = []

    def recording(
        situation: Situation, course: EpochPolicy, stop: ShouldStop = never
    ) -> Prediction:
        courses.append(course)
        return predicted(situation, course, stop)

    monkeypatch.setattr("coordinator.planner.online.predicted", recording)
    plan = replan(running.at(12.0), GREEDY, "guided")

    # With a task on no list, done or claimed though it be, every decision would be searched anew.
    assert courses[-1].routes == {"a": ("t0", "t1"), "b": ("t2",)}
    assert plan.prediction.lists == {"a": (), "b": ("t2",)}


def test_stopped_at_once_everything_has_a_prediction_all_the_same() -> None:
    for seed in range(20):
        situation = midway(seed, max_uavs=4, max_tasks=12)
        course = EpochPolicy("guided", (), {})

        plan = replan(situation, course, "guided", stop=lambda _: True)

        doable = situation.problem.capable[situation.state.active].any(axis=0)
        wanted = np.flatnonzero(doable & situation.state.open)
        for prediction in (plan.going_on, plan.prediction):
            found = sorted(task for route in indices(situation, prediction) for task in route)
            assert found == wanted.tolist()


def test_stopped_after_some_decisions_the_lists_are_flown_to_their_end() -> None:
    running = fork()
    asked = 0

    def after_one_decision(evaluations: float) -> bool:
        nonlocal asked
        asked += 1
        return True

    lists = {"a": ("t0", "t1"), "b": ("t2",)}
    found = predicted(running.at(0.0), EpochPolicy("guided", ("a", "b"), lists), after_one_decision)

    assert found.lists == lists
    assert found.completion_s == {"t0": 10.0, "t1": 30.0, "t2": 20.0}


# -- many open tasks, little time ---------------------------------------------------------


def large(seed: int) -> tuple[Situation, EpochPolicy]:
    """More open tasks than are decided one by one, of which lists hold two thirds.

    Of the others some are done and some under way, as are some on lists.
    """
    rng = np.random.default_rng(seed)
    fleet = [uav(f"u{n}", east_m=float(rng.uniform(0.0, 300.0))) for n in range(8)]
    places_m = rng.uniform(0.0, 300.0, (120, 2)).tolist()
    tasks = [
        replace(task(f"t{n:03}", east_m), position_enu_m=(east_m, north_m, 0.0), value=1.0 + n % 5)
        for n, (east_m, north_m) in enumerate(places_m)
    ]
    running = RunningMission(mission(fleet, tasks, horizon_s=5000.0))
    routes = {f"u{n}": tuple(f"t{k:03}" for k in range(10 * n, 10 * n + 10)) for n in range(8)}
    for n in range(8):
        running.say(f"u{n}", done(f"t{10 * n:03}", float(n)))
        running.say(f"u{n}", done(f"t{80 + n:03}", 10.0 + n))
        flown = f"t{10 * n + 1:03}" if n % 2 else f"t{90 + n:03}"
        running.say(f"u{n}", held(flown, 20.0, completion_s=30.0 + n))
    running.lose("u3")
    return running.at(25.0), EpochPolicy("guided", tuple(sorted(routes)), routes)


def check_whole(situation: Situation, prediction: Prediction) -> None:
    """All that can be done is on one list, and J and times are those of flying the lists."""
    problem, state = situation.problem, situation.state
    lists = indices(situation, prediction)
    listed = sorted(index for route in lists for index in route)
    doable = problem.capable[state.active].any(axis=0) & state.open
    assert listed == np.flatnonzero(doable).tolist()
    assert all(state.active[row] for row, route in enumerate(lists) if route)
    assert prediction.objective == pytest.approx(team_worth(problem, state, lists))
    _, completion_s = evaluate(problem, lists, state)
    for index in listed:
        assert prediction.completion_s[problem.task_ids[index]] == completion_s[index]


def test_lists_that_hold_all_that_is_open_are_taken_to_be_kept_to() -> None:
    situation, course = large(1)
    plan = replan(situation, course, "guided", stop=after_evaluations(2000), threads=1)
    published = complete_lists(situation, plan.prediction.lists)

    found = predicted(situation, EpochPolicy("guided", plan.sequence, published))

    # What is done or under way was on none of the lists that were searched.
    assert found == plan.prediction
    check_whole(situation, found)


def test_lists_that_lack_tasks_are_mended_before_they_are_valued() -> None:
    for seed in range(3):
        situation, course = large(seed)

        found = predicted(situation, course)

        check_whole(situation, found)
        assert found.objective >= worth_to_go(situation, course.routes)[1]
        assert found == predicted(situation, course)


def test_what_is_closed_or_under_way_disturbs_no_prediction() -> None:
    situation, course = large(2)
    plan = replan(situation, course, "guided", stop=after_evaluations(500), threads=1)
    kept = plan.prediction.lists  # without what is closed or under way

    assert predicted(situation, EpochPolicy("guided", (), kept)).lists == kept


@pytest.mark.parametrize("seed", range(3))
def test_stopped_at_any_moment_a_plan_is_whole_and_no_worse_than_going_on(seed: int) -> None:
    situation, course = large(seed)
    for most in (0, 1, 2, 3, 5, 8, 13, 21, 34, 55):
        asked = 0

        def stop(evaluations: float, most: int = most) -> bool:
            nonlocal asked
            asked += 1
            return asked > most

        plan = replan(situation, course, "guided", seed=seed, stop=stop, threads=1)

        check_whole(situation, plan.going_on)
        check_whole(situation, plan.prediction)
        assert plan.prediction.objective >= plan.going_on.objective
        assert asked > most


@dataclass(slots=True)
class AskedClock:
    """Goes on by 1 ms whenever it is asked."""

    time_s: float = 0.0

    def now_s(self) -> float:
        self.time_s += 0.001
        return self.time_s

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


@pytest.mark.parametrize("limit_s", [0.01, 0.1, 0.5])
def test_one_limit_holds_for_searching_and_predicting_together(limit_s: float) -> None:
    situation, course = large(0)
    clock = AskedClock()

    plan = replan(situation, course, "guided", stop=after_time(clock, limit_s), threads=1)

    assert clock.time_s <= limit_s + 0.005
    check_whole(situation, plan.prediction)
    assert plan.prediction.objective >= plan.going_on.objective


def test_a_search_without_a_limit_in_time_has_one_in_steps_all_the_same() -> None:
    situation, course = large(0)

    plan = replan(situation, course, "guided", threads=1)

    assert plan.prediction.objective > plan.going_on.objective
    assert plan == replan(situation, course, "guided", threads=2)


def test_more_time_is_given_where_more_is_open() -> None:
    situation, _ = large(0)
    problem, state = situation.problem, situation.state

    def limit_s(n_open: int) -> float:
        is_open = np.zeros(10_000, dtype=np.bool_)
        is_open[:n_open] = True
        at = TeamState(state.free_s, state.place_enu_m, state.survived, is_open, state.active)
        return replan_limit_s(replace(situation, problem=problem, state=at))

    assert [limit_s(n) for n in (0, 500, 3000, 5000, 9000)] == [2.0, 2.0, 3.0, 5.0, 5.0]


# -- valuing lists when time has passed ---------------------------------------------------


@pytest.mark.parametrize("seed", range(30))
def test_good_lists_are_worth_what_was_predicted_of_them(seed: int) -> None:
    situation = midway(seed, max_uavs=4, max_tasks=12)

    plan = replan(situation, GREEDY, "guided", stop=after_evaluations(500))

    _, value = worth_to_go(situation, plan.prediction.lists)
    assert value == pytest.approx(plan.prediction.objective, rel=1e-6, abs=1e-6)


def test_worth_skips_what_is_done_and_finds_a_place_for_what_is_on_no_list() -> None:
    running = fork()
    lists = {"a": ("t0", "t1"), "b": ("t2",)}
    running.say("a", Claim(ClaimPhase.HELD, "t0", 0.0, 0, 10.0)).lose("b")

    # a ends t0 at 10 s, t1 at 30 s, and takes t2 at 80 s though it was on another's list.
    assert worth_to_go(running.at(1.0), lists)[1] == pytest.approx(470.0 + 420.0)
    assert worth_to_go(running.say("a", OUT).at(1.0), lists) == (0, 0.0)


def best_of_all_lists(situation: Situation) -> float:
    """Of all ways to give every doable open task to a UAV that is capable of it."""
    problem, state = situation.problem, situation.state
    able = {
        int(index): [u for u in np.flatnonzero(state.active) if problem.capable[u, index]]
        for index in np.flatnonzero(state.open)
    }
    doable = [index for index, uavs in able.items() if uavs]
    best = -np.inf
    for owners in product(*(able[index] for index in doable)):
        total = 0.0
        for who in range(problem.n_uav):
            own = [index for index, owner in zip(doable, owners, strict=True) if owner == who]
            orders = permutations(own)
            total += max(
                team_worth(problem, state, one_list(problem.n_uav, who, o)) for o in orders
            )
        best = max(best, total)
    return best


def one_list(n_uav: int, who: int, route: tuple[int, ...]) -> list[list[int]]:
    return [list(route) if index == who else [] for index in range(n_uav)]
