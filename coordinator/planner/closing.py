"""The best disjoint lists among those that can be part of an optimum: branch and bound.

Given are a bound on J with its prices and all lists that could be part of something better than
what is known (`swarm.kernels.routes_pricing.worthy_lists`). A branch says who does a task, or who
does not; its bound is that of the bundle method over the lists left to it. Lists that earn too
little for anything better are dropped in every branch.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.allocation.problem import FloatArray, IntArray
from swarm.kernels.routes_pricing import ListBundle, WorthyLists

_TOLERANCE = 2e-10
"""Of J: what is better by less is not better."""
_STEPS = 12
"""Of the bundle method in a branch, at most."""
_SWEEPS = 200
_MOST_HELD = 25_000_000
"""Lists that open branches have left, all together: 200 MB. With more it ends as if stopped."""
_LEAST_PROGRESS = 0.05
"""Of what a branch's bound is above the best known: a step that lowers it by less is the last."""


@dataclass(frozen=True, slots=True)
class Disjoint:
    """What came of it."""

    bound: float
    """No disjoint lists among those given, nor what was known, are worth more [value·s]."""
    worth: float
    """Of the best disjoint lists that were met, and maybe less than what was known [value·s]."""
    chosen: tuple[int, ...]
    """Their indices."""


def best_disjoint(
    lists: WorthyLists,
    price: FloatArray,
    n_uav: int,
    *,
    known: float,
    bound: float,
    should_stop: Callable[[], bool],
) -> Disjoint:
    """Choose at most one list per UAV, no task twice, for the largest sum of worths.

    Args:
        lists: to choose from.
        price: (n_task,) at which to begin [value·s].
        n_uav: how many UAVs there are.
        known: worth of what is known; what is worth more is looked for.
        bound: on the sum [value·s].
        should_stop: asked every few milliseconds; then the bound is that of what is left.
    """
    return _Branches(lists, price, n_uav, known, should_stop).run(bound)


