"""A good complete tour of one UAV over many tasks: beam search, then local search.

Deterministic and without proof; `swarm.allocation.tours` is exact for few tasks.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from swarm.allocation.problem import FloatArray, IntArray

__all__ = ["BEAM_WIDTH", "good_tours", "tour_values"]

BEAM_WIDTH = 64
_SWEEPS = 6
_REACH = 12
"""How many places away a task may be moved; a longer way would hardly ever pay."""
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


def tour_values(
    tours: IntArray,
    completion_s: FloatArray,
    weight: FloatArray,
    survival: FloatArray,
    leg_s: FloatArray,
    horizon_s: float,
) -> FloatArray:
    """(k,) worth of (k, n) tours given as positions in order; other arguments as `good_tours`."""
    times_s = np.empty(tours.shape)
    times_s[:, 0] = completion_s[tours[:, 0]]
    times_s[:, 1:] = leg_s[tours[:, :-1], tours[:, 1:]]
    np.cumsum(times_s, axis=1, out=times_s)
    worth = weight[tours] * (horizon_s - times_s)
    if (survival != 1.0).any():
        worth[:, 1:] *= np.cumprod(survival[tours[:, :-1]], axis=1)
    values: FloatArray = worth.sum(axis=1)
    return values


def good_tours(
    completion_s: FloatArray,
    weight: FloatArray,
    survival: FloatArray,
    leg_s: FloatArray,
    horizon_s: float,
) -> tuple[IntArray, float, float]:
    """A good tour over n >= 2 tasks, and what it loses by another first task.

    Args:
        completion_s: (n,) completion time of each task if it is first [s].
        weight: (n,) p·m.
        survival: (n,) survival probabilities.
        leg_s: (n, n) time from completing one task to completing another [s].
        horizon_s: D [s].

    Returns:
        (n,) positions in order, its worth with S = 1 before, and the best worth found among
        tours that begin with another task.
    """
    arguments = (completion_s, weight, survival, leg_s, horizon_s)
    tours = _beam(*arguments)
    values = tour_values(tours, *arguments)
    best, value = tours[int(values.argmax())], float(values.max())
    for _ in range(_SWEEPS):
        near = _neighbours(best)
        values = tour_values(near, *arguments)
        if not values.max() > value:
            break
        best, value = near[int(values.argmax())], float(values.max())
    near = np.concatenate([_neighbours(best), tours])
    values = tour_values(near, *arguments)
    return best, value, float(values[near[:, 0] != best[0]].max())


def _beam(
    completion_s: FloatArray,
    weight: FloatArray,
    survival: FloatArray,
    leg_s: FloatArray,
    horizon_s: float,
) -> IntArray:
    """Grow many tours task by task; keep the most promising.

    What is earned, plus what the waiting tasks would earn if all were done at once by a UAV whose
    chance to be there wears off as usual: a detour costs its time × all the weight still waiting.
    """
    n = len(weight)
    left_s = horizon_s - completion_s
    typical = float(survival.mean())
    # chance to be there for a waiting task, on average over all of them, by how many wait
    there = np.concatenate([[1.0], np.cumsum(typical ** np.arange(n)) / np.arange(1, n + 1)])
    promise = left_s * (weight + there[n - 1] * survival * (weight.sum() - weight))
    tours = np.argsort(-promise, kind="stable")[:BEAM_WIDTH, None]
    last = tours[:, 0]
    open_ = np.ones((len(tours), n), dtype=np.bool_)
    open_[np.arange(len(tours)), last] = False
    free_s = completion_s[last]
    earned = weight[last] * (horizon_s - free_s)
    survived = survival[last]
    waiting = weight.sum() - weight[last]
    mark = np.arange(1, n + 1, dtype=np.uint64) * _GOLDEN
    mark ^= mark >> np.uint64(29)
    mark *= _GOLDEN  # sums of marks tell sets apart
    visited = mark[last]
    for left in range(n - 1, 0, -1):
        times_s = free_s[:, None] + leg_s[last]
        left_s = horizon_s - times_s
        gain = survived[:, None] * weight * left_s
        after = (waiting[:, None] - weight) * (survived[:, None] * survival) * left_s
        after *= there[left - 1]
        promise = np.where(open_, earned[:, None] + gain + after, -np.inf).reshape(-1)
        chosen = _best_distinct(promise, (visited[:, None] + mark).reshape(-1), n)
        row, task = np.divmod(chosen, n)
        visited = visited[row] + mark[task]
        tours = np.concatenate([tours[row], task[:, None]], axis=1)
        open_ = open_[row]
        open_[np.arange(len(row)), task] = False
        free_s, earned = times_s[row, task], earned[row] + gain[row, task]
        survived, waiting = survived[row] * survival[task], waiting[row] - weight[task]
        last = task
    return tours


def _best_distinct(promise: FloatArray, visited: npt.NDArray[np.uint64], n: int) -> IntArray:
    """Up to `BEAM_WIDTH` flat (row, task) places with the best promises.

    Of those that have visited the same set and end at the same task, only the best stays.
    """
    head = min(2 * BEAM_WIDTH, len(promise))
    chosen = np.argpartition(-promise, head - 1)[:head]
    chosen = chosen[promise[chosen] > -np.inf]
    chosen = chosen[np.lexsort((chosen, -promise[chosen]))]
    key = visited[chosen] * np.uint64(n) + (chosen % n).astype(np.uint64)
    _, first = np.unique(key, return_index=True)
    first.sort()
    distinct: IntArray = chosen[first[:BEAM_WIDTH]]
    return distinct


@lru_cache(maxsize=64)
def _moves(n: int) -> IntArray:
    """(k, n) permutations of places: reversals, and moves of one or two tasks, over some way."""
    here = list(range(n))
    moves: dict[tuple[int, ...], None] = {}
    for low in range(n):
        for high in range(low + 1, min(n, low + 1 + _REACH)):
            moves[(*here[:low], *here[low : high + 1][::-1], *here[high + 1 :])] = None
    for size in (1, 2):
        for low in range(n - size + 1):
            rest = here[:low] + here[low + size :]
            for to in range(max(0, low - _REACH), min(len(rest), low + _REACH) + 1):
                if to != low:
                    moves[(*rest[:to], *here[low : low + size], *rest[to:])] = None
    return np.array(list(moves), dtype=np.int64)


def _neighbours(tour: IntArray) -> IntArray:
    neighbours: IntArray = tour[_moves(len(tour))]
    return neighbours
