from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.allocation import TeamState, evaluate, executed_objective
from tests.support import reference
from tests.support.problems import any_problem, random_problem, table_1
from tests.support.reference import team_worth


def random_routes(rng: np.random.Generator, n_uav: int, n_task: int) -> list[list[int]]:
    routes: list[list[int]] = [[] for _ in range(n_uav)]
    for task in rng.permutation(n_task):
        routes[int(rng.integers(n_uav))].append(int(task))
    return routes


@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 4), n_task=st.integers(0, 8))
def test_objective_and_times_equal_the_definition(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    routes = random_routes(np.random.default_rng(seed), n_uav, n_task)

    objective, completion_s = evaluate(problem, routes)

    assert objective == pytest.approx(reference.objective(problem, routes), abs=1e-9)
    assert dict(enumerate(completion_s)) == reference.completion_s(problem, routes)


@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 4), n_task=st.integers(0, 8))
def test_lists_may_go_on_from_where_the_team_stands(seed: int, n_uav: int, n_task: int) -> None:
    rng = np.random.default_rng(seed)
    problem = any_problem(seed, n_uav, n_task)
    routes = random_routes(rng, n_uav, n_task)
    state = TeamState.at_start(problem)
    state.free_s[:] = rng.uniform(0.0, 9.0, n_uav)
    state.survived[:] = rng.uniform(0.0, 1.0, n_uav)
    state.place_enu_m[:] = rng.uniform(0.0, 10.0, (n_uav, 3))

    objective, completion_s = evaluate(problem, routes, state)

    assert objective == pytest.approx(team_worth(problem, state, routes), abs=1e-9)
    for uav, route in enumerate(routes):
        times_s = [state.free_s[uav], *(completion_s[task] for task in route)]
        assert times_s == sorted(times_s)


@given(seed=st.integers(0, 2**32 - 1), n_task=st.integers(0, 8))
def test_executing_as_planned_is_worth_what_was_planned(seed: int, n_task: int) -> None:
    problem = any_problem(seed, 3, n_task)
    routes = random_routes(np.random.default_rng(seed), 3, n_task)

    objective, completion_s = evaluate(problem, routes)

    assert executed_objective(problem, routes, completion_s) == pytest.approx(objective)


def test_tasks_on_no_list_count_nothing() -> None:
    objective, completion_s = evaluate(table_1(), [[1], [], []])

    assert objective == pytest.approx(0.9 * 7.0 * (5.0 - np.sqrt(13.0) / 4.0))
    assert np.isnan(completion_s).tolist() == [True, False, *[True] * 6]


def test_visit_without_success_costs_survival_but_earns_nothing() -> None:
    problem = random_problem(
        np.random.default_rng(3), 1, 2, lowest_survival=0.5, highest_survival=0.5, horizon_s=9.0
    )

    worth = executed_objective(problem, [[0, 1]], [np.nan, 4.0])

    assert worth == pytest.approx(0.5 * problem.weight[0, 1] * 5.0)


def test_task_visited_twice_counts_once() -> None:
    problem = table_1()
    times_s = np.full(8, np.nan)
    times_s[0] = 2.0

    assert executed_objective(problem, [[0], [0], []], times_s) == pytest.approx(0.9 * 5.0 * 3.0)


def test_task_visited_twice_counts_for_the_uav_named() -> None:
    problem = table_1()
    times_s = np.full(8, np.nan)
    times_s[0] = 2.0

    worth = executed_objective(problem, [[0], [0], []], times_s, done_by=[1] * 8)

    assert worth == pytest.approx(0.7 * 5.0 * 3.0)


@pytest.mark.parametrize("routes", [[[0], []], [[0], [0], []], [[8], [], []], [[-1], [], []]])
def test_impossible_lists_are_refused(routes: list[list[int]]) -> None:
    with pytest.raises(ValueError, match=r"routes|twice"):
        evaluate(table_1(), routes)


def test_times_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="completion_s"):
        executed_objective(table_1(), [[], [], []], [1.0])
