"""An upper bound on J for missions too large to be solved exactly.

**Trivial.** By the triangle inequality no task is complete before its best UAV has flown straight
to it; so J <= Σ_i max_j p·m·(D − t_direct). Where survival is below 1 a negative term may be
scaled down to nothing by S, so it counts 0.

**Lagrangian.** Let a list's worth be Σ p·m·(D − t)⁺ over its tasks. Dropping S <= 1 and the
negative terms only adds to J; what comes after D on a list changes nothing before it; and a task
nobody can do earns nothing. So J is at most the largest sum of worths over disjoint lists, of
which no task need be on any. Relax "each task at most once" with prices π >= 0:

    J <= Σ_i π_i + Σ_j max over lists of (worth_j − Σ π along the list)    for every π >= 0.

Each maximum is bounded from above by a dynamic programme over (task, bucket of time) in which
legs are rounded down to whole buckets (completions only become earlier, terms only larger) and a
task may be visited again (more lists than there are); `swarm.kernels.routes_bound`. The prices
begin as what each task adds to known lists and follow subgradients, a group of UAVs at a time
(incremental subgradients: Nedić and Bertsekas 2001, doi:10.1137/S1052623499362111) with Polyak's
step at first, which then shrinks. Any prices yield a bound, and the least one seen is kept. Who
bounds those maxima otherwise passes that in.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from coordinator.planner.options import Limit, ShouldStop, never
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import FloatArray, IntArray, Problem
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes import TeamArrays
from swarm.kernels.routes_bound import priced_lists, shortest_legs_s

Pricing = Callable[[TeamArrays, FloatArray], tuple[float, IntArray]]
"""Of lists; see `swarm.kernels.routes_bound.priced_lists`."""
_GROUPS = 10
_FIRST_STRIDE = 2.0
_LAST_STRIDE = 0.1
_FEWEST_CYCLES = 4
_MOST_CYCLES = 150
_BETWEEN_BOUNDS = 3
"""Cycles over all groups between two evaluations of the bound."""
_OPERATIONS = 4e10
"""Of the dynamic programme in all: some 8 s on two cores."""
_FINEST, _COARSEST = 400.0, 50.0
"""Buckets up to the horizon."""
_SHORT_FRAC = 0.1
"""Of the tasks, those from which a leg may be below a bucket."""
_MOST_BUCKETS = 1000.0
"""However short legs are; with more, legs of a few buckets take most of the time."""
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class UpperBound:
    """No lists whatever have a larger J."""

    objective: float
    """[value·s]."""
    steps: int
    """Cycles of price changes made."""


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
) -> UpperBound:
    """The better of the trivial and the Lagrangian bound; some seconds at 50 UAVs × 500 tasks.

    Where the dynamic programme would take much longer only the trivial bound is given: thousands
    of tasks, or most legs very short against the horizon.

    Args:
        problem: the mission, from its start.
        lists: good ones; the better they are the sooner the prices are right.
        should_stop: asked between cycles of price changes with the cycles made, and about 0 every
            few milliseconds.
        threads: at most this many; does not change the result.
    """
    trivial = trivial_bound(problem)
    if problem.n_task < 2 or problem.n_uav == 0 or should_stop(0.0):
        return UpperBound(trivial, 0)
    if _affordable_cycles(problem, _COARSEST) < _FEWEST_CYCLES:
        return UpperBound(trivial, 0)
    team = team_at_start(problem)
    bucket_s, cycles = _affordable(problem, team)
    if cycles < _FEWEST_CYCLES:
        return UpperBound(trivial, 0)
    known = max(0.0, evaluate(problem, lists)[0])
    price = _marginal_worth(problem, lists)
    pricing = partial(
        priced_lists, bucket_s=bucket_s, threads=threads, should_stop=lambda: should_stop(0.0)
    )
    lowest, made = lagrangian_bound(
        team, pricing, price, cycles, known=known, should_stop=should_stop
    )
    return UpperBound(min(lowest, trivial), made)


def lagrangian_bound(
    team: TeamArrays,
    pricing: Pricing,
    price: FloatArray,
    cycles: int,
    *,
    known: float = 0.0,
    expected: float | None = None,
    should_stop: ShouldStop = never,
) -> tuple[float, int]:
    """The least Σ π + Σ of priced lists that is seen while prices follow subgradients.

    Args:
        team: mission and state.
        pricing: bounds the best lists of the active UAVs from above, given prices, and tells how
            often some such lists visit each task; NaN where it was told to stop.
        price: (n_task,) to begin with [value·s]; >= 0.
        cycles: over all UAVs, at most.
        known: worth of lists that are known; no bound is below it.
        expected: guess of the optimum, which scales the first step; ``known`` when None.
        should_stop: asked between cycles with the cycles made; along a `Limit` the steps shrink.

    Returns:
        The bound [value·s], infinite if it was stopped before there was any, and the cycles made.
    """
    n_uav = team.problem.n_uav
    n_group = min(_GROUPS, n_uav)
    groups = [
        replace(team, active=np.asarray(team.active) & (np.arange(n_uav) % n_group == group))
        for group in range(n_group)
    ]
    lowest, made, first_stride = np.inf, 0, 0.0
    while True:
        if made % _BETWEEN_BOUNDS == 0 or made == cycles or should_stop(made):
            worth, visits = pricing(team, price)
            if np.isnan(worth):
                break
            bound = float(price.sum()) + worth
            lowest = min(lowest, bound)
            slope = 1.0 - visits
            slope[(price <= 0.0) & (slope > 0.0)] = 0.0
            square = float(slope @ slope)
            if made == 0 and square > 0.0:
                guess = known if expected is None else expected
                first_stride = _FIRST_STRIDE * (bound - guess) / square
            if made == cycles or square == 0.0 or bound <= known or should_stop(made):
                break
        spent = should_stop.spent_frac(made) if isinstance(should_stop, Limit) else 0.0
        shrunk: float = (_LAST_STRIDE / _FIRST_STRIDE) ** min(1.0, max(spent, made / cycles))
        for group in groups:
            _, visits = pricing(group, price)
            price = np.maximum(0.0, price - first_stride * shrunk * (1.0 / n_group - visits))
        made += 1
    return lowest + _ROUNDING * abs(lowest), made


def _affordable(problem: Problem, team: TeamArrays) -> tuple[float, int]:
    """Width of buckets [s] and cycles that `_OPERATIONS` allow; 0 cycles where that is too few.

    Tasks joined by legs below a bucket are worth to each other what all of them are worth, so most
    legs should be longer. That a few are not costs little: what it joins are pairs.
    """
    horizon_s = problem.horizon_s
    short_s = max(float(np.quantile(shortest_legs_s(team), _SHORT_FRAC)), horizon_s / _MOST_BUCKETS)
    bucket_s, cycles = 0.0, 0
    for most in (_FINEST, _COARSEST):
        bucket_s = min(short_s, horizon_s / most)
        cycles = _affordable_cycles(problem, horizon_s / bucket_s)
        if cycles >= _MOST_CYCLES / 2:
            break
    return bucket_s, cycles


def _affordable_cycles(problem: Problem, buckets: float) -> int:
    """Cycles that `_OPERATIONS` allow with so many buckets."""
    each = problem.n_uav * problem.n_task**2 * (buckets / 2.0 + 10.0)
    passes = _OPERATIONS / max(1.0, each)
    return int(min(_MOST_CYCLES, passes * _BETWEEN_BOUNDS / (_BETWEEN_BOUNDS + 1.0) - 1.0))


def _marginal_worth(problem: Problem, lists: Sequence[Sequence[int]]) -> FloatArray:
    """(n_task,) what J loses if a task is taken off the lists, at least 0."""
    price = np.zeros(problem.n_task)
    for uav, route in enumerate(lists):
        whole = _list_worth(problem, uav, route)
        for place, task in enumerate(route):
            without = [*route[:place], *route[place + 1 :]]
            price[task] = max(0.0, whole - _list_worth(problem, uav, without))
    return price


def _list_worth(problem: Problem, uav: int, route: Sequence[int]) -> float:
    """Σ p·m·(D − t)⁺, S left out."""
    tasks = np.array(route, dtype=np.int64)
    travel_s = problem.travel_along_s(uav, problem.start_enu_m[uav], tasks)
    times_s = np.cumsum(travel_s + problem.service_s[tasks])
    left_s = np.maximum(0.0, problem.horizon_s - times_s)
    return float(problem.weight[uav, tasks] @ left_s)
