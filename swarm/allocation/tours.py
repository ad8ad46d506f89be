"""The best complete tours of one UAV over every subset of a few tasks (eq. 6), exactly.

A table holds, for every set of tasks and every first task of it, what the rest of the
best tour is worth as a function of when the first one is completed. It does not
depend on where the UAV is, so one table serves all decisions over subsets of its tasks.
Leaves out: dividing tasks among UAVs, and sets too large for a table
(`swarm.allocation.long_tours`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from swarm.allocation.problem import FloatArray, IntArray, Problem

__all__ = ["TourTable", "best_tour", "legs_s", "mask_of", "tour_table"]


class TourTable(Protocol):
    """Best tours over subsets of n tasks; a subset is a bit mask of positions 0..n-1."""

    def first_values(self, mask: int, completion_s: FloatArray) -> FloatArray:
        """(n,) worth of the best tour over ``mask`` by its first task [value·s].

        Args:
            mask: the set to tour; not empty.
            completion_s: (n,) completion time of each task if it is first [s].

        Returns:
            Worth with S = 1 before the first task; -inf for tasks not in ``mask``.
        """
        ...

    def values(self, completion_s: FloatArray) -> FloatArray:
        """(2**n,) worth of the best tour over every subset, 0 for the empty one."""
        ...


def legs_s(problem: Problem, uav: int, tasks: IntArray) -> FloatArray:
    """(n, n) time from completing ``tasks[i]`` to completing ``tasks[j]`` [s]."""
    rows = [
        problem.travel_s(uav, problem.task_enu_m[task])[tasks] + problem.service_s[tasks]
        for task in tasks
    ]
    return np.array(rows).reshape(len(tasks), len(tasks))


def tour_table(
    weight: FloatArray, survival: FloatArray, leg_s: FloatArray, horizon_s: float
) -> TourTable:
    """The table of n tasks; time and memory grow as n²·2ⁿ, more where survival is below 1.

    Args:
        weight: (n,) p·m of each task; negative weights find the worst tours.
        survival: (n,) probability of surviving each task.
        leg_s: (n, n) time from completing one task to completing another [s].
        horizon_s: D [s].
    """
    if (survival == 1.0).all():
        return _CostTable.build(weight, leg_s, horizon_s)
    return _LabelTable.build(weight, survival, leg_s, horizon_s)


def best_tour(
    table: TourTable, mask: int, completion_s: FloatArray, leg_s: FloatArray
) -> list[int]:
    """Positions of the best tour over ``mask`` in order; arguments as for the table."""
    tour: list[int] = []
    while mask:
        first = int(table.first_values(mask, completion_s).argmax())
        tour.append(first)
        mask ^= 1 << first
        completion_s = completion_s[first] + leg_s[first]
    return tour


def mask_of(positions: IntArray) -> int:
    """The bit mask with these positions set."""
    return sum(1 << int(position) for position in positions)


def _subset_sums(weight: FloatArray) -> FloatArray:
    """(2**n,) sums over every subset, added in ascending order of position."""
    sums = np.zeros(1)
    for number in weight:
        sums = np.concatenate([sums, sums + number])
    return sums


def _layers(n: int) -> list[IntArray]:
    """The masks of n bits by how many are set."""
    masks = np.arange(1 << n, dtype=np.int64)
    count = np.zeros(len(masks), dtype=np.int64)
    for bit in range(n):
        count += (masks >> bit) & 1
    return [masks[count == size] for size in range(n + 1)]


@dataclass(frozen=True, slots=True, eq=False)
class _CostTable:
    """Survival 1: backward recursion where each leg costs its time × the weight still open.

    ``cost[R, k]`` is Σ weight × time after completing k, over the best tour of R from k.
    """

    horizon_s: float
    total: FloatArray
    cost: FloatArray

    @classmethod
    def build(cls, weight: FloatArray, leg_s: FloatArray, horizon_s: float) -> _CostTable:
        n = len(weight)
        total = _subset_sums(weight)
        cost = np.full((1 << n, n), np.inf)
        cost[0] = 0.0
        for masks in _layers(n)[1:]:
            for first in range(n):
                with_first = masks[(masks >> first) & 1 == 1]
                rest = cost[with_first ^ (1 << first), first]
                candidate = total[with_first][:, None] * leg_s[:, first] + rest[:, None]
                cost[with_first] = np.minimum(cost[with_first], candidate)
        return cls(horizon_s, total, cost)

    def first_values(self, mask: int, completion_s: FloatArray) -> FloatArray:
        n = len(completion_s)
        values = np.full(n, -np.inf)
        inside = np.array([i for i in range(n) if mask >> i & 1])
        rest = self.cost[mask ^ (1 << inside), inside]
        values[inside] = self.total[mask] * (self.horizon_s - completion_s[inside]) - rest
        return values

    def values(self, completion_s: FloatArray) -> FloatArray:
        best = np.full(len(self.total), -np.inf)
        best[0] = 0.0
        masks = np.arange(len(self.total), dtype=np.int64)
        for first, time_s in enumerate(completion_s):
            inside = masks[(masks >> first) & 1 == 1]
            worth = self.total[inside] * (self.horizon_s - time_s)
            worth -= self.cost[inside ^ (1 << first), first]
            best[inside] = np.maximum(best[inside], worth)
        return best


@dataclass(frozen=True, slots=True, eq=False)
class _Labels:
    """Tours over sets of one size: worth ``constant − slope × τ``, τ the first completion.

    Sorted by ``key = mask · n + first``, so that all of one mask and first task stand together.
    """

    key: IntArray
    constant: FloatArray
    slope: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class _LabelTable:
    """Survival below 1: label setting; a tour's worth is linear in its first completion time."""

    n: int
    by_size: tuple[_Labels, ...]
    """Entry s holds the tours of s + 1 tasks."""

    @classmethod
    def build(
        cls, weight: FloatArray, survival: FloatArray, leg_s: FloatArray, horizon_s: float
    ) -> _LabelTable:
        n = len(weight)
        single = np.arange(n, dtype=np.int64)
        layer = _Labels((1 << single) * n + single, weight * horizon_s, weight.copy())
        by_size = [layer]
        for _ in range(n - 1):
            keys, constants, slopes = [], [], []
            masks, seconds = layer.key // n, layer.key % n
            for first in range(n):
                free = np.flatnonzero((masks >> first) & 1 == 0)
                leg = leg_s[first, seconds[free]]
                keys.append((masks[free] | (1 << first)) * n + first)
                rest = layer.constant[free] - layer.slope[free] * leg
                constants.append(weight[first] * horizon_s + survival[first] * rest)
                slopes.append(weight[first] + survival[first] * layer.slope[free])
            layer = _undominated(
                np.concatenate(keys), np.concatenate(constants), np.concatenate(slopes)
            )
            by_size.append(layer)
        return cls(n, tuple(by_size))

    def first_values(self, mask: int, completion_s: FloatArray) -> FloatArray:
        labels = self.by_size[mask.bit_count() - 1]
        low, high = np.searchsorted(labels.key, [mask * self.n, (mask + 1) * self.n])
        first = labels.key[low:high] - mask * self.n
        worth = labels.constant[low:high] - labels.slope[low:high] * completion_s[first]
        values = np.full(self.n, -np.inf)
        np.maximum.at(values, first, worth)
        return values

    def values(self, completion_s: FloatArray) -> FloatArray:
        best = np.zeros(1 << self.n)
        for labels in self.by_size:
            mask, first = np.divmod(labels.key, self.n)
            worth = labels.constant - labels.slope * completion_s[first]
            starts = np.flatnonzero(np.diff(mask, prepend=-1))
            best[mask[starts]] = np.maximum.reduceat(worth, starts)
        return best