class _Branches:
    def __init__(
        self,
        lists: WorthyLists,
        price: FloatArray,
        n_uav: int,
        known: float,
        should_stop: Callable[[], bool],
    ) -> None:
        self._lists, self._n_uav, self._n_task = lists, n_uav, len(price)
        self._should_stop = should_stop
        self._best, self._met, self._chosen = known, 0.0, ()
        self._sizes = np.array([len(one) for one in lists.lists], dtype=np.int64)
        self._starts = np.concatenate([[0], np.cumsum(self._sizes)])
        self._flat = np.array([task for one in lists.lists for task in one], dtype=np.int64)
        self._price = price
        self._step = max(1e-9, 0.1 * float(price.mean()))
        self._open: list[tuple[float, int, IntArray, FloatArray]] = []
        self._made = self._held = 0

    _chosen: tuple[int, ...]

    def run(self, bound: float) -> Disjoint:
        # In the best choice none is worth less than nothing: without it the others are as good.
        some = np.flatnonzero(self._lists.worth > 0.0)
        self._push(bound, some, self._price)
        while self._open:
            minus, _, left, price = heapq.heappop(self._open)
            self._held -= len(left)
            if -minus <= self._enough():
                break
            if (
                self._held > _MOST_HELD
                or self._should_stop()
                or not self._branch(-minus, left, price)
            ):
                return Disjoint(max(-minus, self._enough()), self._met, self._chosen)
        return Disjoint(self._enough(), self._met, self._chosen)

    def _enough(self) -> float:
        return self._best + _TOLERANCE * abs(self._best)

    def _push(self, bound: float, left: IntArray, price: FloatArray) -> None:
        self._made += 1
        self._held += len(left)
        heapq.heappush(self._open, (-bound, self._made, left, price))

    def _branch(self, bound: float, left: IntArray, price: FloatArray) -> bool:
        """Bound a branch and split it; False where it was told to stop."""
        bound, left, price, share = self._bounded(bound, left, price)
        if self._should_stop():
            return False
        if bound <= self._enough():
            return True
        rows = np.repeat(np.arange(len(left)), self._sizes[left])
        tasks = self._flat[_ranges(self._starts[left], self._sizes[left])]
        uavs = self._lists.uav[left]
        pair = uavs[rows] * self._n_task + tasks
        pairs, place = np.unique(pair, return_inverse=True)
        count = np.bincount(place)
        of_uav = np.bincount(uavs, minlength=self._n_uav)[pairs // self._n_task]
        of_task = np.bincount(tasks, minlength=self._n_task)[pairs % self._n_task]
        open_ = np.flatnonzero((count < of_uav) | (count < of_task))
        if len(open_) == 0:
            self._take(left)
            return True
        done = np.bincount(place, weights=share[rows])
        chosen = open_[np.argmin(np.abs(done[open_] - 0.5))]
        uav, task = divmod(int(pairs[chosen]), self._n_task)
        has = np.zeros(len(left), dtype=np.bool_)
        has[rows[tasks == task]] = True
        own = uavs == uav
        self._push(bound, left[own == has], price)
        self._push(bound, left[~(own & has)], price)
        return True

    def _bounded(
        self, bound: float, left: IntArray, price: FloatArray
    ) -> tuple[float, IntArray, FloatArray, FloatArray]:
        """A bound for the branch, the lists that can still be part of something better, shares."""
        bundle = ListBundle(self._n_uav, price)
        some = left.tolist()
        lists = self._lists
        bundle.add(lists.uav[left], lists.worth[left], [lists.lists[k] for k in some])
        step = self._step
        tolerance = _TOLERANCE * abs(self._best) / max(1, self._n_uav)
        for _ in range(_STEPS):
            tried = bundle.solve(step, tolerance, sweeps=_SWEEPS, should_stop=self._should_stop)
            value = bundle.value
            less = bound - value
            if value < bound:
                bound, price = value, tried
                bundle.move_centre(tried)
            if bound <= self._enough() or less < _LEAST_PROGRESS * (bound - self._best):
                break
            step *= 2.0
        share = bundle.shares()
        earned = self._earned(left, price)
        self._try(left, np.lexsort((-earned, -share)))
        most = np.zeros(self._n_uav)
        np.maximum.at(most, lists.uav[left], earned)
        at_prices = float(price.sum() + most.sum())
        keep = at_prices - (most[lists.uav[left]] - earned) > self._enough()
        return min(bound, at_prices), left[keep], price, share[keep]

    def _earned(self, left: IntArray, price: FloatArray) -> FloatArray:
        rows = np.repeat(np.arange(len(left)), self._sizes[left])
        tasks = self._flat[_ranges(self._starts[left], self._sizes[left])]
        paid = np.bincount(rows, weights=price[tasks], minlength=len(left))
        earned: FloatArray = self._lists.worth[left] - paid
        return earned

    def _try(self, left: IntArray, order: IntArray) -> None:
        """Take lists in that order, as long as they are disjoint."""
        taken = np.zeros(self._n_task, dtype=np.bool_)
        busy = np.zeros(self._n_uav, dtype=np.bool_)
        chosen = []
        for k in order.tolist():
            tasks = self._lists.lists[left[k]]
            uav = self._lists.uav[left[k]]
            if not busy[uav] and not taken[tasks].any():
                taken[tasks] = busy[uav] = True
                chosen.append(k)
        self._take(left[sorted(chosen)])

    def _take(self, disjoint: IntArray) -> None:
        worth = float(self._lists.worth[disjoint].sum())
        self._best = max(self._best, worth)
        if worth > self._met:
            self._met, self._chosen = worth, tuple(disjoint.tolist())


def _ranges(starts: IntArray, sizes: IntArray) -> npt.NDArray[np.int64]:
    """Of each start so many numbers from it on, one after another."""
    total = int(sizes.sum())
    before = np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.arange(total) - before + np.repeat(starts, sizes)
