from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.exact import (
    MAX_TASKS,
    ProblemTooLargeError,
    estimated_s,
    optimum,
    worst_value,
)
from swarm.allocation import evaluate
from tests.support import reference
from tests.support.problems import any_problem, random_problem, table_1


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 3), n_task=st.integers(0, 5))
def test_best_and_worst_equal_brute_force(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    best, worst = reference.extreme_values(problem)

    found = optimum(problem)

    assert found.objective == pytest.approx(best, abs=1e-9)
    assert worst_value(problem) == pytest.approx(worst, abs=1e-9)
    assert evaluate(problem, found.routes)[0] == pytest.approx(best, abs=1e-9)
    for uav, route in enumerate(found.routes):
        assert problem.capable[uav, list(route)].all()


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), lowest=st.sampled_from([0.5, 1.0]))
def test_no_random_lists_beat_the_optimum(seed: int, lowest: float) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 5, 8, lowest_survival=lowest)
    best, worst = optimum(problem).objective, worst_value(problem)

    for _ in range(30):
        order, cuts = rng.permutation(8), np.sort(rng.integers(0, 9, 4))
        routes = [part.tolist() for part in np.split(order, cuts)]
        assert worst - 1e-9 <= evaluate(problem, routes)[0] <= best + 1e-9


def test_table_1_lists_are_the_papers() -> None:
    assert optimum(table_1()).routes == ((1, 2, 0), (5, 7, 6), (3, 4))


def test_tasks_nobody_is_capable_of_are_left_out() -> None:
    problem = random_problem(np.random.default_rng(1), 2, 4, incapable_frac=1.0)

    assert optimum(problem).routes == ((), ())
    assert optimum(problem).objective == 0.0


def test_too_many_tasks_are_refused_before_any_work() -> None:
    problem = random_problem(np.random.default_rng(0), 2, MAX_TASKS + 1)

    assert estimated_s(problem) == float("inf")
    with pytest.raises(ProblemTooLargeError, match=f"2 UAVs × {MAX_TASKS + 1} tasks"):
        optimum(problem)
    with pytest.raises(ProblemTooLargeError):
        worst_value(problem)


def test_too_much_work_is_refused_by_its_estimate() -> None:
    problem = random_problem(np.random.default_rng(0), 3, 8)

    with pytest.raises(ProblemTooLargeError, match="the limit is 0 s"):
        optimum(problem, limit_s=0.0)
