"""Value per time: the open task with the largest p·m / (travel + service).

Smith's rule (1956, doi:10.1002/nav.3800030106) with the flight counted as work; one pass of the
lower level. Leaves out: survival, the horizon, and what lies beyond the next task.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.study.baselines.index_rule import IndexRule, Routes, routes_by
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import FloatArray, Problem

__all__ = ["VALUE_PER_TIME", "makespan_s", "value_per_time"]

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
