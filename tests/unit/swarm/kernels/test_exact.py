from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import evaluate
from swarm.kernels.exact import MOST_TASKS, MOST_UNCERTAIN_TASKS, optimum
from tests.support import reference
from tests.support.problems import any_problem, random_problem

SEEDS = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=150)
@given(seed=SEEDS, n_uav=st.integers(1, 3), n_task=st.integers(0, 5))
def test_best_and_worst_equal_brute_force(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    best, worst = reference.extreme_values(problem)

    for wanted, expected in ((False, best), (True, worst)):
        objective, routes = optimum(problem.kernel, worst=wanted)
        assert objective == pytest.approx(expected, abs=1e-9)
        assert evaluate(problem, routes)[0] == pytest.approx(expected, abs=1e-9)
        assert all(problem.capable[uav, route].all() for uav, route in enumerate(routes))


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS, n_uav=st.integers(2, 5), lowest=st.sampled_from([0.5, 1.0]))
def test_lists_are_worth_what_is_said_and_no_random_ones_more(
    seed: int, n_uav: int, lowest: float
) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, n_uav, 9, lowest_survival=lowest)

    best, routes = optimum(problem.kernel)
    worst, bad_routes = optimum(problem.kernel, worst=True)

    assert evaluate(problem, routes)[0] == pytest.approx(best, abs=1e-9)
    assert evaluate(problem, bad_routes)[0] == pytest.approx(worst, abs=1e-9)
    assert sorted(task for route in routes for task in route) == list(range(9))
    for _ in range(20):
        cuts = np.sort(rng.integers(0, 10, n_uav - 1))
        lists = [part.tolist() for part in np.split(rng.permutation(9), cuts)]
        assert worst - 1e-9 <= evaluate(problem, lists)[0] <= best + 1e-9


@pytest.mark.parametrize("lowest", [0.7, 1.0])
def test_threads_change_nothing(lowest: float) -> None:
    problem = random_problem(np.random.default_rng(2), 4, 10, lowest_survival=lowest)

    found = [optimum(problem.kernel, threads=threads) for threads in (1, 2, 5)]

    assert found[0] == found[1] == found[2]


def test_certain_missions_of_14_tasks_are_solved() -> None:
    problem = random_problem(np.random.default_rng(3), 3, 14)

    objective, routes = optimum(problem.kernel)

    assert evaluate(problem, routes)[0] == pytest.approx(objective, abs=1e-9)


def test_limits_are_kept() -> None:
    for n_task, lowest in ((MOST_TASKS + 1, 1.0), (MOST_UNCERTAIN_TASKS + 1, 0.9)):
        problem = random_problem(np.random.default_rng(3), 2, n_task, lowest_survival=lowest)
        with pytest.raises(ValueError, match="at most"):
            optimum(problem.kernel)
    for threads in (0, 5000):
        with pytest.raises(ValueError, match="threads"):
            optimum(any_problem(0, 1, 1).kernel, threads=threads)


def test_nothing_to_do_is_worth_nothing() -> None:
    for n_uav, n_task in ((0, 0), (0, 2), (2, 0)):
        problem = random_problem(np.random.default_rng(3), n_uav, n_task)
        assert optimum(problem.kernel) == (0.0, [[]] * n_uav)


def test_told_to_give_up_it_has_no_answer() -> None:
    problem = random_problem(np.random.default_rng(0), 2, 16)

    objective, routes = optimum(problem.kernel, should_stop=lambda: True)

    assert np.isnan(objective)
    assert routes == [[], []]
