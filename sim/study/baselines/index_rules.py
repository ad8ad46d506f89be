"""Whole lists by the rules that take the open task with the largest index."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from swarm.allocation import TeamState, rank_of, run
from swarm.allocation.index_rules import NEAREST, VALUE_PER_TIME, IndexRule
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import Problem

Routes = list[list[int]]
"""Task indices per UAV in order of execution."""


def routes_by(rule: IndexRule, problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """The lists to which ``rule`` leads; UAVs decide in ``sequence``, or as in the problem."""
    order = range(problem.n_uav) if sequence is None else sequence
    return run(problem, TeamState.at_start(problem), rank_of(order), rule)[0]


def nearest_first(problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """Lists by the rule `NEAREST`; see `routes_by`."""
    return routes_by(NEAREST, problem, sequence)


def value_per_time(problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """Lists by the rule `VALUE_PER_TIME`; see `routes_by`."""
    return routes_by(VALUE_PER_TIME, problem, sequence)


def makespan_s(problem: Problem, routes: Sequence[Sequence[int]]) -> float:
    """When the last task on the lists is completed [s]; 0 with empty lists."""
    _, completion_s = evaluate(problem, routes)
    return float(np.nanmax(completion_s, initial=0.0))
