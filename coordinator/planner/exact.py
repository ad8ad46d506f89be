"""The exact optimum of eq. 1 for small problems: the yardstick of every other method.

Dynamic programming over task subsets per UAV (`swarm.allocation.tours`), then over the
division of the tasks among the UAVs, 3ⁿ combinations per UAV. All tasks that some UAV is
capable of are on the lists, also late ones. Leaves out: anything approximate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swarm.allocation.problem import FloatArray, IntArray, Problem
from swarm.allocation.tours import TourTable, best_tour, legs_s, mask_of, tour_table
from swarm.errors import SwarmError

__all__ = ["MAX_TASKS", "Optimum", "ProblemTooLargeError", "estimated_s", "optimum", "worst_value"]

MAX_TASKS = 14
"""More would need gigabytes."""
_LIMIT_S = 60.0


class ProblemTooLargeError(SwarmError):
    """The optimum cannot be proven within the limits."""

    def __init__(self, n_uav: int, n_task: int, estimate_s: float, limit_s: float) -> None:
        if n_task > MAX_TASKS:
            why = f"the limit is {MAX_TASKS} tasks"
        else:
            why = f"it would take about {estimate_s:.0f} s and the limit is {limit_s:g} s"
        super().__init__(f"{n_uav} UAVs × {n_task} tasks are too many to prove the optimum: {why}")
        self.n_uav = n_uav
        self.n_task = n_task
        self.estimate_s = estimate_s
        self.limit_s = limit_s


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
    if n > MAX_TASKS:
        return float("inf")
    certain = bool((problem.survival[problem.capable] == 1.0).all())
    table_s = 2.0**n * n * n * (6e-9 if certain else 1e-6) + n * n * 2e-5
    return problem.n_uav * (table_s + 3.0**n * 3e-8 + n * 2e-5)


def optimum(problem: Problem, limit_s: float = _LIMIT_S) -> Optimum:
    """The best lists.

    Args:
        problem: the mission.
        limit_s: refuse when `estimated_s` is above this [s]; the run itself is not cut short.

    Raises:
        ProblemTooLargeError: more than `MAX_TASKS` tasks, or the estimate is above ``limit_s``.
    """
    estimate_s = estimated_s(problem)
    if estimate_s > limit_s:
        raise ProblemTooLargeError(problem.n_uav, problem.n_task, estimate_s, limit_s)
    return _optimum(problem, problem.weight)


def worst_value(problem: Problem, limit_s: float = _LIMIT_S) -> float:
    """J of the worst lists that hold all tasks; normalises objectives as the paper does.

    Raises:
        ProblemTooLargeError: as `optimum`.
    """
    estimate_s = estimated_s(problem)
    if estimate_s > limit_s:
        raise ProblemTooLargeError(problem.n_uav, problem.n_task, estimate_s, limit_s)
    return -_optimum(problem, -problem.weight).objective


@dataclass(frozen=True, slots=True, eq=False)
class _UavTours:
    """One UAV's best tours over every subset of the tasks it is capable of."""

    tasks: IntArray
    """(k,) task indices, ascending."""
    bits: IntArray
    """(k,) bit of each of them among all tasks."""
    table: TourTable
    leg_s: FloatArray
    completion_s: FloatArray
    values: FloatArray
    """(2**n,) best worth of every subset of all tasks; -inf where one is beyond the UAV."""

    @classmethod
    def of(cls, problem: Problem, uav: int, universe: IntArray, weight: FloatArray) -> _UavTours:
        tasks = np.flatnonzero(problem.capable[uav])
        bits = np.searchsorted(universe, tasks)
        leg_s = legs_s(problem, uav, tasks)
        table = tour_table(
            weight[uav, tasks], problem.survival[uav, tasks], leg_s, problem.horizon_s
        )
        travel_s = problem.travel_s(uav, problem.start_enu_m[uav])
        completion_s = (travel_s + problem.service_s)[tasks]
        masks = np.zeros(1, dtype=np.int64)
        for bit in bits:
            masks = np.concatenate([masks, masks | (1 << int(bit))])
        values = np.full(1 << len(universe), -np.inf)
        values[masks] = table.values(completion_s)
        return cls(tasks, bits, table, leg_s, completion_s, values)

    def route(self, subset: int) -> tuple[int, ...]:
        own = mask_of(np.flatnonzero((subset >> self.bits) & 1))
        tour = best_tour(self.table, own, self.completion_s, self.leg_s)
        return tuple(int(self.tasks[position]) for position in tour)


def _optimum(problem: Problem, weight: FloatArray) -> Optimum:
    universe = np.flatnonzero(problem.capable.any(axis=0))
    if problem.n_uav == 0 or len(universe) == 0:
        return Optimum(0.0, ((),) * problem.n_uav)
    fleet = [_UavTours.of(problem, uav, universe, weight) for uav in range(problem.n_uav)]
    best = [fleet[0].values]  # best[j][subset]: its worth divided among UAVs 0..j
    for uav in fleet[1:-1]:
        best.append(_divide(best[-1], uav.values))
    left = (1 << len(universe)) - 1
    routes: list[tuple[int, ...]] = [()] * problem.n_uav
    objective: float | None = None
    for j in range(problem.n_uav - 1, 0, -1):
        subsets = _subsets(left)
        worth = best[j - 1][left ^ subsets] + fleet[j].values[subsets]
        chosen = int(worth.argmax())
        objective = float(worth[chosen]) if objective is None else objective
        routes[j] = fleet[j].route(int(subsets[chosen]))
        left ^= int(subsets[chosen])
    routes[0] = fleet[0].route(left)
    return Optimum(float(best[0][left]) if objective is None else objective, tuple(routes))


def _divide(first: FloatArray, second: FloatArray) -> FloatArray:
    """For every set, the best of first[set without s] + second[s] over its subsets s.

    Each task is nowhere, with the first or with the second: spread both arrays over these 3ⁿ
    cases, add, and take the better of the last two task by task.
    """
    n = len(first).bit_length() - 1
    cases = first.reshape((2,) * n)
    others = second.reshape((2,) * n)
    for axis in range(n):
        cases = cases.take((0, 1, 0), axis=axis)
        others = others.take((0, 0, 1), axis=axis)
    cases = cases + others
    for axis in range(n):
        nowhere, with_first, with_second = np.moveaxis(cases, axis, 0)
        cases = np.stack([nowhere, np.maximum(with_first, with_second)], axis=axis)
    return cases.reshape(-1)


def _subsets(mask: int) -> IntArray:
    """All subsets of ``mask``, the empty one first."""
    subsets = np.zeros(1, dtype=np.int64)
    for bit in range(mask.bit_length()):
        if mask >> bit & 1:
            subsets = np.concatenate([subsets, subsets | (1 << bit)])
    return subsets
