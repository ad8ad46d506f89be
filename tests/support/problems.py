"""Problems that tests of allocation and planning share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from swarm.allocation import Problem
from swarm.model import Mission, Task, TaskId, Uav, UavId

TARGETS_M = ((1, 10), (2, 2), (3, 7), (7, 1), (8, 8), (4, 3), (5, 9), (6, 5))
VALUES = (5.0, 7.0, 4.0, 6.0, 5.0, 4.0, 4.5, 4.5)
GOOD_AT = (("t1", "t2", "t3"), ("t7", "t8"), ("t4", "t5", "t6"))


def table_1_mission(horizon_s: float = 5.0) -> Mission:
    """Table I: three UAVs at (5, 0), eight targets."""
    return Mission(
        name="table-1",
        horizon_s=horizon_s,
        uavs=tuple(
            Uav(UavId(f"uav{i + 1}"), (5.0, 0.0, 0.0), speed, dict.fromkeys(GOOD_AT[i], 0.9))
            for i, speed in enumerate((4.0, 5.0, 4.0))
        ),
        tasks=tuple(
            Task(TaskId(f"t{i + 1}"), (float(x), float(y), 0.0), value)
            for i, ((x, y), value) in enumerate(zip(TARGETS_M, VALUES, strict=True))
        ),
        success_default=0.7,
    )


def table_1(horizon_s: float = 5.0) -> Problem:
    """Table I as arrays."""
    return Problem.from_mission(table_1_mission(horizon_s))


def random_problem(
    rng: np.random.Generator,
    n_uav: int,
    n_task: int,
    *,
    lowest_survival: float = 1.0,
    highest_survival: float = 1.0,
    incapable_frac: float = 0.0,
    horizon_s: float | None = None,
) -> Problem:
    """Everything drawn at random; service times and heights too, late tasks included."""
    success = rng.uniform(0.3, 1.0, (n_uav, n_task))
    success[rng.uniform(size=success.shape) < incapable_frac] = 0.0
    return Problem(
        uav_ids=tuple(UavId(f"u{i}") for i in range(n_uav)),
        task_ids=tuple(TaskId(f"t{i}") for i in range(n_task)),
        start_enu_m=rng.uniform(0.0, 10.0, (n_uav, 3)),
        task_enu_m=rng.uniform(0.0, 10.0, (n_task, 3)),
        speed_m_s=rng.uniform(2.0, 6.0, n_uav),
        value=rng.uniform(0.0, 7.0, n_task),
        service_s=rng.uniform(0.0, 1.0, n_task) * rng.integers(0, 2, n_task),
        success=success,
        survival=rng.uniform(lowest_survival, highest_survival, (n_uav, n_task)),
        horizon_s=float(rng.choice([3.0, 8.0, 30.0])) if horizon_s is None else horizon_s,
    )


def any_problem(seed: int, n_uav: int, n_task: int) -> Problem:
    """A random problem of a random kind: certain or deadly, all able or not, all quick or not."""
    rng = np.random.default_rng(seed)
    lowest = float(rng.choice([0.0, 0.5, 1.0]))
    problem = random_problem(
        rng,
        n_uav,
        n_task,
        lowest_survival=lowest,
        incapable_frac=float(rng.choice([0.0, 0.3])),
    )
    return with_acceleration(problem, seed) if seed % 2 else problem


def with_acceleration(problem: Problem, seed: int) -> Problem:
    """``problem`` with UAVs most of which take their time to change speed, some far too long.

    At 2 to 6 m/s legs of up to 17 m are then of both kinds.
    """
    rng = np.random.default_rng([seed, 1])
    choices = np.array([0.1, 1.0, 3.0, np.inf])
    return replace(problem, acceleration_m_s2=rng.choice(choices, problem.n_uav))


def paper_problem(rng: np.random.Generator) -> Problem:
    """One of the 50 random problems: targets uniform in 10 × 10, all UAVs at one (x, 0).

    Values, probabilities, speeds and horizon are those of Table I.
    """
    table = table_1()
    start_m = [float(rng.uniform(0.0, 10.0)), 0.0, 0.0]
    targets_m = rng.uniform(0.0, 10.0, (8, 2))
    return Problem(
        uav_ids=table.uav_ids,
        task_ids=table.task_ids,
        start_enu_m=np.array([start_m] * 3),
        task_enu_m=np.column_stack([targets_m, np.zeros(8)]),
        speed_m_s=table.speed_m_s,
        value=table.value,
        service_s=table.service_s,
        success=table.success,
        survival=table.survival,
        horizon_s=table.horizon_s,
    )


def line_of_tasks(values: list[float], horizon_s: float = 100.0, survival: float = 1.0) -> Problem:
    """One UAV at 1 m/s in the middle of tasks 10 m away, right and left in turn."""
    n = len(values)
    return Problem(
        uav_ids=(UavId("u"),),
        task_ids=tuple(TaskId(f"t{i}") for i in range(n)),
        start_enu_m=np.zeros((1, 3)),
        task_enu_m=np.array([[10.0 * (-1) ** i, 0.0, 0.0] for i in range(n)]),
        speed_m_s=np.ones(1),
        value=np.array(values),
        service_s=np.zeros(n),
        success=np.ones((1, n)),
        survival=np.full((1, n), survival),
        horizon_s=horizon_s,
    )
