"""Teams of made-up scenarios in mid-mission."""

from __future__ import annotations

import random

from swarm.allocation.field import FieldProblem, FieldState


def with_landings(rng: random.Random, problem: FieldProblem) -> FieldProblem:
    """The same where each UAV takes a time of its own to land, and to climb again."""
    as_briefed = [1.0] * problem.n_uav
    land_s, climb_s = ([rng.uniform(0.5, 4.0) for _ in as_briefed] for _ in range(2))
    return problem.calibrated(as_briefed, as_briefed, land_s, climb_s)


def random_state(rng: random.Random, problem: FieldProblem) -> FieldState:
    """In mid-mission: some fly somewhere, some stand at bases, some are out of it."""
    n_uav = problem.n_uav
    state = FieldState.at_start(problem, rng.sample(range(n_uav), n_uav))
    for uav in range(n_uav):
        state.free_s[uav] = rng.uniform(0.0, 60.0)
        state.sortie_end_s[uav] = state.free_s[uav] + rng.uniform(0.0, 200.0)
        state.survived[uav] = rng.uniform(0.5, 1.0)
        state.active[uav] = rng.random() < 0.9
        if problem.n_base and rng.random() < 0.4:
            base = rng.randrange(problem.n_base)
            state.landed_at[uav] = base
            state.first_s[uav] = problem.leg_s[problem.kind[uav], n_uav + base]
        else:
            node = rng.randrange(problem.n_node)
            state.first_s[uav] = problem.leg_s[problem.kind[uav], node] + rng.uniform(0.0, 9.0)
    return state
