"""What inserting a task into a UAV's path gains, for all tasks and places at once.

The change of eq. 1 when task j goes between the k-th and the next task of a path: j's own term,
less the delay and the risk it brings to all that follow. Leaves out: who bids and who wins.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import FloatArray, IntArray, Problem

__all__ = ["Insertion"]


class Insertion:
    """Gains of insertion into paths that begin where the team stands.

    Args:
        problem: the mission.
        state: when and where each UAV is free, and what it has survived; at its start when None.

    Keeps (n_task,) distances for every task that has been on a path: at most n_task² floats.
    """

    def __init__(self, problem: Problem, state: TeamState | None = None) -> None:
        self._problem = problem
        self._state = TeamState.at_start(problem) if state is None else state
        self._from_task_m: dict[int, FloatArray] = {}
        self._columns_m = np.ascontiguousarray(problem.task_enu_m.T)
        self._from_start_m = [self._distances_m(place) for place in self._state.place_enu_m]

    def gains(self, uav: int, path: Sequence[int]) -> tuple[FloatArray, IntArray]:
        """The best insertion of each task into ``path``.

        Returns:
            (n_task,) marginal J of each task at its best place [value·s], meaningless for tasks
            that are on the path, and (n_task,) those places: 0 is before the first task. Ties go
            to the earlier place.
        """
        problem = self._problem
        rows_m = [self._from_start_m[uav], *(self._row_m(task) for task in path)]
        go_s = np.array(rows_m) / problem.speed_m_s[uav]
        nodes = np.array(path, dtype=np.int64)
        legs_s = go_s[np.arange(len(path)), nodes]
        free_s = np.concatenate(
            ([self._state.free_s[uav]], legs_s + problem.service_s[nodes])
        ).cumsum()
        survived = np.concatenate(
            ([self._state.survived[uav]], problem.survival[uav, nodes])
        ).cumprod()
        weight = survived[:-1] * problem.weight[uav, nodes]
        later_weight = _from_the_end(weight)
        later_worth = _from_the_end(weight * (problem.horizon_s - free_s[1:]))

        detour_s = go_s + problem.service_s
        gain = problem.horizon_s - free_s[:, None] - detour_s
        gain *= survived[:, None] * problem.weight[uav]
        detour_s[:-1] += go_s[1:] - legs_s[:, None]
        survival = problem.survival[uav]
        gain -= survival * detour_s * later_weight[:, None]
        gain -= (1.0 - survival) * later_worth[:, None]
        places: IntArray = np.argmax(gain, axis=0)
        return gain[places, np.arange(problem.n_task)], places

    def _row_m(self, task: int) -> FloatArray:
        row = self._from_task_m.get(task)
        if row is None:
            row = self._from_task_m[task] = self._distances_m(self._problem.task_enu_m[task])
        return row

    def _distances_m(self, place_enu_m: FloatArray) -> FloatArray:
        distances: FloatArray = np.sqrt(((self._columns_m - place_enu_m[:, None]) ** 2).sum(axis=0))
        return distances


def _from_the_end(terms: FloatArray) -> FloatArray:
    """(n + 1,) sum of the terms from each place on; the last is 0."""
    sums: FloatArray = np.concatenate((np.cumsum(terms[::-1])[::-1], [0.0]))
    return sums
