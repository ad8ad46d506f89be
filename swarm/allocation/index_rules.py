"""Decision rules that rank the open tasks by a number, the index, and take the first.

A rule of your own is a function that gives an index for each task, and its entry in
`INDEX_RULES`: from then on plans, simulations, runs and agents know it by its name. It sees neither
the other UAVs nor survival, the horizon, or what lies beyond the next task.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from swarm.allocation.lower_level import Decision, TeamState
from swarm.allocation.problem import FloatArray, IntArray, Problem

Index = Callable[[Problem, int, FloatArray], FloatArray]
"""Of (problem, UAV index, (n_task,) travel times from where it is [s]): (n_task,) the index; not
NaN. A pure function: every agent works it out for itself, and all must come to the same."""


@dataclass(frozen=True, slots=True)
class IndexRule:
    """Take the open task with the largest index; ties go to the smaller task index."""

    name: str
    index: Index

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        ranked = self.valued(problem, state, uav, 2)
        if not ranked:
            return None
        (task, score), *others = ranked
        second_score = others[0][1] if others else None
        return Decision.of(problem, state, uav, task, score, second_score=second_score, exact=True)

    def valued(
        self, problem: Problem, state: TeamState, uav: int, most: int
    ) -> tuple[tuple[int, float], ...]:
        """Tasks with their index, the one it decides on first; so many at the most."""
        tasks = np.flatnonzero(state.open & problem.capable[uav])
        scores = self.index(problem, uav, problem.travel_s(uav, state.place_enu_m[uav]))[tasks]
        best_first = np.argsort(-scores, kind="stable")[:most]
        return tuple((int(tasks[place]), float(scores[place])) for place in best_first)


def _nearness(problem: Problem, uav: int, travel_s: FloatArray) -> FloatArray:
    del problem, uav
    return -travel_s


NEAREST = IndexRule("nearest", _nearness)
"""Its index is the negative travel time [s]."""


_SHORTEST_S = 1e-9
"""A task on the spot without service comes before all others, by its value."""


def _value_per_time(problem: Problem, uav: int, travel_s: FloatArray) -> FloatArray:
    index: FloatArray = problem.weight[uav] / np.maximum(travel_s + problem.service_s, _SHORTEST_S)
    return index


VALUE_PER_TIME = IndexRule("value-per-time", _value_per_time)
"""Smith's rule (1956, doi:10.1002/nav.3800030106) with the flight counted as work; its index is in
value per second."""

INDEX_RULES: Mapping[str, IndexRule] = MappingProxyType(
    {rule.name: rule for rule in (NEAREST, VALUE_PER_TIME)}
)
"""By name."""
