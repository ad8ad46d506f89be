"""An upper bound on J for missions too large to be solved exactly.

**Trivial.** By the triangle inequality no task is complete before its best UAV has flown straight
to it; so J <= Σ_i max_j p·m·(D − t_direct). Where survival is below 1 a negative term may be
scaled down to nothing by S, so it counts 0.

**Lagrangian.** Let a list's worth be Σ p·m·(D − t)⁺ over its tasks. Dropping S <= 1 and the
negative terms only adds to J; what comes after D on a list changes nothing before it; and a task
nobody can do earns nothing. So J is at most the largest sum of worths over disjoint lists, of
which no task need be on any. Relax "each task at most once" with prices π >= 0:

    J <= Σ_i π_i + Σ_j max over lists of (worth_j − Σ π along the list)    for every π >= 0.

`swarm.kernels.routes_pricing.price_lists` bounds each maximum from above, exact in time. The prices
begin as what each task adds to known lists; which ones to try next a proximal bundle method says
from all lists found so far (`lagrangian_bound`). Any prices yield a bound, and the least one seen
is kept. Where that is close enough to the best lists known, all lists that could be part of better
ones are named and the best of them chosen (`coordinator.planner.closing`): then the bound is the
optimum.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from coordinator.planner.closing import best_disjoint
from coordinator.planner.options import ShouldStop, beginning_of, never
from swarm.allocation.problem import FloatArray, Problem
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes import TeamArrays
from swarm.kernels.routes_pricing import (
    ListBundle,
    PricedLists,
    WorthyLists,
    price_lists,
    worthy_lists,
)

Pricing = Callable[[FloatArray], PricedLists | None]
"""The best lists at given prices, bounded from above; None where it was told to stop."""
_MOST_ROUNDS = 200
_FIRST_STEP, _LONGEST_STEP = 0.1, 100.0
"""As shares of the bound per task: by how much the price of a task on two lists rises first, and
how long a step must be before no prices are taken to be better."""
_LONGER, _SHORTER = 2.0, 0.7
_ACCEPTED, _GOOD = 0.1, 0.5
"""Shares of the expected gain from which on prices become the centre, and steps longer."""
_SWEEPS, _ROUGH_SWEEPS = 300, 50
_SETTLED = 1e-7
"""Of the bound: no prices lower it by more."""
_GROUPS = 10
_PASSES = 8
_ROUGH_NEAR, _ROUGH_HEADS = 16, 300
_FIRST_ROUGH_STEP, _LAST_ROUGH_STEP = 0.03, 0.012
"""As shares of the bound per task."""
_ROUGH_FRAC = 0.4
"""The most of a limit that goes by before the first bound is worked out."""
_HEADS_TIMES_TASKS, _FEWEST_HEADS, _MOST_HEADS = 2_000_000, 200, 100_000
"""Beginnings of a list that are continued at most, some 20 ms, in the first round of prices; twice
as many in each round after it, as what is cut off matters the more the better prices are."""
_ROUNDING = 2e-10
_MET = 1e-9
_CLOSING_HEADS = 100_000
"""Beginnings of lists looked at, per UAV, when those that might be part of an optimum are named."""
_FIRST_SLACK_FRAC, _WIDER = 2e-4, 2.0
_MOST_WORTHY = 50_000
"""Lists that are chosen from."""


@dataclass(frozen=True, slots=True)
class UpperBound:
    """No lists whatever have a larger J."""

    objective: float
    """[value·s]."""
    rounds: int
    """Of prices tried."""
    lists: tuple[tuple[int, ...], ...] | None = None
    """Better ones than were known, where they were met while the optimum was proven."""


@dataclass(slots=True)
class LowestBound:
    """The least bound found so far."""

    objective: float
    """[value·s]."""
    rounding_frac: float
    """Of a bound, by how much sums in another order may come out lower."""
    tell: Callable[[float], None] | None = None
    """Told each lower bound when it is found [value·s]."""

    def note(self, bound: float) -> None:
        """Keep what was found [value·s] if it is lower, and tell of it."""
        bound += self.rounding_frac * abs(bound)
        if bound < self.objective:
            self.objective = bound
            if self.tell is not None:
                self.tell(bound)


def meets(bound: float, objective: float) -> bool:
    """Whether no lists are better, but for rounding."""
    return bound <= objective + _MET * abs(objective)


@dataclass(frozen=True, slots=True, eq=False)
class Relaxed:
    """The least bound that prices were found to yield."""

    bound: float
    """[value·s]; infinite where none was found."""
    price: FloatArray
    """(n_task,) these prices [value·s]."""
    earned: FloatArray
    """(n_uav,) no list earns more at these prices [value·s]."""
    rounds: int
    settled: bool
    """Other prices yield no bound that is much lower."""


def trivial_bound(problem: Problem) -> float:
    """Every task reached straight from its best UAV's start [value·s]."""
    possible = np.flatnonzero(problem.capable.any(axis=0))
    if len(possible) == 0:
        return 0.0
    terms = np.full((problem.n_uav, problem.n_task), -np.inf)
    for uav in range(problem.n_uav):
        travel_s = problem.travel_s(uav, problem.start_enu_m[uav])
        terms[uav] = problem.weight[uav] * (problem.horizon_s - (travel_s + problem.service_s))
    terms[~problem.capable] = -np.inf
    best = terms[:, possible].max(axis=0)
    if (problem.survival[problem.capable] < 1.0).any():
        best = np.maximum(best, 0.0)
    return float(best.sum()) + _ROUNDING * float(np.abs(best).sum())


