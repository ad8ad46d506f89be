"""The exact optimum of the field's problem for small missions.

What one UAV can do with every set of tasks, then the division of the tasks among the UAVs, then,
where bases have few slots, which lists go together (`swarm.kernels.field_exact`). Tasks with due_s
may be left out; of the others as few as can be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from coordinator.planner.exact import ProblemTooLargeError
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels import field_exact as kernel

MAX_FIELD_TASKS = kernel.MOST_TASKS
"""With more the subsets are too many."""
_LIMIT_S = 60.0
_LABEL_S = 1e-7
"""Of one partial list, compared with others of its set."""
_MOST_LABELS_S = 7.0
"""Until the partial lists of one UAV fill their memory, and the proof is given up."""


class TooManyListsError(ProblemTooLargeError):
    """The optimum cannot be proven: there are too many partial lists that none is better than."""

    def __init__(self, n_uav: int, n_task: int) -> None:
        super().__init__(n_uav, n_task, MAX_FIELD_TASKS, float("inf"), _LIMIT_S)
        why = "their partial lists take more memory than there may be"
        self.args = (f"{n_uav} UAVs × {n_task} tasks are too many to prove the optimum: {why}",)


@dataclass(frozen=True, slots=True)
class FieldPlanLists:
    """The best lists that were found, and whether there are no better ones."""

    proven: bool
    objective: float
    """J from the state on [value·s]."""
    n_left_out: int
    """Tasks without due_s that are on no list."""
    lists: tuple[tuple[int, ...], ...]
    """Items of each UAV, as in `swarm.kernels.field_exact`."""


def estimated_field_s(problem: FieldProblem, state: FieldState | None = None) -> float:
    """Rough upper estimate of the proof's duration on one core of 2020 [s]; inf when too large.

    How many partial lists there are that none is better than can only be guessed: most without
    windows, fewer the more there are. Where slots are few nobody knows before how many lists have
    to be flown together: the limit must end that.
    """
    state = FieldState.at_start(problem) if state is None else state
    decides = state.active & np.isfinite(state.free_s)
    n = int((problem.capable[decides] & state.open).any(axis=0).sum())
    if n > MAX_FIELD_TASKS:
        return float("inf")
    n_decide = int(decides.sum())
    n_way = n + int(problem.is_line[state.open].sum())
    n_base = problem.n_base if bool(np.isfinite(problem.full_s[decides]).any()) else 0
    labels = 2.0**n * n_way * (1.0 + n_base) * (1.0 + 0.15 * n * (n_base > 0))
    own_s = min(labels * (n_way + n_base) * _LABEL_S, _MOST_LABELS_S)
    few = n_base > 0 and bool(((problem.slots > 0) & (problem.slots < n_decide)).any())
    return n_decide * (own_s + 3.0**n * 2e-9) * (2.5 if few else 1.0) + 1e-5


def field_optimum_before(
    problem: FieldProblem,
    should_stop: Callable[[], bool] | None,
    limit_s: float = _LIMIT_S,
    *,
    state: FieldState | None = None,
    known: Sequence[Sequence[int]] = (),
    threads: int | None = None,
) -> FieldPlanLists | None:
    """The best lists, or the best found until told to stop; None if that was before any.

    Args:
        problem: the mission.
        should_stop: asked every few milliseconds.
        limit_s: refuse when `estimated_field_s` is above this [s]; the run itself is not cut short.
        state: where the team stands; at its start when None.
        known: lists to be better than, which shorten the proof where slots are few.
        threads: at most this many; does not change the result.

    Raises:
        ProblemTooLargeError: more than `MAX_FIELD_TASKS` tasks, the estimate is above ``limit_s``,
            or there turn out to be too many partial lists.
    """
    state = FieldState.at_start(problem) if state is None else state
    estimate_s = estimated_field_s(problem, state)
    if estimate_s > limit_s:
        n_task = int(state.open.sum())
        raise ProblemTooLargeError(problem.n_uav, n_task, MAX_FIELD_TASKS, estimate_s, limit_s)
    best = kernel.optimum(
        problem.kernel, state, known=known, threads=threads, should_stop=should_stop
    )
    if best.outcome is kernel.ProofOutcome.TOO_LARGE:
        raise TooManyListsError(problem.n_uav, int(state.open.sum()))
    if not best.found:
        return None
    proven = best.outcome is kernel.ProofOutcome.PROVEN
    return FieldPlanLists(proven, best.objective, best.n_left_out, best.lists)