def _undominated(key: IntArray, constant: FloatArray, slope: FloatArray) -> _Labels:
    """Sorted by key, without labels that are nowhere the best of their key for τ >= 0."""
    order = np.lexsort((-constant, slope, key))
    key, constant, slope = key[order], constant[order], slope[order]
    # a label with a larger slope must have a larger constant than all before it in its group;
    # ranks make that an exact running maximum over all groups at once
    _, rank = np.unique(constant, return_inverse=True)
    group = np.cumsum(np.diff(key, prepend=key[:1]) != 0)
    height = rank.reshape(-1) + group * (len(key) + 1)
    highest_before = np.concatenate([[-1], np.maximum.accumulate(height)[:-1]])
    keep = height > highest_before
    key, constant, slope = key[keep], constant[keep], slope[keep]
    for _ in range(3):  # labels under the line between their neighbours; leftovers do no harm
        if len(key) < 3:
            break
        a, b = constant, slope
        under = (key[:-2] == key[1:-1]) & (key[1:-1] == key[2:])
        under &= (a[1:-1] - a[:-2]) * (b[2:] - b[:-2]) <= (b[1:-1] - b[:-2]) * (a[2:] - a[:-2])
        if not under.any():
            break
        keep = np.concatenate([[True], ~under, [True]])
        key, constant, slope = key[keep], constant[keep], slope[keep]
    return _Labels(key, constant, slope)
