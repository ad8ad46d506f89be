"""Eq. 1: what ordered task lists are worth, planned or as executed.

J = Σ p · S · m · (D − t), with S the probability that the UAV survived every task
before this one on its list.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import FloatArray, Problem


def evaluate(
    problem: Problem, routes: Sequence[Sequence[int]], state: TeamState | None = None
) -> tuple[float, FloatArray]:
    """J of eq. 1 and completion times of lists of task indices; tasks on no list count 0.

    They are flown from ``state``; from the starts at mission time 0 when it is None.

    Returns:
        J [value·s] and (n_task,) completion times [s], NaN for tasks on no list.

    Raises:
        ValueError: a list too many or too few, an unknown task, or a task taken twice.
    """
    _require_lists(problem, routes)
    state = TeamState.at_start(problem) if state is None else state
    objective = 0.0
    completion_s = np.full(problem.n_task, np.nan)
    travel_s = iter(problem.travel_by_lists_s(routes, state.place_enu_m).tolist())
    for uav, route in enumerate(routes):
        free_s, survived = float(state.free_s[uav]), float(state.survived[uav])
        for task in route:
            if not np.isnan(completion_s[task]):
                raise ValueError(f"task {problem.task_ids[task]} is on the lists twice")
            free_s = (free_s + next(travel_s)) + float(problem.service_s[task])
            completion_s[task] = free_s
            objective += survived * problem.weight[uav, task] * (problem.horizon_s - free_s)
            survived *= problem.survival[uav, task]
    return float(objective), completion_s


def executed_objective(
    problem: Problem,
    routes: Sequence[Sequence[int]],
    completion_s: npt.ArrayLike,
    done_by: npt.ArrayLike | None = None,
    until_s: npt.ArrayLike | None = None,
) -> float:
    """Eq. 1 with the completion times that came about.

    Args:
        problem: the mission.
        routes: task indices per UAV as visited; S is the product along them, also over visits
            that do not count.
        completion_s: (n_task,) real completion times [s]; NaN for tasks not done, which count 0.
        done_by: (n_task,) index of the UAV whose visit counts, where several visited one task;
            the first list that names the task when left out.
        until_s: (n_task,) what completions are subtracted from, where tasks are due before D [s];
            D for all when left out.

    Raises:
        ValueError: a list too many or too few, an unknown task, or a wrong shape.
    """
    _require_lists(problem, routes)
    until = np.full(problem.n_task, problem.horizon_s) if until_s is None else np.asarray(until_s)
    times_s = np.asarray(completion_s, dtype=np.float64)
    if times_s.shape != (problem.n_task,):
        raise ValueError(f"completion_s must have shape {(problem.n_task,)}, not {times_s.shape}")
    by = None if done_by is None else np.asarray(done_by)
    objective = 0.0
    counted = np.isnan(times_s)
    for uav, route in enumerate(routes):
        survived = 1.0
        for task in route:
            if not counted[task] and (by is None or by[task] == uav):
                counted[task] = True
                left_s = until[task] - times_s[task]
                objective += survived * problem.weight[uav, task] * left_s
            survived *= problem.survival[uav, task]
    return float(objective)


def _require_lists(problem: Problem, routes: Sequence[Sequence[int]]) -> None:
    if len(routes) != problem.n_uav:
        raise ValueError(f"routes must hold {problem.n_uav} lists, not {len(routes)}")
    for route in routes:
        for task in route:
            if not 0 <= task < problem.n_task:
                raise ValueError(f"routes name task index {task} of {problem.n_task}")
