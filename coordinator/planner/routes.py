"""Plans of the method `guided`: optimised lists and the sequence published with them.

Leaves out: the search itself (`swarm.kernels.routes`), and how UAVs follow and repair the lists
(`swarm.allocation.guided`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from coordinator.planner.stop import Limit, ShouldStop
from swarm.allocation.guided import route_arrays, team_arrays
from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import Problem
from swarm.kernels.routes import TeamArrays, optimise_routes

__all__ = ["GuidedPlan", "Progress", "guided_plan"]

Progress = Callable[[int, float], None]
"""Told the iterations spent and the best J to go so far [value·s]."""

_ITERATIONS_PER_TASK = 400
_FEWEST_ITERATIONS = 4_000
_MOST_ITERATIONS = 300_000


@dataclass(frozen=True, slots=True)
class GuidedPlan:
    """What is published."""

    routes: tuple[tuple[int, ...], ...]
    """Task indices per UAV in order of execution."""
    sequence: tuple[int, ...]
    """UAV indices: who completes its first task earlier comes first, who has none last."""
    objective: float
    """Σ of eq. 1 over the lists, from the state on [value·s]."""
    iterations: int
    """Removals and re-insertions tried."""


def guided_plan(
    problem: Problem,
    *,
    seed: int = 0,
    stop: ShouldStop | None = None,
    progress: Progress | None = None,
    state: TeamState | None = None,
    lists: Sequence[Sequence[int]] | None = None,
    threads: int | None = None,
) -> GuidedPlan:
    """Optimise lists until stopped.

    With the same seed the same plan comes out, unless a limit in time decides how many iterations
    are made.

    Args:
        problem: the mission.
        seed: >= 0.
        stop: asked every few milliseconds with the iterations so far. The annealing cools along a
            `Limit`; under any other function, or none, it ends after a few seconds' worth of
            iterations.
        progress: told after each slice of work.
        state: where the team stands; at its start when None.
        lists: to begin with, such as those now published.
        threads: as many as there are processors when None; does not change the result.
    """
    state = TeamState.at_start(problem) if state is None else state
    finite = state.free_s[state.active & np.isfinite(state.free_s)]
    now_s = float(finite.min()) if len(finite) else 0.0
    team = team_arrays(route_arrays(problem), state, state.active, now_s)
    spent = 0

    def count(iterations: int, worth: float) -> None:
        nonlocal spent
        spent = iterations
        if progress is not None:
            progress(iterations, worth)

    routes, objective = optimise_routes(
        team,
        seed=seed,
        spent_frac=_spent_frac(problem.n_task, stop),
        lists=lists,
        progress=count,
        threads=threads,
    )
    return GuidedPlan(
        routes=tuple(tuple(route) for route in routes),
        sequence=_sequence(problem, team, routes),
        objective=objective,
        iterations=spent,
    )


def _spent_frac(n_task: int, stop: ShouldStop | None) -> Callable[[int], float]:
    if isinstance(stop, Limit):
        return stop.spent_frac
    most = min(_MOST_ITERATIONS, max(_FEWEST_ITERATIONS, _ITERATIONS_PER_TASK * n_task))

    def spent_frac(iterations: int) -> float:
        return 1.0 if stop is not None and stop(iterations) else iterations / most

    return spent_frac


def _sequence(
    problem: Problem, team: TeamArrays, routes: Sequence[Sequence[int]]
) -> tuple[int, ...]:
    free_s, place_enu_m, _, _ = team.arguments()
    first_s = np.full(problem.n_uav, np.inf)
    for uav, route in enumerate(routes):
        if route:
            travel_s = problem.travel_s(uav, place_enu_m[uav])[route[0]]
            first_s[uav] = free_s[uav] + travel_s + problem.service_s[route[0]]
    return tuple(int(uav) for uav in np.argsort(first_s, kind="stable"))
