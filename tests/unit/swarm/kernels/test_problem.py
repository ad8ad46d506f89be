from __future__ import annotations

import copy
import gc
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from swarm.allocation import Problem, TeamState
from swarm.kernels._kernels import KernelProblem
from swarm.kernels.lower_level import GREEDY, decide
from tests.support.problems import random_problem, table_1


def arguments() -> dict[str, Any]:
    problem = table_1()
    names = ("start_enu_m", "task_enu_m", "speed_m_s", "value", "service_s", "success")
    return {name: getattr(problem, name) for name in (*names, "survival", "horizon_s")}


def prepare(**given: Any) -> KernelProblem:
    named = table_1()
    return Problem(uav_ids=named.uav_ids, task_ids=named.task_ids, **given).kernel


def test_handle_knows_its_size() -> None:
    handle = prepare(**arguments())

    assert (handle.n_uav, handle.n_task, handle.horizon_s) == (3, 8, 5.0)


def test_handle_knows_who_can_do_what_and_what_it_is_worth() -> None:
    given = arguments()
    given["success"] = given["success"].copy()
    given["success"][1, 2] = 0.0
    handle = prepare(**given)

    assert np.array_equal(handle.capable, given["success"] > 0.0)
    assert np.array_equal(handle.weight, given["success"] * given["value"])


def test_what_a_handle_shows_outlives_it_and_cannot_be_written() -> None:
    given = arguments()
    weight = prepare(**given).weight
    gc.collect()

    assert np.array_equal(weight, given["success"] * given["value"])
    with pytest.raises(ValueError, match="read-only"):
        weight[0, 0] = 1.0


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("start_enu_m", np.zeros((3, 2))),
        ("start_enu_m", np.zeros((2, 3))),
        ("start_enu_m", np.full((3, 3), np.inf)),
        ("task_enu_m", np.zeros(24)),
        ("task_enu_m", np.full((8, 3), np.nan)),
        ("task_enu_m", "here"),
        ("speed_m_s", np.array([1.0, 0.0, 1.0])),
        ("speed_m_s", np.array([1.0, -1.0, 1.0])),
        ("speed_m_s", np.array([1.0, np.inf, 1.0])),
        ("speed_m_s", np.array([1.0, np.nan, 1.0])),
        ("speed_m_s", 3.0),
        ("speed_m_s", [1j, 1j, 1j]),
        ("service_s", np.full(8, -0.1)),
        ("service_s", np.full(8, np.nan)),
        ("service_s", np.zeros(7)),
        ("value", np.full(8, -1.0)),
        ("value", np.full(8, np.inf)),
        ("value", [[1.0]]),
        ("success", np.full((3, 8), 1.1)),
        ("success", np.full((3, 8), -0.1)),
        ("success", np.ones((8, 3))),
        ("survival", np.full((3, 8), 1.1)),
        ("survival", np.full((3, 8), np.nan)),
        ("horizon_s", 0.0),
        ("horizon_s", -1.0),
        ("horizon_s", float("nan")),
        ("horizon_s", float("inf")),
    ],
)
def test_wrong_argument_is_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        prepare(**{**arguments(), name: value})


def test_arrays_may_change_afterwards() -> None:
    given = {name: np.array(value) for name, value in arguments().items() if name != "horizon_s"}
    handle = prepare(**given, horizon_s=5.0)
    state = TeamState.at_start(table_1())
    before = decide(handle, state, 0, GREEDY)
    for array in given.values():
        array[:] = 0

    assert decide(handle, state, 0, GREEDY) == before


def test_problems_survive_copying_and_pickling() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)

    for twin in (copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))):
        assert twin.task_ids == problem.task_ids
        assert decide(twin.kernel, state, 0, GREEDY) == decide(problem.kernel, state, 0, GREEDY)


@pytest.mark.parametrize("n_task", [1, 2, 30, 60, 300])
@pytest.mark.parametrize("spread_m", [(1e3, 1e3, 0.0), (0.0, 1e3, 50.0), (0.0, 0.0, 0.0)])
def test_near_tasks_are_those_nearest_by_straight_line_and_then_by_index(
    n_task: int, spread_m: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(n_task)
    # Whole numbers, so that many are equally far away.
    places_m = np.round(rng.uniform(0.0, 0.02, (n_task, 3)) * spread_m)
    problem = replace(random_problem(rng, 2, n_task), task_enu_m=places_m)

    near = problem.kernel.near

    assert near.shape == (n_task, min(48, n_task - 1))
    for task in range(n_task):
        offset_m = places_m - places_m[task]
        others = np.delete(np.arange(n_task), task)
        away_m2 = (offset_m**2).sum(axis=1)[others]
        assert (
            near[task].tolist() == others[np.lexsort((others, away_m2))][: near.shape[1]].tolist()
        )
