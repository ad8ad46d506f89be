"""Random missions for benchmarks and studies: of any size, and those the paper draws.

Of any size: UAVs and tasks uniform over a square whose side grows with the root of the number of
tasks, so that tasks stand equally dense at every size.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from swarm.allocation.problem import Problem
from swarm.model import Mission, Task, TaskId, Uav, UavId

_TABLE_SIDE_M = 10.0
"""Of the paper's square of targets."""
_SIDE_M = 5000.0
"""Of the square with `_TASKS_ON_IT` tasks."""
_TASKS_ON_IT = 500
_HORIZON_SHARE = 1.2


def area_side_m(n_task: int) -> float:
    """Side of the square over which so many tasks are spread [m]."""
    return _SIDE_M * math.sqrt(n_task / _TASKS_ON_IT)


def random_mission(
    n_uav: int,
    n_task: int,
    seed: int,
    *,
    horizon_s: float | None = None,
    lowest_survival: float = 1.0,
) -> Problem:
    """Speeds 8–15 m/s, p 0.6–1, values 1–10, service 0–20 s, all uniform.

    Survival probabilities are uniform from ``lowest_survival`` to 1. D is some 1.2 × the makespan
    of a good plan when None.
    """
    rng = np.random.default_rng(seed)
    side_m = area_side_m(n_task)
    if horizon_s is None:
        # a tour of n of M uniform places is some 0.75·side·n/√M long
        leg_s = 0.75 * side_m / math.sqrt(n_task) / 11.5 + 10.0
        horizon_s = _HORIZON_SHARE * (n_task / n_uav * leg_s * 1.5 + 0.1 * side_m / 11.5)
    ground = np.zeros((n_uav + n_task, 3))
    ground[:, :2] = rng.uniform(0.0, side_m, (n_uav + n_task, 2))
    return Problem(
        uav_ids=tuple(UavId(f"uav{i + 1}") for i in range(n_uav)),
        task_ids=tuple(TaskId(f"t{i + 1}") for i in range(n_task)),
        start_enu_m=ground[:n_uav],
        task_enu_m=ground[n_uav:],
        speed_m_s=rng.uniform(8.0, 15.0, n_uav),
        value=rng.uniform(1.0, 10.0, n_task),
        service_s=rng.uniform(0.0, 20.0, n_task),
        success=rng.uniform(0.6, 1.0, (n_uav, n_task)),
        survival=rng.uniform(lowest_survival, 1.0, (n_uav, n_task)),
        horizon_s=float(horizon_s),
    )


def mission_of(problem: Problem, name: str) -> Mission:
    """``problem`` as a mission of that name, all of whose tasks are known at the start."""
    starts_m, places_m = problem.start_enu_m.tolist(), problem.task_enu_m.tolist()
    accelerations_m_s2 = problem.acceleration_m_s2
    ids = problem.task_ids
    return Mission(
        name=name,
        horizon_s=problem.horizon_s,
        uavs=tuple(
            Uav(
                id=uav,
                position_enu_m=tuple(starts_m[row]),
                speed_m_s=float(problem.speed_m_s[row]),
                success=dict(zip(ids, problem.success[row].tolist(), strict=True)),
                survival=dict(zip(ids, problem.survival[row].tolist(), strict=True)),
                acceleration_m_s2=(
                    None
                    if accelerations_m_s2 is None or np.isinf(accelerations_m_s2[row])
                    else float(accelerations_m_s2[row])
                ),
            )
            for row, uav in enumerate(problem.uav_ids)
        ),
        tasks=tuple(
            Task(
                id=task,
                position_enu_m=tuple(place_m),
                value=float(problem.value[column]),
                service_s=float(problem.service_s[column]),
            )
            for column, (task, place_m) in enumerate(zip(ids, places_m, strict=True))
        ),
    )


def random_table_problem(table: Problem, seed: int, index: int) -> Problem:
    """One of the paper's random problems: targets uniform in 10 × 10, all UAVs at one (x, 0).

    x is uniform within 0..10; everything else is as in ``table``, Table I. Each index is drawn by
    itself, so that the first problems are the same however many follow.
    """
    rng = np.random.default_rng([seed, index])
    start_enu_m = np.zeros((table.n_uav, 3))
    start_enu_m[:, 0] = rng.uniform(0.0, _TABLE_SIDE_M)
    task_enu_m = np.zeros((table.n_task, 3))
    task_enu_m[:, :2] = rng.uniform(0.0, _TABLE_SIDE_M, (table.n_task, 2))
    return replace(table, start_enu_m=start_enu_m, task_enu_m=task_enu_m)
