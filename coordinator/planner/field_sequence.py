"""The upper level in the field: which sequence a rule leads to the best lists with.

Sequences of small fleets are all tried; those of others by a seeded local search. Leaves out: the
rules themselves, and what becomes of UAVs at bases (swarm.kernels.field).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations
from math import factorial

import numpy as np

from coordinator.planner.options import ShouldStop
from coordinator.planner.sequence_search import Progress
from coordinator.planner.sequence_space import neighbours, perturbed
from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState
from swarm.kernels.field import FIELD_LOOKAHEAD, FieldRuleCode, fly_lists, run_rule

_EXHAUSTIVE_UAVS = 6
"""Up to so many UAVs all orders are tried."""
_DECISIONS = 300_000
"""Decisions that a search takes at most, roughly: a second or two."""
_MODEST_DECISIONS = 30_000
_LOOKAHEAD_WORK = 30
"""A decision by lookahead in those by greedy."""
_CLIMBS_IN_VAIN = 20


@dataclass(frozen=True, slots=True)
class FieldSequence:
    """The best sequence found."""

    sequence: tuple[int, ...]
    """UAV indices, first decider first."""
    lists: tuple[tuple[int, ...], ...]
    """Items per UAV: what the sequence leads to."""
    evaluations: int
    """Runs of the rule; 0 if the first one was stopped, after which all go home."""


def search_field_sequence(
    problem: FieldProblem,
    rule: FieldRuleCode,
    rng: np.random.Generator,
    should_stop: ShouldStop,
    *,
    limited: bool = False,
    modest: bool = False,
    progress: Progress | None = None,
) -> FieldSequence:
    """The sequence whose lists leave out fewest required tasks, and then have the largest J.

    Args:
        problem: the mission, from its start.
        rule: how UAVs decide.
        rng: moves of the local search.
        should_stop: asked with the evaluations so far, and about 0 every few milliseconds.
        limited: that alone ends the local search.
        modest: search little.
        progress: told the evaluations and the best J so far after each.
    """
    decisions = _MODEST_DECISIONS if modest else _DECISIONS
    if rule == FIELD_LOOKAHEAD:
        decisions //= _LOOKAHEAD_WORK
    most = decisions // max(10, problem.n_task)
    search = _SequenceClimb(problem, rule, should_stop, progress)
    own = tuple(range(problem.n_uav))
    try:
        if problem.n_uav <= _EXHAUSTIVE_UAVS and factorial(problem.n_uav) <= most:
            for order in permutations(own):
                search.value_of(order)
        else:
            search.climb(own, rng, np.inf if limited else max(1, most))
    except _Enough:
        pass
    return search.best


def worth_of(
    problem: FieldProblem, state: FieldState, lists: Sequence[Sequence[int]]
) -> tuple[float, float]:
    """(Required tasks that ``lists`` leave out, below 0, and J): how plans compare."""
    done = [item >> 1 for items in lists for item in items if item >= 0]
    left_out = int(problem.required.sum() - problem.required[done].sum())
    flown = fly_lists(problem.kernel, state, lists)
    return -float(left_out), float(flown.value.sum())


class _Enough(Exception):  # noqa: N818 - nothing is wrong
    """The search is to end with what it has."""


class _SequenceClimb:
    """What has been flown, and what was best."""

    def __init__(
        self,
        problem: FieldProblem,
        rule: FieldRuleCode,
        should_stop: ShouldStop,
        progress: Progress | None,
    ) -> None:
        n_uav = problem.n_uav
        self.best = FieldSequence(tuple(range(n_uav)), tuple(() for _ in range(n_uav)), 0)
        self._problem = problem
        self._rule = rule
        self._should_stop = should_stop
        self._progress = progress
        self._most = np.inf
        self._known: dict[tuple[int, ...], tuple[float, float]] = {}
        self._best_value = (-np.inf, -np.inf)

    def value_of(self, order: tuple[int, ...]) -> tuple[float, float]:
        """(Required tasks left out, below 0, and J) of the lists that ``order`` leads to.

        Raises:
            _Enough: it is to stop; what was flown of the first one is kept.
        """
        if order in self._known:
            return self._known[order]
        spent = self.best.evaluations
        if spent and (spent >= self._most or self._should_stop(spent)):
            raise _Enough
        state = FieldState.at_start(self._problem, order)
        runs = run_rule(self._problem.kernel, state, self._rule, lambda: self._should_stop(0.0))
        whole = not self._should_stop(0.0)
        if whole or not spent:
            lists = runs.lists(self._problem.n_uav)
            value = worth_of(self._problem, state, lists)
            best = self.best
            if value > self._best_value:
                self._best_value = value
                best = FieldSequence(order, tuple(map(tuple, lists)), spent)
            self.best = replace(best, evaluations=spent + whole)
        if not whole:
            raise _Enough
        self._known[order] = value
        if self._progress is not None:
            self._progress(self.best.evaluations, self._best_value[1])
        return value

    def climb(self, order: tuple[int, ...], rng: np.random.Generator, most: float) -> None:
        """Climb by swaps and insertions, then from disturbed best sequences.

        Raises:
            _Enough: ``most`` evaluations are spent, or it is to stop.
        """
        self._most = most
        in_vain = 0
        while in_vain < _CLIMBS_IN_VAIN:
            before = self.best.evaluations
            better: tuple[int, ...] | None = order
            while better is not None:
                better = self._better_than(better, rng)
            in_vain = 0 if self.best.evaluations > before else in_vain + 1
            order = perturbed(self.best.sequence, rng)

    def _better_than(
        self, order: tuple[int, ...], rng: np.random.Generator
    ) -> tuple[int, ...] | None:
        value = self.value_of(order)
        return next((near for near in neighbours(order, rng) if self.value_of(near) > value), None)
