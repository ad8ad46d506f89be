"""The sequence that reproduces the optimal single-stage assignment (Theorem 3, Corollary 4).

For one round, every UAV taking at most one task, the sequence is constructed instead of
searched: solve the assignment, then peel off a UAV that holds its own best remaining
task, as Lemma 2 promises one, until none is left. Leaves out: later rounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import FloatArray, Problem

__all__ = ["SingleStage", "single_stage"]


@dataclass(frozen=True, slots=True)
class SingleStage:
    """One round: who takes what, and the order in which greedy UAVs decide on just that."""

    sequence: tuple[int, ...]
    """UAV indices, first decider first; UAVs without a task come last."""
    tasks: tuple[int | None, ...]
    """Task index of each UAV; None for those without."""
    objective: float
    """Σ of the round's terms of eq. 1 [value·s]."""


def single_stage(problem: Problem, state: TeamState | None = None) -> SingleStage:
    """The optimal first round, and the priority sequence that makes greedy UAVs fly it.

    As many tasks as possible are assigned, and of all such assignments one with the largest
    objective is.

    Args:
        problem: the mission.
        state: where the team stands; at its start when None. UAVs that are not active and tasks
            that are not open take no part.
    """
    from scipy.optimize import linear_sum_assignment

    state = TeamState.at_start(problem) if state is None else state
    scores = np.array([_scores(problem, state, uav) for uav in range(problem.n_uav)]).reshape(
        problem.n_uav, problem.n_task
    )
    possible = problem.capable & state.open & state.active[:, None]
    # one forbidden pair must cost more than any assignment of possible pairs can earn
    forbidden = -(1.0 + 2.0 * min(scores.shape) * float(np.abs(scores).max(initial=0.0)))
    rows, columns = linear_sum_assignment(np.where(possible, scores, forbidden), maximize=True)
    tasks: dict[int, int] = {
        int(uav): int(task) for uav, task in zip(rows, columns, strict=True) if possible[uav, task]
    }
    objective = float(sum(scores[uav, task] for uav, task in tasks.items()))
    sequence = _peel(np.where(possible, scores, -np.inf), tasks)
    held = set(sequence)
    rest = [uav for uav in range(problem.n_uav) if uav not in held]
    rest.sort(key=lambda uav: not state.active[uav])
    return SingleStage(
        tuple(sequence + rest), tuple(tasks.get(uav) for uav in range(problem.n_uav)), objective
    )


def _scores(problem: Problem, state: TeamState, uav: int) -> FloatArray:
    """(n_task,) greedy score of every task, open or not."""
    travel_s = problem.travel_s(uav, state.place_enu_m[uav])
    completion_s = (float(state.free_s[uav]) + travel_s) + problem.service_s
    weight: FloatArray = float(state.survived[uav]) * problem.weight[uav]
    return (problem.horizon_s - completion_s) * weight


def _peel(scores: FloatArray, tasks: dict[int, int]) -> list[int]:
    """Order the UAVs of ``tasks`` so that each holds its best task of those left.

    Equal scores can hide that UAV; then the tasks are passed round among UAVs to whom they are
    worth the same, and ``tasks`` is changed accordingly.
    """
    scores = scores.copy()
    holders = dict(tasks)
    order: list[int] = []
    while holders:
        wishes = {uav: int(scores[uav].argmax()) for uav in holders}
        content = [uav for uav, task in holders.items() if wishes[uav] == task]
        if not content:
            _pass_round(holders, wishes)
            tasks.update(holders)
            continue
        uav = content[0]
        order.append(uav)
        scores[:, holders.pop(uav)] = -np.inf
    return order


def _pass_round(holders: dict[int, int], wishes: dict[int, int]) -> None:
    """Give one UAV, or a ring of UAVs, what they wish; optimal holdings lose nothing by it."""
    holder_of = {task: uav for uav, task in holders.items()}
    uav = next(iter(holders))
    chain: list[int] = []
    while uav not in chain:
        chain.append(uav)
        if wishes[uav] not in holder_of:  # nobody's task: it is worth the same as the held one
            holders[uav] = wishes[uav]
            return
        uav = holder_of[wishes[uav]]
    for member in chain[chain.index(uav) :]:
        holders[member] = wishes[member]
