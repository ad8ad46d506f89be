"""Nearest first: every UAV takes the open task it reaches soonest.

What people script first. Leaves out: values, probabilities and the horizon.
"""

from __future__ import annotations

from collections.abc import Sequence

from sim.study.baselines.index_rule import IndexRule, Routes, routes_by
from swarm.allocation.problem import FloatArray, Problem

__all__ = ["NEAREST", "nearest_first"]


def _nearness(problem: Problem, uav: int, travel_s: FloatArray) -> FloatArray:
    del problem, uav
    return -travel_s


NEAREST = IndexRule("nearest", _nearness)
"""The rule; its index is the negative travel time [s]."""


def nearest_first(problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """Lists by the rule `NEAREST`; see `routes_by`."""
    return routes_by(NEAREST, problem, sequence)
