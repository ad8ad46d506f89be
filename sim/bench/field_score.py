"""What lists of items are worth in the field, whoever made them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.problem import FloatArray
from swarm.kernels.field import fly_lists
from swarm.kernels.field_search import optimise_lists


@dataclass(frozen=True, slots=True)
class FieldScore:
    """Lists as our evaluator flies them."""

    objective: float
    """J of eq. 1 [value·s]."""
    left_out: int
    """Tasks without due_s that are not done."""
    broken: int
    """Tasks on the lists from the first on that could not be done there; 0: flown as they are."""
    begin_s: FloatArray
    """(n_task,) when work begins [s]; NaN of what is not done."""
    end_s: FloatArray
    """(n_task,) when work ends [s]; NaN of what is not done."""


def score_in_field(problem: FieldProblem, lists: Sequence[Sequence[int]]) -> FieldScore:
    """Fly ``lists``; where one of them cannot be flown, a rule in its favour decides.

    The order of its tasks is kept, base visits are chosen anew, the best for that order, and only
    tasks for which there are none are dropped.
    """
    state = FieldState.at_start(problem)
    flown = fly_lists(problem.kernel, state, lists)
    wanted = sum(item >= 0 for items in lists for item in items)
    broken = wanted - _tasks_done(lists, flown.done.tolist())
    if not flown.feasible:
        lists = optimise_lists(problem.kernel, state, iterations=0, lists=lists, threads=1).lists
        flown = fly_lists(problem.kernel, state, lists)
    work_s = np.full((problem.n_task, 2), np.nan)
    order = np.array([item for items in lists for item in items], dtype=np.int64)
    tasks = order >= 0
    work_s[order[tasks] >> 1] = flown.times_s[tasks, 2:]
    begin_s, end_s = work_s.T
    left_out = int((problem.required & np.isnan(end_s)).sum())
    return FieldScore(float(flown.value.sum()), left_out, broken, begin_s, end_s)


def _tasks_done(lists: Sequence[Sequence[int]], done: Sequence[int]) -> int:
    """Tasks among the first so many items of each list."""
    return sum(
        item >= 0 for items, count in zip(lists, done, strict=True) for item in items[:count]
    )
