"""Planning anew in a mission in the field that runs."""

from __future__ import annotations

import random

import numpy as np
import pytest

from coordinator.planner.online import (
    EpochPolicy,
    Situation,
    complete_lists,
    left_out_by,
    predicted,
    replan,
    worth_to_go,
)
from swarm.allocation.field import FieldProblem
from swarm.kernels.field import FIELD_GREEDY
from swarm.kernels.field_alone import earliest_alone
from tests.support.field_dilemmas import dilemma
from tests.support.field_missions import mission_of
from tests.support.field_registers import Moment, PlannedRun

COURSE = EpochPolicy("guided", (), {})


def moments(seed: int, n_uav: int = 3) -> list[Moment]:
    """Turns along a run by greedy."""
    mission = mission_of(dilemma(seed, n_uav, 7, slots=True))
    problem = FieldProblem.from_mission(mission)
    sequence = random.Random(seed).sample(range(n_uav), n_uav)
    return list(PlannedRun(mission, problem, FIELD_GREEDY, sequence).moments())


def situation_of(moment: Moment) -> Situation:
    credible = {str(uav) for uav in moment.turn.credible} | {moment.turn.uav}
    situation = Situation.of(moment.board, credible, moment.turn.now_s)
    assert situation is not None
    return situation


@pytest.mark.parametrize("seed", range(6))
def test_a_new_plan_is_no_worse_than_going_on_and_plans_what_is_open(seed: int) -> None:
    for moment in moments(seed):
        situation = situation_of(moment)
        if situation.is_settled:
            continue
        assert situation.field is not None
        found = replan(situation, COURSE, "guided", seed=seed, threads=1)

        new, old = found.prediction, found.going_on
        assert (-new.n_left_out, new.objective) >= (-old.n_left_out, old.objective)
        listed = [task for tasks in new.lists.values() for task in tasks]
        ids = situation.problem.task_ids
        is_open = [task for task, free in zip(ids, situation.field.state.open, strict=True) if free]
        assert len(set(listed)) == len(listed)
        assert set(listed) <= set(is_open)
        assert new.completion_s.keys() == {*listed, *situation.under_way.values()}
        assert min(new.completion_s.values(), default=moment.turn.now_s) >= moment.turn.now_s
        routes = complete_lists(situation, new.lists)
        assert worth_to_go(situation, routes)[0] <= len(is_open)
        assert found == replan(situation, COURSE, "guided", seed=seed, threads=2)


@pytest.mark.parametrize("most", [0, 1, 3, 10])
def test_stopped_at_any_moment_a_plan_is_no_worse_than_going_on(most: int) -> None:
    for moment in moments(2):
        situation, asked = situation_of(moment), 0

        def stop(evaluations: float) -> bool:
            nonlocal asked
            asked += 1
            return asked > most

        if situation.is_settled:
            continue
        found = replan(situation, COURSE, "guided", stop=stop, threads=1)

        new, old = found.prediction, found.going_on
        assert (-new.n_left_out, new.objective) >= (-old.n_left_out, old.objective)
        listed = [task for tasks in new.lists.values() for task in tasks]
        assert len(set(listed)) == len(listed)
        assert asked > most


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
def test_rules_are_predicted_by_letting_them_decide(rule: str) -> None:
    for moment in moments(3)[:4]:
        situation = situation_of(moment)
        course = EpochPolicy(rule, tuple(sorted(situation.taking_part)), {})

        found = replan(situation, course, rule)

        assert found.prediction == found.going_on == predicted(situation, course)
        assert found.sequence == course.sequence


def test_what_a_uav_can_reach_no_more_settles_the_mission() -> None:
    """At the end of a run nothing is left that anybody could still do."""
    ends = [situation_of(moments(seed)[-1]) for seed in range(8)]

    for situation in ends:
        if situation.is_settled:
            nothing: dict[str, tuple[str, ...]] = dict.fromkeys(situation.problem.uav_ids, ())
            assert predicted(situation, COURSE).lists == nothing
    assert any(situation.is_settled for situation in ends)


@pytest.mark.parametrize("seed", range(6))
def test_what_is_open_is_on_a_list_or_left_out_for_a_reason(seed: int) -> None:
    for moment in moments(seed):
        situation = situation_of(moment)
        standing = situation.field
        assert standing is not None
        found = replan(situation, COURSE, "guided", seed=seed, threads=1)

        left_out = left_out_by(situation, found.prediction.lists)

        listed = [task for tasks in found.prediction.lists.values() for task in tasks]
        left = {task: why for why, tasks in left_out.items() for task in tasks}
        assert sorted([*listed, *left]) == sorted(situation.open_tasks)
        column_of: dict[str, int] = {t: n for n, t in enumerate(standing.problem.task_ids)}
        alone_s = earliest_alone(standing.problem.kernel, standing.state)
        for task, why in left.items():
            column = column_of[task]
            assert (why == "nobody can") == (not np.isfinite(alone_s[:, column]).any())
            if why != "nobody can":
                windowed = np.isfinite(standing.problem.closes_s[column])
                required = "window" if windowed else "energy"
                assert why == (required if standing.problem.required[column] else "due")


def test_moments_leave_something_out_for_more_than_one_reason() -> None:
    situations = [situation_of(moment) for seed in range(6) for moment in moments(seed)]
    nothing: dict[str, tuple[str, ...]] = {}

    assert len({why for each in situations for why in left_out_by(each, nothing)}) > 1
