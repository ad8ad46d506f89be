"""Rules that take the open task with the largest index: nearest first, and value per time.

They fit the lower level of Fig. 1 (`swarm.allocation.lower_level`) as they are. Value per time is
Smith's rule (1956, doi:10.1002/nav.3800030106) with the flight counted as work. Leaves out: what
the other UAVs do, survival, the horizon, and what lies beyond the next task.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from swarm.allocation import Decision, TeamState, rank_of, run
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import FloatArray, IntArray, Problem

__all__ = [
    "NEAREST",
    "VALUE_PER_TIME",
    "IndexRule",
    "Routes",
    "makespan_s",
    "nearest_first",
    "routes_by",
    "value_per_time",
]


Routes = list[list[int]]
"""Task indices per UAV in order of execution."""


Index = Callable[[Problem, int, FloatArray], FloatArray]
"""Of (problem, UAV index, (n_task,) travel times from where it is [s]): (n_task,) the index."""


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
        candidates = np.flatnonzero(state.open & problem.capable[uav])
        if not len(candidates):
            return None
        travel_s = problem.travel_s(uav, state.place_enu_m[uav])
        scores = self.index(problem, uav, travel_s)[candidates]
        best = int(np.argmax(scores))
        task = int(candidates[best])
        decided_s = float(state.free_s[uav])
        others = np.delete(scores, best)
        return Decision(
            uav=uav,
            task=task,
            decided_s=decided_s,
            completion_s=float((decided_s + travel_s[task]) + problem.service_s[task]),
            score=float(scores[best]),
            second_score=float(others.max()) if len(others) else None,
            certificate=False,
            exact=True,
        )


def routes_by(rule: IndexRule, problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """The lists to which ``rule`` leads.

    Args:
        rule: how every UAV decides.
        problem: the mission.
        sequence: UAV indices, first decider first; as in the problem when None.
    """
    order = range(problem.n_uav) if sequence is None else sequence
    return run(problem, TeamState.at_start(problem), rank_of(order), rule)[0]


def _nearness(problem: Problem, uav: int, travel_s: FloatArray) -> FloatArray:
    del problem, uav
    return -travel_s


NEAREST = IndexRule("nearest", _nearness)
"""The rule; its index is the negative travel time [s]."""


def nearest_first(problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """Lists by the rule `NEAREST`; see `routes_by`."""
    return routes_by(NEAREST, problem, sequence)


_SHORTEST_S = 1e-9
"""A task on the spot without service comes before all others, by its value."""


def _value_per_time(problem: Problem, uav: int, travel_s: FloatArray) -> FloatArray:
    index: FloatArray = problem.weight[uav] / np.maximum(travel_s + problem.service_s, _SHORTEST_S)
    return index


VALUE_PER_TIME = IndexRule("value-per-time", _value_per_time)
"""The rule; its index is in value per second."""


def value_per_time(problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """Lists by the rule `VALUE_PER_TIME`; see `routes_by`."""
    return routes_by(VALUE_PER_TIME, problem, sequence)


def makespan_s(problem: Problem, routes: Sequence[Sequence[int]]) -> float:
    """When the last task on the lists is completed [s]; 0 with empty lists."""
    _, completion_s = evaluate(problem, routes)
    return float(np.nanmax(completion_s, initial=0.0))
