"""Theorem 5: when is the greedy choice provably also the lookahead choice?

With λ = Z2/Z1 (second best over best greedy score) and p̄ the largest survival
probability, p̄ ≤ (1 − λ)/(2 − λ) is sufficient. Why: a tour that begins with another
task is worth at most Z2 + Z1·(p̄ + p̄² + …) < Z1 then, because a later task earns at
most its greedy score times the survival of all before it; and some tour that begins
with the greedy task is worth at least Z1. The second half fails if the rest of that
tour comes so late that it costs more than it earns, so it is checked on one tour.
Nothing is claimed where a premise fails. Leaves out: taking decisions.
"""

from __future__ import annotations

import numpy as np

from swarm.allocation.problem import FloatArray, IntArray, Problem

__all__ = ["agrees", "rest_is_worth_flying"]


def agrees(
    problem: Problem, uav: int, tasks: IntArray, scores: FloatArray, completion_s: FloatArray
) -> bool:
    """Whether greedy is proven equal to lookahead for one decision.

    Args:
        problem: the mission.
        uav: index of the deciding UAV.
        tasks: (n,) indices of the open tasks it is capable of, ascending.
        scores: (n,) greedy scores p·m·(D − t), of one sign convention and scale (S ≥ 0 may be
            left out or included).
        completion_s: (n,) completion times if taken next [s].
    """
    if len(tasks) == 1:
        return True  # one tour only
    best = int(scores.argmax())
    first = float(scores[best])
    if not first > 0.0:
        return False
    highest_survival = float(problem.survival[uav, tasks].max())
    if highest_survival > 0.5:
        return False  # (1 − λ)/(2 − λ) is at most 1/2 for λ within 0..1
    second = float(np.delete(scores, best).max())
    # a negative second best makes the rest negative too, and the check below sees to it
    ratio = max(0.0, second / first)
    if highest_survival * (2.0 - ratio) > 1.0 - ratio:
        return False
    return rest_is_worth_flying(problem, uav, tasks, best, float(completion_s[best]))


def rest_is_worth_flying(
    problem: Problem, uav: int, tasks: IntArray, first: int, free_s: float
) -> bool:
    """Whether, after ``tasks[first]`` is done at ``free_s``, some tour of the others earns >= 0.

    Tries the tour that always goes to the task with the best greedy score next; finding that one
    to earn less than 0 proves nothing, and the answer is then False.
    """
    place = problem.task_enu_m[tasks[first]]
    left = np.delete(tasks, first)
    earned, survived = 0.0, 1.0
    while len(left) and survived > 0.0:
        times_s = (free_s + problem.travel_s(uav, place)[left]) + problem.service_s[left]
        scores = problem.weight[uav, left] * (problem.horizon_s - times_s)
        best = int(scores.argmax())
        task = left[best]
        earned += survived * float(scores[best])
        survived *= float(problem.survival[uav, task])
        free_s, place = float(times_s[best]), problem.task_enu_m[task]
        left = np.delete(left, best)
    return earned >= 0.0
