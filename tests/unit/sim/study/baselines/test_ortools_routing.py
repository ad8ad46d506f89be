from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.exact import optimum
from sim.study.baselines import ortools_routing
from sim.study.baselines.index_rules import value_per_time
from sim.study.baselines.ortools_routing import matrix_bytes, ortools_routes, require_installed
from swarm.allocation import evaluate
from swarm.runtime.errors import InputError
from tests.support.problems import random_problem, table_1


def test_every_task_is_with_a_capable_uav() -> None:
    problem = random_problem(np.random.default_rng(3), 4, 12, incapable_frac=0.3)
    routes = ortools_routes(problem, 0.2)
    taken = sorted(task for route in routes for task in route)
    assert taken == np.flatnonzero(problem.capable.any(axis=0)).tolist()
    assert all(problem.capable[uav, task] for uav, route in enumerate(routes) for task in route)


def test_table_1_is_solved_nearly_to_the_optimum() -> None:
    problem = table_1()
    worth, _ = evaluate(problem, ortools_routes(problem, 0.3))
    assert 0.95 * 120.3335 < worth <= optimum(problem).objective + 1e-9


def test_given_lists_are_begun_with() -> None:
    problem = random_problem(np.random.default_rng(4), 3, 10, horizon_s=30.0)
    begin = value_per_time(problem)
    routes = ortools_routes(problem, 0.2, start=begin)
    assert sorted(task for route in routes for task in route) == list(range(10))


def test_average_success_alone_is_another_model() -> None:
    problem = table_1()
    routes = ortools_routes(problem, 0.2, success_share=0.0)
    assert sorted(task for route in routes for task in route) == list(range(8))


def test_missions_without_tasks_have_empty_lists() -> None:
    problem = random_problem(np.random.default_rng(5), 3, 0)
    assert ortools_routes(problem, 0.1) == [[], [], []]


def test_memory_of_the_matrices_is_estimated() -> None:
    assert matrix_bytes(table_1()) == 2 * 8 * 3 * 81


def test_absence_is_told_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ortools_routing, "is_installed", lambda: False)
    with pytest.raises(InputError, match="ortools needs the extra bench: pip install") as caught:
        require_installed()
    assert "\n" not in str(caught.value)
