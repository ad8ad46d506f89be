from __future__ import annotations

import math
import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import Problem, TeamState
from swarm.kernels.lower_level import GREEDY, decide
from swarm.model import Task, TaskId
from tests.support.problems import (
    random_problem,
    table_1,
    table_1_mission,
    with_acceleration,
)


def arguments() -> dict[str, Any]:
    problem = random_problem(np.random.default_rng(0), 2, 3)
    names = ("uav_ids", "task_ids", "start_enu_m", "task_enu_m", "speed_m_s", "value")
    return {
        name: getattr(problem, name)
        for name in (*names, "service_s", "success", "survival", "horizon_s")
    }


def test_mission_becomes_arrays_in_scenario_order() -> None:
    problem = table_1()

    assert problem.uav_ids == ("uav1", "uav2", "uav3")
    assert problem.task_ids == ("t1", "t2", "t3", "t4", "t5", "t6", "t7", "t8")
    assert problem.start_enu_m.tolist() == [[5.0, 0.0, 0.0]] * 3
    assert problem.task_enu_m[1].tolist() == [2.0, 2.0, 0.0]
    assert problem.success[0].tolist() == [0.9, 0.9, 0.9, 0.7, 0.7, 0.7, 0.7, 0.7]
    assert problem.weight[1, 7] == 0.9 * 4.5
    assert problem.capable.all()


def test_rows_and_columns_may_be_chosen() -> None:
    mission = table_1_mission()
    extra = Task(TaskId("extra"), (1.0, 2.0, 3.0), 2.0, service_s=4.0)

    problem = Problem.from_mission(mission, uavs=mission.uavs[1:2], tasks=[extra, mission.tasks[6]])

    assert problem.uav_ids == ("uav2",)
    assert problem.task_ids == ("extra", "t7")
    assert problem.success.tolist() == [[0.7, 0.9]]
    assert problem.service_s.tolist() == [4.0, 0.0]


def test_other_tasks_make_the_same_problem_as_one_made_of_them_from_the_start() -> None:
    mission = table_1_mission()
    extra = Task(TaskId("extra"), (1.0, 2.0, 3.0), 2.0, service_s=4.0)
    t = mission.tasks
    before = Problem.from_mission(mission, tasks=[t[0], t[4], t[7]])

    for tasks, known in (
        ([t[4], extra, t[0], t[6]], [1, -1, 0, -1]),
        ([t[0], t[4], t[7]], [0, 1, 2]),
        ([extra], [-1]),
        ([], []),
    ):
        again, anew = (
            before.with_tasks(mission, tasks, known),
            Problem.from_mission(mission, tasks=tasks),
        )
        assert (again.uav_ids, again.task_ids) == (anew.uav_ids, anew.task_ids)
        for name in ("task_enu_m", "value", "service_s", "success", "survival", "weight"):
            assert np.array_equal(getattr(again, name), getattr(anew, name))


def test_empty_fleet_and_empty_task_list_keep_their_shapes() -> None:
    problem = Problem.from_mission(table_1_mission(), uavs=[], tasks=[])

    assert problem.success.shape == (0, 0)
    assert problem.start_enu_m.shape == (0, 3)


def test_pop_ups_are_columns_unless_left_out_by_the_caller() -> None:
    mission = table_1_mission()
    late = replace(mission.tasks[0], appears_s=1.0)
    mission = replace(mission, tasks=(late, *mission.tasks[1:]))

    assert Problem.from_mission(mission).n_task == 8
    assert Problem.from_mission(mission.known_at_start()).n_task == 7


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("start_enu_m", np.zeros((2, 2))),
        ("task_enu_m", np.zeros((2, 3))),
        ("speed_m_s", np.zeros(2)),
        ("speed_m_s", np.array([1.0, -1.0])),
        ("speed_m_s", np.array([1.0, np.inf])),
        ("value", np.array([1.0, 2.0, -1.0])),
        ("value", np.array([1.0, 2.0, np.nan])),
        ("service_s", np.array([0.0, -0.1, 0.0])),
        ("success", np.full((2, 3), 1.1)),
        ("success", np.full((3, 2), 0.5)),
        ("survival", np.full((2, 3), -0.1)),
        ("acceleration_m_s2", np.ones(3)),
        ("acceleration_m_s2", np.array([1.0, 0.0])),
        ("acceleration_m_s2", np.array([1.0, -1.0])),
        ("acceleration_m_s2", np.array([1.0, np.nan])),
        ("horizon_s", 0.0),
        ("horizon_s", float("nan")),
        ("uav_ids", ("a", "a")),
        ("task_ids", ("a", "b", "a")),
    ],
)
def test_wrong_argument_is_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        Problem(**{**arguments(), name: value})


