"""The exact optimum of eq. 1 for small problems: the yardstick of every other method.

Dynamic programming over task subsets per UAV, then over the division of the tasks among the UAVs
(`swarm.kernels.exact`). All tasks that some UAV is capable of are on the lists, also late ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from swarm.allocation.problem import Problem
from swarm.kernels import exact as kernel
from swarm.runtime.errors import SwarmError

MAX_TASKS = kernel.MOST_TASKS
"""With more the subsets are too many, even where every survival probability is 1."""
MAX_UNCERTAIN_TASKS = kernel.MOST_UNCERTAIN_TASKS
"""The same where some are below 1."""
_LIMIT_S = 60.0


class ProblemTooLargeError(SwarmError):
    """The optimum cannot be proven within the limits."""

    def __init__(
        self, n_uav: int, n_task: int, most_tasks: int, estimate_s: float, limit_s: float
    ) -> None:
        if n_task > most_tasks:
            why = f"the limit is {most_tasks} tasks"
        else:
            why = f"it would take about {estimate_s:.0f} s and the limit is {limit_s:g} s"
        super().__init__(f"{n_uav} UAVs × {n_task} tasks are too many to prove the optimum: {why}")


@dataclass(frozen=True, slots=True)
class Optimum:
    """A proven best set of lists."""

    objective: float
    """J [value·s], as the proof's sums have it; `evaluate` of the lists agrees up to rounding."""
    routes: tuple[tuple[int, ...], ...]
    """Task indices per UAV in order of execution."""


def estimated_s(problem: Problem) -> float:
    """Rough upper estimate of `optimum`'s duration on one core of 2020 [s]; inf when too large."""
    n = int(problem.capable.any(axis=0).sum())
    most = _most_tasks(problem)
    if n > most:
        return float("inf")
    table_s = 2.0**n * n * n * (1e-9 if most == MAX_TASKS else 2e-7)
    return problem.n_uav * (table_s + 3.0**n * 2e-9 + 1e-5)


def optimum(
    problem: Problem,
    limit_s: float = _LIMIT_S,
    *,
    worst: bool = False,
    threads: int | None = None,
) -> Optimum:
    """The best lists; see `optimum_before`."""
    solved = optimum_before(problem, None, limit_s, worst=worst, threads=threads)
    assert solved is not None  # noqa: S101 - nobody stops it
    return solved


def optimum_before(
    problem: Problem,
    should_stop: Callable[[], bool] | None,
    limit_s: float = _LIMIT_S,
    *,
    worst: bool = False,
    threads: int | None = None,
) -> Optimum | None:
    """The best lists; None if told to stop before they are proven.

    Args:
        problem: the mission.
        should_stop: asked every few milliseconds.
        limit_s: refuse when `estimated_s` is above this [s]; the run itself is not cut short.
        worst: find the worst lists that hold all tasks instead.
        threads: at most this many; does not change the result.

    Raises:
        ProblemTooLargeError: more than `MAX_TASKS` tasks, or the estimate is above ``limit_s``.
    """
    estimate_s = estimated_s(problem)
    if estimate_s > limit_s:
        raise ProblemTooLargeError(
            problem.n_uav, problem.n_task, _most_tasks(problem), estimate_s, limit_s
        )
    objective, routes = kernel.optimum(
        problem.kernel, worst=worst, threads=threads, should_stop=should_stop
    )
    if np.isnan(objective):
        return None
    return Optimum(objective, tuple(tuple(route) for route in routes))


def worst_value(problem: Problem) -> float:
    """J of the worst lists that hold all tasks; normalises objectives as the paper does."""
    return optimum(problem, worst=True).objective


def _most_tasks(problem: Problem) -> int:
    certain = bool((problem.survival[problem.capable] == 1.0).all())
    return MAX_TASKS if certain else MAX_UNCERTAIN_TASKS
