from __future__ import annotations

import copy
import gc
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from swarm.allocation import Problem, TeamState
from swarm.kernels._kernels import KernelProblem
from swarm.kernels.lower_level import GREEDY, decide
from swarm.model import TaskId, UavId
from tests.support.problems import table_1


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


@settings(deadline=None, max_examples=80)
@drawn(
    seed=st.integers(0, 2**32 - 1),
    n_task=st.integers(1, 130),
    shape=st.sampled_from(["even", "lattice", "line", "one spot", "far apart", "huge"]),
)
def test_near_tasks_are_the_nearest_in_order_and_of_equals_the_first(
    seed: int, n_task: int, shape: str
) -> None:
    rng = np.random.default_rng(seed)
    task_enu_m = rng.uniform(-50.0, 50.0, (n_task, 3))
    if shape == "lattice":
        task_enu_m = rng.integers(0, 6, (n_task, 3)).astype(float)
    elif shape == "line":
        task_enu_m[:, 0] = 7.0
    elif shape == "one spot":
        task_enu_m[:] = task_enu_m[0]
    elif shape == "far apart":
        task_enu_m[:: max(1, n_task // 2)] += 1e6
    elif shape == "huge":
        task_enu_m *= 1e150
    ones = np.ones((1, n_task))
    handle = Problem(
        uav_ids=(UavId("u"),),
        task_ids=tuple(TaskId(f"t{k}") for k in range(n_task)),
        start_enu_m=np.zeros((1, 3)),
        task_enu_m=task_enu_m,
        speed_m_s=np.ones(1),
        value=np.ones(n_task),
        service_s=np.zeros(n_task),
        success=ones,
        survival=ones,
        horizon_s=1.0,
    ).kernel

    d = task_enu_m[None, :, :] - task_enu_m[:, None, :]
    away_m = np.sqrt((d[..., 0] ** 2 + d[..., 1] ** 2) + d[..., 2] ** 2)
    np.fill_diagonal(away_m, np.inf)
    order = np.argsort(away_m, axis=1, kind="stable")[:, : min(48, n_task - 1)]
    assert np.array_equal(handle.near, order)
