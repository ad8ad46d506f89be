from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.sequence_space import single_stage
from swarm.allocation import Problem, TeamState, evaluate, rank_of, rule_by_name, run
from tests.support.problems import any_problem, random_problem

SEEDS = st.integers(0, 2**32 - 1)


def best_assignment_value(problem: Problem) -> float:
    """Largest Σ of single-task terms over all ways to give each task to a UAV of its own."""
    times_s = np.array(
        [problem.travel_s(uav, problem.start_enu_m[uav]) for uav in range(problem.n_uav)]
    )
    scores = problem.weight * (problem.horizon_s - times_s - problem.service_s)
    return max(
        sum(float(scores[uav, task]) for task, uav in enumerate(uavs))
        for uavs in permutations(range(problem.n_uav), problem.n_task)
    )


@settings(deadline=None, max_examples=80)
@given(seed=SEEDS, n_task=st.integers(1, 4), surplus=st.integers(0, 2))
def test_greedy_by_the_sequence_is_the_optimal_assignment(
    seed: int, n_task: int, surplus: int
) -> None:
    problem = random_problem(
        np.random.default_rng(seed), n_task + surplus, n_task, lowest_survival=0.5
    )

    stage = single_stage(problem)
    routes, _ = run(
        problem, TeamState.at_start(problem), rank_of(stage.sequence), rule_by_name("greedy")
    )

    expected = best_assignment_value(problem)
    assert stage.objective == pytest.approx(expected, abs=1e-9)
    assert evaluate(problem, routes)[0] == pytest.approx(expected, abs=1e-9)
    assert routes == [[] if task is None else [task] for task in stage.tasks]


@settings(deadline=None)
@given(seed=SEEDS, n_uav=st.integers(1, 6), n_task=st.integers(0, 9))
def test_greedy_by_the_sequence_takes_the_assigned_tasks_first(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)

    stage = single_stage(problem)
    routes, _ = run(
        problem, TeamState.at_start(problem), rank_of(stage.sequence), rule_by_name("greedy")
    )

    assert sorted(stage.sequence) == list(range(n_uav))
    for route, task in zip(routes, stage.tasks, strict=True):
        if task is not None:
            assert route[0] == task


@settings(deadline=None)
@given(seed=SEEDS, n=st.integers(2, 5))
def test_equal_scores_do_not_stop_the_peeling(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    problem = Problem(
        uav_ids=random_problem(rng, n, n).uav_ids,
        task_ids=random_problem(rng, n, n).task_ids,
        start_enu_m=np.zeros((n, 3)),
        task_enu_m=np.array([[rng.integers(1, 3), 0.0, 0.0] for _ in range(n)]),
        speed_m_s=np.ones(n),
        value=rng.integers(1, 3, n).astype(float),
        service_s=np.zeros(n),
        success=rng.choice([0.5, 1.0], (n, n)),
        survival=np.ones((n, n)),
        horizon_s=3.0,
    )

    stage = single_stage(problem)
    routes, _ = run(
        problem, TeamState.at_start(problem), rank_of(stage.sequence), rule_by_name("greedy")
    )

    assert stage.objective == pytest.approx(best_assignment_value(problem))
    assert evaluate(problem, routes)[0] == pytest.approx(stage.objective)


def test_inactive_uavs_come_last_and_closed_tasks_are_not_assigned() -> None:
    problem = random_problem(np.random.default_rng(3), 4, 6)
    state = TeamState.at_start(problem)
    state.active[[0, 2]] = False
    state.open[:4] = False

    stage = single_stage(problem, state)

    assert set(stage.sequence[:2]) == {1, 3}
    assert stage.sequence[2:] == (0, 2)
    assert {stage.tasks[1], stage.tasks[3]} == {4, 5}
    assert stage.tasks[0] is stage.tasks[2] is None