def test_arrays_are_copies_that_cannot_be_written() -> None:
    given = arguments()
    problem = Problem(**given)

    with pytest.raises(ValueError, match="read-only"):
        problem.value[0] = 1.0
    assert problem.value is not given["value"]


def test_travel_time_is_the_distance_in_three_dimensions_over_the_speed() -> None:
    problem = table_1()

    travel_s = problem.travel_s(1, np.array([1.0, 10.0, 12.0]))

    assert travel_s[0] == 12.0 / 5.0
    assert travel_s[1] == pytest.approx(np.sqrt(1.0 + 64.0 + 144.0) / 5.0)


# -- Acceleration ---------------------------------------------------------------------------------


def plain_leg_s(length_m: float, speed_m_s: float, acceleration_m_s2: float) -> float:
    """From rest to rest, by the formula and a float at a time."""
    if length_m >= (speed_m_s * speed_m_s) / acceleration_m_s2:
        return length_m / speed_m_s + speed_m_s / acceleration_m_s2
    return 2.0 * math.sqrt(length_m / acceleration_m_s2)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_way_to_ask_for_a_leg_gives_the_same_float(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = with_acceleration(random_problem(rng, 4, 6), seed)
    accelerations_m_s2 = problem.acceleration_m_s2
    if accelerations_m_s2 is None:  # infinite ones only
        accelerations_m_s2 = np.full(4, np.inf)
    state = TeamState.at_start(problem)
    for uav in range(4):
        offset_m = problem.task_enu_m - problem.start_enu_m[uav]
        plain_s = [
            plain_leg_s(
                math.sqrt((east_m * east_m + north_m * north_m) + up_m * up_m),
                float(problem.speed_m_s[uav]),
                float(accelerations_m_s2[uav]),
            )
            for east_m, north_m, up_m in offset_m.tolist()
        ]
        between_s = problem.travel_between_s(uav)
        route = rng.permutation(6)
        along_s = problem.travel_along_s(uav, problem.start_enu_m[uav], route)
        lists: list[list[int]] = [[], [], [], []]
        lists[uav] = route.tolist()

        assert problem.travel_s(uav, problem.start_enu_m[uav]).tolist() == plain_s
        assert along_s[0] == plain_s[route[0]]
        assert along_s[1:].tolist() == between_s[route[:-1], route[1:]].tolist()
        assert problem.travel_by_lists_s(lists, problem.start_enu_m).tolist() == along_s.tolist()
        for task in np.flatnonzero(problem.capable[uav]):
            state.open[:] = np.arange(6) == task
            compiled = decide(problem.kernel, state, uav, GREEDY)
            assert compiled is not None
            assert compiled[3] == (0.0 + plain_s[task]) + problem.service_s[task]


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_way_round_is_quicker(seed: int) -> None:
    problem = with_acceleration(random_problem(np.random.default_rng(seed), 2, 8), seed)

    for uav in range(2):
        direct_s = problem.travel_between_s(uav)
        round_s = direct_s[:, :, None] + direct_s[None, :, :]  # from, by way of, to

        assert (direct_s[:, None, :] <= round_s + 1e-9).all()


def test_a_mission_without_accelerations_is_plain_and_so_is_one_of_infinite_ones() -> None:
    plain = table_1()
    at_once = replace(plain, acceleration_m_s2=np.full(3, np.inf))

    assert plain.acceleration_m_s2 is at_once.acceleration_m_s2 is None


def test_a_mission_tells_of_accelerations_uav_by_uav() -> None:
    mission = table_1_mission()
    mission = replace(
        mission, uavs=(replace(mission.uavs[0], acceleration_m_s2=2.0), *mission.uavs[1:])
    )
    problem = Problem.from_mission(mission)
    other = Problem.from_mission(mission, tasks=mission.tasks[2:]).with_tasks(
        mission, mission.tasks, [-1, -1, 0, 1, 2, 3, 4, 5]
    )

    for each in (problem, other, pickle.loads(pickle.dumps(problem))):
        assert each.acceleration_m_s2 is not None
        assert each.acceleration_m_s2.tolist() == [2.0, np.inf, np.inf]
        assert each.travel_between_s(0).tolist() == problem.travel_between_s(0).tolist()
    assert problem.travel_between_s(1).tolist() == table_1().travel_between_s(1).tolist()
