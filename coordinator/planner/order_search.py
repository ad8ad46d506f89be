"""A priority sequence for any rule: by the kernels, else the best of some orders.

An order for a rule that is not compiled is flown decision by decision, so only few are tried.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from math import factorial

import numpy as np

from coordinator.planner.options import ShouldStop, never
from coordinator.planner.sequence_search import (
    Progress,
    SearchLimits,
    SequenceSearch,
    best_sequence,
)
from swarm.allocation import Rule, TeamState, evaluate, rank_of, run
from swarm.allocation.lower_level import CompiledRule
from swarm.allocation.problem import Problem

__all__ = ["search_sequence"]

_MOST_ORDERS = 120
"""All orders of five UAVs; of more UAVs so many are drawn."""


def search_sequence(
    problem: Problem,
    rule: Rule,
    rng: np.random.Generator,
    should_stop: ShouldStop = never,
    state: TeamState | None = None,
    limits: SearchLimits | None = None,
    *,
    progress: Progress | None = None,
    threads: int | None = None,
) -> SequenceSearch:
    """The best sequence found for UAVs that decide by ``rule``; see `best_sequence`.

    For a rule that is not compiled the orders tried are all of up to five active UAVs, and else the
    problem's own and some drawn ones; the first is flown to its end, whatever ``should_stop`` says.
    """
    if isinstance(rule, CompiledRule):
        return best_sequence(
            problem, rule, rng, should_stop, state, limits, progress=progress, threads=threads
        )
    state = TeamState.at_start(problem) if state is None else state
    active = tuple(int(uav) for uav in np.flatnonzero(state.active))
    out = tuple(int(uav) for uav in np.flatnonzero(~state.active))
    flown: list[tuple[float, tuple[int, ...], list[list[int]]]] = []
    for order in _orders(active, rng):
        if flown and should_stop(float(len(flown) + 1)):
            break
        routes, _ = run(problem, state, rank_of(order + out), rule)
        flown.append((evaluate(problem, routes, state)[0], order + out, routes))
        if progress is not None:
            progress(len(flown), max(objective for objective, _, _ in flown))
    objective, sequence, routes = max(flown, key=lambda each: each[0])
    return SequenceSearch(
        sequence=sequence,
        routes=tuple(tuple(route) for route in routes),
        objective=objective,
        evaluations=len(flown),
        exhaustive=factorial(len(active)) <= len(flown),
    )


def _orders(uavs: tuple[int, ...], rng: np.random.Generator) -> Iterator[tuple[int, ...]]:
    if factorial(len(uavs)) <= _MOST_ORDERS:
        yield from permutations(uavs)
        return
    yield uavs
    for _ in range(_MOST_ORDERS - 1):
        yield tuple(int(uav) for uav in rng.permutation(uavs))
