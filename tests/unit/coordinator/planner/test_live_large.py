"""Planning from the middle of a large mission, in little time."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from coordinator.planner.options import after_evaluations, after_time
from swarm.allocation.lower_level import TeamState
from swarm.allocation.objective import evaluate
from tests.support.builders import (
    done,
    held,
    mission,
    task,
    uav,
)
from tests.support.midway import indices
from tests.support.reference import team_worth
from tests.support.running_mission import RunningMission


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