def upper_bound(
    problem: Problem,
    lists: Sequence[Sequence[int]],
    should_stop: ShouldStop = never,
    *,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> UpperBound:
    """The least bound that is found before it is told to stop; the trivial one at least.

    Args:
        problem: the mission, from its start.
        lists: good ones; the better they are the sooner the prices are right.
        should_stop: asked after each round of prices with the rounds made, and about 0 every few
            milliseconds.
        threads: at most this many; does not change the result.
        progress: told each lower bound when it is found [value·s].
    """
    trivial = trivial_bound(problem)
    if problem.n_task == 0 or problem.n_uav == 0 or should_stop(0.0):
        return UpperBound(trivial, 0)
    team = team_at_start(problem)

    def stops() -> bool:
        return should_stop(0.0)

    lowest = LowestBound(trivial, _ROUNDING, progress)
    known = _Known.of(problem, lists)
    price, bundle = known.price, known.bundle(problem.n_uav)
    price = _approached(team, price, bundle, beginning_of(should_stop, _ROUGH_FRAC), threads)
    heads = max(_FEWEST_HEADS, _HEADS_TIMES_TASKS // problem.n_task) // 2

    def priced(price: FloatArray) -> PricedLists | None:
        nonlocal heads
        heads = max(heads, min(2 * heads, _MOST_HEADS))
        return price_lists(team, price, heads=heads, threads=threads, should_stop=stops)

    relaxed = lagrangian_bound(
        priced,
        price,
        bundle,
        enough=known.worth,
        first_step=_LAST_ROUGH_STEP,
        should_stop=should_stop,
        progress=lowest.note,
    )
    better: tuple[tuple[int, ...], ...] | None = None
    if relaxed.settled and team.problem.certain and relaxed.bound > known.worth:
        worthy = partial(
            worthy_lists,
            team,
            relaxed.price,
            relaxed.earned,
            heads=_CLOSING_HEADS,
            threads=threads,
            should_stop=stops,
        )
        closed, better = closed_bound(worthy, relaxed, known.worth, stops)
        lowest.note(closed)
    return UpperBound(lowest.objective, relaxed.rounds, better)


def lagrangian_bound(
    pricing: Pricing,
    price: FloatArray,
    bundle: ListBundle,
    *,
    enough: float = 0.0,
    rounds: int = _MOST_ROUNDS,
    first_step: float = _FIRST_STEP,
    should_stop: ShouldStop = never,
    progress: Callable[[float], None] | None = None,
) -> Relaxed:
    """The least Σ π + Σ of what lists earn that is seen while a bundle method moves the prices.

    Args:
        pricing: bounds the best list of each UAV from above at given prices.
        price: (n_task,) to begin with [value·s]; >= 0.
        bundle: knows lists already, and learns those that are found.
        enough: no lower bound is looked for [value·s].
        rounds: prices that are tried, at most.
        first_step: by how much the price of a task on two lists rises first, as a share of the
            bound per task.
        should_stop: asked after each round with the rounds made.
        progress: told the bound of each round [value·s].
    """
    n_uav = bundle.n_uav
    best = Relaxed(np.inf, price, np.zeros(n_uav), 0, settled=False)
    centre = expected = np.inf
    step = longest = 0.0
    made, settled = 0, False

    def stops() -> bool:
        return should_stop(0.0)

    while (found := pricing(price)) is not None:
        bound = float(price.sum() + found.bound.sum())
        if bound < best.bound:
            best = Relaxed(bound, price, found.bound, made, settled=False)
        if progress is not None:
            progress(bound)
        made += 1
        _learn(bundle, found)
        if made == 1:
            step = first_step * max(bound, _ROUNDING) / max(1, len(price))
            longest = _LONGEST_STEP * max(bound, _ROUNDING) / max(1, len(price))
        gain = centre - expected
        if made == 1 or centre - bound >= _ACCEPTED * gain:
            if made > 1 and centre - bound >= _GOOD * gain:
                step *= _LONGER
            bundle.move_centre(price)
            centre = bound
        elif bound >= centre:
            step *= _SHORTER
        if made == rounds or best.bound <= enough or should_stop(made):
            break
        while True:
            tolerance = _SETTLED * abs(centre) / (10.0 * n_uav)
            price = bundle.solve(step, tolerance, sweeps=_SWEEPS, should_stop=stops)
            expected = bundle.value
            settled = centre - expected <= _SETTLED * abs(centre)
            if not settled or step >= longest or stops():
                break
            step *= 10.0  # nothing to gain near by is no reason to stay
        if settled:
            break
    return Relaxed(best.bound, best.price, best.earned, made, settled)


def _approached(
    team: TeamArrays,
    price: FloatArray,
    bundle: ListBundle,
    should_stop: ShouldStop,
    threads: int | None,
) -> FloatArray:
    """Prices near the best ones, found quickly; no bound comes of them yet.

    Lists of short legs are priced, a group of UAVs at a time, and prices follow after each group
    (incremental subgradients do the same: Nedić and Bertsekas 2001, doi:10.1137/S1052623499362111).
    """
    n_uav = team.problem.n_uav
    per_task = max(float(bundle.value), _ROUNDING) / max(1, len(price))
    tolerance = _SETTLED * per_task * len(price) / n_uav
    count = min(_GROUPS, n_uav)
    groups = [
        replace(team, active=np.asarray(team.active) & (np.arange(n_uav) % count == group))
        for group in range(count)
    ]
    shrinks = (_LAST_ROUGH_STEP / _FIRST_ROUGH_STEP) ** (1.0 / (_PASSES - 1))
    for made in range(_PASSES):
        step = _FIRST_ROUGH_STEP * shrinks**made * per_task
        for group in groups:
            found = price_lists(
                group,
                price,
                heads=_ROUGH_HEADS,
                near=_ROUGH_NEAR,
                threads=threads,
                should_stop=lambda: should_stop(0.0),
            )
            if found is None:
                return price
            _learn(bundle, found)
            price = bundle.solve(
                step, tolerance, sweeps=_ROUGH_SWEEPS, should_stop=lambda: should_stop(0.0)
            )
            bundle.move_centre(price)
    return price


def _learn(bundle: ListBundle, found: PricedLists) -> None:
    """Make the lists known."""
    some = [uav for uav, one in enumerate(found.lists) if one]
    bundle.add(some, found.worth[some], [found.lists[uav] for uav in some])


def closed_bound(
    worthy: Callable[[float], WorthyLists | None],
    relaxed: Relaxed,
    known: float,
    stops: Callable[[], bool],
) -> tuple[float, tuple[tuple[int, ...], ...] | None]:
    """A bound over disjoint lists, and the best lists met where they are better than known ones.

    Step by step farther below the bound of the prices: what is worth more than bound - slack is
    made of lists that lose no more than the slack. Where these are too many it ends.

    Args:
        worthy: all lists that lose no more than so much [value·s]; None where it gave up.
        relaxed: the bound of the prices.
        known: J of lists that are known [value·s].
        stops: asked every few milliseconds whether to give up.
    """
    n_uav = len(relaxed.earned)
    better: tuple[tuple[int, ...], ...] | None = None
    lowest, slack = relaxed.bound, _FIRST_SLACK_FRAC * abs(relaxed.bound)
    while True:
        slack = min(slack, relaxed.bound - known)
        lists = worthy(slack)
        if lists is None or len(lists.lists) > _MOST_WORTHY:
            break
        found = best_disjoint(
            lists,
            relaxed.price,
            n_uav,
            known=max(known, relaxed.bound - slack),
            bound=lowest,
            should_stop=stops,
        )
        lowest = min(lowest, found.bound)
        if found.worth > known:
            known = found.worth
            chosen = {int(lists.uav[k]): tuple(lists.lists[k]) for k in found.chosen}
            better = tuple(chosen.get(uav, ()) for uav in range(n_uav))
        if known >= relaxed.bound - slack or stops():
            break
        slack *= _WIDER
    return lowest, better


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What the lists at hand tell of prices."""

    uav: list[int]
    worths: list[float]
    lists: list[Sequence[int]]
    price: FloatArray
    """(n_task,) what their worth loses if a task is taken off, at least 0."""
    worth: float
    """Of all of them."""

    @classmethod
    def of(cls, problem: Problem, lists: Sequence[Sequence[int]]) -> _Known:
        """The lists, and each without one of its tasks."""
        known = cls([], [], [], np.zeros(problem.n_task), 0.0)
        total = 0.0
        for uav, route in enumerate(lists):
            if not route:
                continue
            whole = _list_worth(problem, uav, route)
            total += whole
            known._note(uav, whole, route)
            for place, task in enumerate(route):
                without = [*route[:place], *route[place + 1 :]]
                rest = _list_worth(problem, uav, without)
                known.price[task] = max(0.0, whole - rest)
                if without:
                    known._note(uav, rest, without)
        return cls(known.uav, known.worths, known.lists, known.price, total)

    def _note(self, uav: int, worth: float, route: Sequence[int]) -> None:
        self.uav.append(uav)
        self.worths.append(worth)
        self.lists.append(route)

    def bundle(self, n_uav: int) -> ListBundle:
        bundle = ListBundle(n_uav, self.price)
        bundle.add(self.uav, self.worths, self.lists)
        return bundle


def _list_worth(problem: Problem, uav: int, route: Sequence[int]) -> float:
    """Σ p·m·(D − t)⁺, S left out."""
    tasks = np.array(route, dtype=np.int64)
    travel_s = problem.travel_along_s(uav, problem.start_enu_m[uav], tasks)
    times_s = np.cumsum(travel_s + problem.service_s[tasks])
    left_s = np.maximum(0.0, problem.horizon_s - times_s)
    return float(problem.weight[uav, tasks] @ left_s)
