"""Lists against prices of tasks, and prices that suit lists: the two halves of bounds on J.

A list of UAV j earns Σ S₀·p·m·(D − t) − price over its tasks, with S₀ the survival at its start and
1 from then on. `price_lists` finds the best one per UAV, exact in time, from a set that is a little
larger than the real lists: a task may come again after its list has left the 31 tasks around it
(ng-routes: Baldacci, Mingozzi, Roberti 2011, doi:10.1287/opre.1110.0975). `worthy_lists` names all
real ones that are good enough. `ListBundle` looks for prices at which known lists earn little
(proximal bundles: Kiwiel 1990, doi:10.1007/BF01585731). How these make a bound is told in
`coordinator.planner.bound`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.routes import FloatArray, Routes, TeamArrays, lists_of

IntArray = npt.NDArray[np.int64]
ShouldStop = Callable[[], bool]

_MOST_NEAR = 31
_HEADS = 20_000
"""Beginnings of a list that are continued at most, per UAV: some 50 ms."""


@dataclass(frozen=True, slots=True, eq=False)
class PricedLists:
    """The best list of each UAV, inactive ones included."""

    bound: FloatArray
    """(n_uav,) no list earns more [value·s]; >= 0."""
    worth: FloatArray
    """(n_uav,) Σ S₀·p·m·(D − t) of these lists, before paying [value·s]."""
    lists: Routes
    """Those that earn as much as the bound, or may do so; a task may come more than once."""


@dataclass(frozen=True, slots=True, eq=False)
class WorthyLists:
    """Real lists that earn enough; of those with the same UAV and the same tasks the best."""

    uav: IntArray
    """(n_list,) whose each is, in order."""
    worth: FloatArray
    """(n_list,) before paying [value·s]."""
    lists: Routes


def price_lists(
    team: TeamArrays,
    price: FloatArray,
    *,
    heads: int = _HEADS,
    near: int | None = None,
    threads: int | None = None,
    should_stop: ShouldStop | None = None,
) -> PricedLists | None:
    """The best list of each active UAV for itself, over the open tasks.

    Args:
        team: mission and state.
        price: (n_task,) to pay for each visit [value·s]; >= 0.
        heads: beginnings of lists that are continued at most, per UAV; where there are more the
            most that is left counts into the bound.
        near: legs lead only to so many tasks nearest to each, within 1..31, which is much quicker
            among thousands; then what is found bounds no other lists.
        threads: at most this many; does not change the result.
        should_stop: asked every few milliseconds whether to give up.

    Returns:
        None where it was told to give up.

    Raises:
        ValueError: names the argument that is wrong.
    """
    prices, count = _checked(team, price, heads, threads)
    if near is not None and not 1 <= near <= _MOST_NEAR:
        raise ValueError(f"near must be within 1..{_MOST_NEAR}, not {near}")
    done, bound, worth, lists = _kernels.price_lists(
        team.problem,
        *team.arguments(),
        np.asarray(team.open),
        prices,
        heads,
        near or 0,
        count,
        should_stop,
    )
    return PricedLists(bound, worth, lists_of(*lists)) if done else None


def worthy_lists(
    team: TeamArrays,
    price: FloatArray,
    most: FloatArray,
    slack: float,
    *,
    heads: int = _HEADS,
    threads: int | None = None,
    should_stop: ShouldStop | None = None,
) -> WorthyLists | None:
    """All lists of active UAVs that earn nearly as much as the best, the empty ones apart.

    Args:
        team: mission and state.
        price: (n_task,) to pay for each visit [value·s]; >= 0.
        most: (n_uav,) no list earns more [value·s].
        slack: they earn less than that by no more [value·s]; >= 0.
        heads: beginnings of lists that are looked at, at most, per UAV.
        threads: at most this many; does not change the result.
        should_stop: asked every few milliseconds whether to give up.

    Returns:
        None where there would be too many, or it was told to give up.

    Raises:
        ValueError: names the argument that is wrong.
    """
    prices, count = _checked(team, price, heads, threads)
    bests = checked_most(team, most, slack)
    complete, uav, worth, lists = _kernels.worthy_lists(
        team.problem,
        *team.arguments(),
        np.asarray(team.open),
        prices,
        bests,
        float(slack),
        heads,
        count,
        should_stop,
    )
    return WorthyLists(uav, worth, lists_of(*lists)) if complete else None


class ListBundle:
    """Known lists per UAV, and the prices at which they and the tasks together cost least.

    Σ price + Σ_j max(0, best known list of j after paying) + |price − centre|² / (2·step) is
    minimised over prices >= 0.
    """

    def __init__(self, n_uav: int, price: FloatArray) -> None:
        """Begin with these prices as the centre, and no list but empty ones."""
        self.n_uav, self._n_task = n_uav, len(price)
        self._bundle = _kernels.ListBundle(n_uav, np.array(price, dtype=np.float64, order="C"))

    def add(
        self,
        uav: IntArray | Sequence[int],
        worth: FloatArray | Sequence[float],
        lists: Sequence[Sequence[int]],
    ) -> None:
        """Get to know a list of each of these UAVs; a task may come on it more than once.

        Raises:
            ValueError: names the argument that is wrong.
        """
        flat = np.array([task for one in lists for task in one], dtype=np.int64)
        if not len(uav) == len(worth) == len(lists):
            raise ValueError("uav, worth and lists must be of one length")
        if len(uav) and not 0 <= min(uav) <= max(uav) < self.n_uav:
            raise ValueError(f"uav must be within 0..{self.n_uav - 1}")
        if len(flat) and not 0 <= flat.min() <= flat.max() < self._n_task:
            raise ValueError(f"lists name a task outside 0..{self._n_task - 1}")
        offsets = np.zeros(len(lists) + 1, dtype=np.int64)
        np.cumsum([len(one) for one in lists], out=offsets[1:])
        uavs, worths = np.array(uav, dtype=np.int64), np.array(worth, dtype=np.float64)
        self._bundle.add(uavs, worths, flat, offsets)

    def solve(
        self, step: float, tolerance: float, *, sweeps: int, should_stop: ShouldStop | None = None
    ) -> FloatArray:
        """(n_task,) the prices; approximate ones after so many sweeps, or if told to stop.

        Args:
            step: > 0; the longer, the farther from the centre [(value·s)²].
            tolerance: what a UAV may still gain by exchanging lists [value·s]; >= 0.
            sweeps: over all UAVs, at most.
            should_stop: asked every few milliseconds.
        """
        if not (step > 0.0 and tolerance >= 0.0 and sweeps >= 1):
            raise ValueError("step must be > 0, tolerance >= 0 and sweeps >= 1")
        return self._bundle.solve(step, tolerance, sweeps, should_stop)

    def move_centre(self, price: FloatArray) -> None:
        """Look around these prices from now on."""
        self._bundle.move_centre(np.array(price, dtype=np.float64, order="C"))

    @property
    def value(self) -> float:
        """Σ price + Σ_j max(0, best known list of j), at the last prices [value·s]."""
        return self._bundle.value()

    def shares(self) -> FloatArray:
        """(n_list,) how much of each list the last `solve` would fly, by UAVs and in order."""
        return self._bundle.shares()


def checked_most(team: TeamArrays, most: FloatArray, slack: float) -> FloatArray:
    """(n_uav,) what lists earn at most [value·s], as kernels take it.

    Raises:
        ValueError: names the argument that is wrong, ``slack`` [value·s; >= 0] among them.
    """
    bests = np.array(most, dtype=np.float64, order="C")
    if bests.shape != (team.problem.n_uav,) or not np.isfinite(bests).all():
        raise ValueError(f"most must be {team.problem.n_uav} finite numbers")
    if not slack >= 0.0:
        raise ValueError(f"slack must be >= 0, not {slack}")
    return bests


def _checked(
    team: TeamArrays, price: FloatArray, heads: int, threads: int | None
) -> tuple[FloatArray, int]:
    prices = np.array(price, dtype=np.float64, order="C")
    if prices.shape != (team.problem.n_task,):
        raise ValueError(f"price must have shape {(team.problem.n_task,)}, not {prices.shape}")
    if not (np.isfinite(prices).all() and (prices >= 0.0).all()):
        raise ValueError("price must be finite and >= 0")
    if heads < 1:
        raise ValueError(f"heads must be >= 1, not {heads}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")
    return prices, (os.cpu_count() or 1) if threads is None else threads
