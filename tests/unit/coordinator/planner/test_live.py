"""Planning from the middle of a mission, against plain definitions and brute force."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest

from coordinator.planner.online import (
    EpochPolicy,
    Prediction,
    Situation,
    predicted,
    replan,
    worth_to_go,
)
from coordinator.planner.options import ShouldStop, after_evaluations, never
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
    task,
    uav,
)
from tests.support.midway import GREEDY, fork, indices, midway
from tests.support.reference import team_worth
from tests.support.running_mission import RunningMission

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
