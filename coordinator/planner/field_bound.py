"""What no plan of the field's problem surpasses: fewest tasks left out, and J.

Left aside are energy beyond single tasks, slots, ways back to bases, and that a task without due
time has to be done: all that only takes plans away, or lets tasks end earlier.

**Left out.** A task that nobody can do from any start or base, however it got there, is left out of
every plan.

**Trivial.** No task ends before its best UAV has come straight from its start, has flown its line
and done its service, nor before it opens; so J <= Σ_i max_j p·m·(until − that), with no term below
0, where until is due_s or else D.

**Lagrangian.** As `coordinator.planner.bound` has it for the paper's problem, with a timetable of
the field's legs, openings and ends. There all terms fall towards one horizon, here the latest until
of all; what p·m·(that − until) makes a task worth too much is paid with its price.

Legs are those of the tables, or shorter ways over other nodes where there are such: heights and
wind let a way over a third place be quicker than the straight one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from coordinator.planner.bound import LowestBound, lagrangian_bound
from coordinator.planner.options import ShouldStop, never
from swarm.allocation.field.problem import BoolArray, FieldProblem, FloatArray
from swarm.kernels._kernels import KernelProblem
from swarm.kernels.routes import TeamArrays
from swarm.kernels.routes_bound import Timetable, relaxed_lists
from swarm.kernels.routes_pricing import ListBundle, PricedLists

_ROUNDING = 1e-9
_TOLERANCE_S = 2e-6
"""Of all limits, and as much for roundings."""
_MOST_NODES = 600
"""With more, shorter ways over third nodes are not looked for but bounded: some 0.3 s."""
_MOST_LEGS = 20_000_000
"""Legs between tasks, of all UAVs, that a timetable may have: 160 MB."""
_OPERATIONS = 1.2e10
"""Of the dynamic programme in all: some 3 s on two cores."""
_FEWEST_BUCKETS, _MOST_BUCKETS = 200, 2000
_FEWEST_ROUNDS, _MOST_ROUNDS = 4, 200


@dataclass(frozen=True, slots=True)
class FieldBound:
    """No plan is better."""

    fewest_left_out: int
    """Required tasks that any plan leaves out at least."""
    objective: float
    """No plan has a larger J, whatever it leaves out [value·s]."""


def field_bound(
    problem: FieldProblem,
    should_stop: ShouldStop = never,
    *,
    known: float = 0.0,
    price: FloatArray | None = None,
    threads: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> FieldBound:
    """The better of the trivial and the Lagrangian bound.

    Args:
        problem: the mission, from its start.
        should_stop: asked after each round of prices with the rounds made, and about 0 every
            few milliseconds.
        known: J of lists that are known [value·s].
        price: (n_task,) what each task adds to them, roughly [value·s]; nothing when None.
        threads: at most this many; does not change the result.
        progress: told each lower bound on J when it is found [value·s].
    """
    reach = _Reach(problem)
    possible = reach.possible.any(axis=0)
    left_out = int(np.count_nonzero(problem.required & ~possible))
    left_s = np.where(reach.possible, problem.until_s - reach.earliest_s, 0.0)
    best = (problem.weight * left_s).max(axis=0, initial=0.0)
    trivial = float(best.sum()) * (1.0 + _ROUNDING)
    lowest = LowestBound(trivial, _ROUNDING, progress)
    if _affordable(problem)[1] >= _FEWEST_ROUNDS and trivial > 0.0 and not should_stop(0.0):
        _lower_by_prices(lowest, problem, reach, should_stop, known, price, threads)
    return FieldBound(left_out, lowest.objective)


def _affordable(problem: FieldProblem) -> tuple[int, int]:
    """Buckets up to the latest until and rounds that `_OPERATIONS` allow; 0 where too few."""
    legs = problem.n_uav * problem.n_task**2
    if legs > _MOST_LEGS or problem.n_task < 2:
        return _FEWEST_BUCKETS, 0
    passes = _OPERATIONS / legs
    finest = 2.0 * (passes / _MOST_ROUNDS - 10.0)
    buckets = int(min(_MOST_BUCKETS, max(_FEWEST_BUCKETS, finest)))
    rounds = passes / (buckets / 2.0 + 10.0)
    return buckets, int(min(_MOST_ROUNDS, rounds))


class _Reach:
    """When which task can be over at the earliest, and what is between two of them."""

    def __init__(self, problem: FieldProblem) -> None:
        self._problem = problem
        self._closed_s = _closed_legs_s(problem)
        n_uav, n_task = problem.n_uav, problem.n_task
        self.earliest_s: FloatArray = np.full((n_uav, n_task), np.inf)
        """(n_uav, n_task) no earlier end is possible [s]; infinite: impossible."""
        self.possible: BoolArray = np.zeros((n_uav, n_task), dtype=np.bool_)
        for uav in range(n_uav):
            self.earliest_s[uav], self.possible[uav] = self._of(uav)

    def _of(self, uav: int) -> tuple[FloatArray, BoolArray]:
        problem, kind = self._problem, self._problem.kind[uav]
        work_s = problem.line_s[kind] + problem.service_s[:, None]
        enter, leave = problem.enter, problem.enter[:, ::-1]
        home_s = problem.home_s[uav][leave]
        # The sortie in which it is done begins at mission time 0 or with a swap.
        origins = [(uav, 0.0, float(problem.first_s[uav]))]
        if np.isfinite(problem.full_s[uav]):
            nodes = range(problem.n_uav, problem.n_uav + problem.n_base)
            ready_s = self._closed_s[kind, uav, problem.n_uav :][: problem.n_base] + problem.swap_s
            full_s = float(problem.full_s[uav])
            origins += [(node, ready, full_s) for node, ready in zip(nodes, ready_s, strict=True)]
        earliest_s = np.full(problem.n_task, np.inf)
        for node, ready, budget_s in origins:
            leg_s = self._closed_s[kind, node][enter]
            begin_s = np.maximum(ready + leg_s, problem.opens_s[:, None])
            end_s = begin_s + work_s
            # Only at a base it may wait for the opening on the ground.
            airborne_s = (end_s if node == uav else leg_s + work_s) + home_s
            fits = (
                (airborne_s <= budget_s + _TOLERANCE_S)
                & (begin_s <= problem.closes_s[:, None] + _TOLERANCE_S)
                & (end_s <= problem.due_s[:, None] + _TOLERANCE_S)
            )
            np.minimum(earliest_s, np.where(fits, end_s, np.inf).min(axis=1), out=earliest_s)
        possible = problem.capable[uav] & np.isfinite(earliest_s)
        return np.where(possible, earliest_s, np.inf), possible

    def timetable(self, never_s: float) -> Timetable:
        """When who can be done with what; what is impossible takes until ``never_s``."""
        problem = self._problem
        enter, leave = problem.enter, problem.enter[:, ::-1]
        legs_s = np.empty((problem.n_uav, problem.n_task, problem.n_task))
        for kind in range(len(problem.leg_s)):
            work_s = problem.line_s[kind] + problem.service_s[:, None]
            least_s = np.full((problem.n_task, problem.n_task), never_s)
            for one in range(2):
                for other in range(2):
                    between_s = self._closed_s[kind][np.ix_(leave[:, one], enter[:, other])]
                    np.minimum(least_s, between_s + work_s[:, other], out=least_s)
            legs_s[problem.kind == kind] = least_s
        latest_s = np.full_like(self.earliest_s, np.inf)
        for uav in range(problem.n_uav):
            work_s = (problem.line_s[problem.kind[uav]] + problem.service_s[:, None]).max(axis=1)
            last_s = np.minimum(problem.due_s, problem.closes_s + work_s)
            latest_s[uav] = np.where(self.possible[uav], last_s + _TOLERANCE_S, 0.0)
        first_s = np.minimum(self.earliest_s, never_s)
        opens_s = np.minimum(self.earliest_s, never_s)
        return Timetable(first_s, legs_s, opens_s, latest_s)


def _closed_legs_s(problem: FieldProblem) -> FloatArray:
    """(n_kind, n_node, n_node) no way between two nodes is quicker, over whatever others [s]."""
    legs_s = problem.leg_s.copy()
    rows = np.arange(problem.n_node)
    for kind, table_s in enumerate(legs_s):
        for way in range(2):
            ends = problem.enter[:, way], problem.enter[:, 1 - way]
            np.minimum.at(table_s, ends, problem.line_s[kind][:, way])
        table_s[rows, rows] = 0.0
        if problem.n_node <= _MOST_NODES:
            for node in range(problem.n_node):  # Floyd and Warshall
                np.minimum(table_s, table_s[:, node, None] + table_s[node], out=table_s)
        else:
            # Whatever comes before, the last leg is one of these.
            others_s = np.where(rows[:, None] == rows, np.inf, table_s)
            np.minimum(table_s, others_s.min(axis=0), out=table_s)
    return legs_s


def _lower_by_prices(
    lowest: LowestBound,
    problem: FieldProblem,
    reach: _Reach,
    should_stop: ShouldStop,
    known: float,
    price: FloatArray | None,
    threads: int | None,
) -> None:
    """Note the bounds that prices yield."""
    until_s = float(problem.until_s.max())
    weight = np.where(reach.possible, problem.weight, 0.0)
    n_uav, n_task = weight.shape
    value = weight.max(axis=0)
    success = np.divide(weight, value, out=np.zeros_like(weight), where=value > 0.0)
    kernel = KernelProblem(
        start_enu_m=np.zeros((n_uav, 3)),
        task_enu_m=np.zeros((n_task, 3)),
        speed_m_s=np.ones(n_uav),
        value=value,
        service_s=np.zeros(n_task),
        success=np.minimum(1.0, success),
        survival=np.ascontiguousarray(problem.survival),
        horizon_s=until_s,
    )
    team = TeamArrays(
        problem=kernel,
        free_s=np.zeros(n_uav),
        place_enu_m=np.zeros((n_uav, 3)),
        survived=np.ones(n_uav),
        active=np.ones(n_uav, dtype=np.bool_),
        open=reach.possible.any(axis=0),
    )
    least = np.where(reach.possible, problem.weight, np.inf).min(axis=0)
    beyond = np.where(np.isfinite(least), least, 0.0) * (until_s - problem.until_s)
    buckets, rounds = _affordable(problem)
    timetable = reach.timetable(2.0 * until_s + 1.0)

    def pricing(prices: FloatArray) -> PricedLists | None:
        found = relaxed_lists(
            team,
            prices + beyond,
            until_s / buckets,
            timetable=timetable,
            threads=threads,
            should_stop=lambda: should_stop(0.0),
        )
        if found is None:
            return None
        # What is paid because it is beyond is no price that could be changed.
        net = [
            worth - sum(beyond[one]) for worth, one in zip(found.worth, found.lists, strict=True)
        ]
        return replace(found, worth=np.array(net))

    begin = np.zeros(n_task) if price is None else price
    lagrangian_bound(
        pricing,
        begin,
        ListBundle(n_uav, begin),
        enough=max(0.0, known),
        rounds=rounds,
        should_stop=should_stop,
        progress=lowest.note,
    )
