from __future__ import annotations

from itertools import chain, permutations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import TeamState
from swarm.allocation.guided import route_arrays, team_arrays
from swarm.allocation.reference_routes import list_worth
from swarm.kernels.routes_bound import priced_lists, shortest_leg_s
from tests.problems import any_problem


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), n_task=st.integers(2, 5), share=st.floats(0.02, 1.0))
def test_no_list_is_worth_more_after_paying(seed: int, n_task: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    problem = any_problem(seed, 2, n_task)
    state = TeamState.at_start(problem)
    state.free_s[:] = rng.uniform(0.0, 4.0, 2)
    state.survived[:] = rng.uniform(0.3, 1.0, 2)
    state.place_enu_m[:] = rng.uniform(0.0, 10.0, (2, 3))
    state.active[1] = False
    team = team_arrays(route_arrays(problem), state, state.active, 0.0)
    price = rng.uniform(0.0, 10.0, n_task)

    worth, visits = priced_lists(team, price, share * shortest_leg_s(team))

    tasks = np.flatnonzero(problem.capable[0]).tolist()
    routes = chain.from_iterable(permutations(tasks, k) for k in range(len(tasks) + 1))
    best = max(list_worth(problem, state, 0, route) - price[list(route)].sum() for route in routes)
    assert worth >= best - 1e-9 * (1.0 + abs(best))
    assert (visits >= 0).all()
    assert worth == 0.0 or visits.sum() > 0


def test_with_fine_buckets_one_visit_is_worth_nearly_what_it_is() -> None:
    problem = any_problem(3, 1, 6)
    state = TeamState.at_start(problem)
    state.open[:] = False
    task = int(np.flatnonzero(problem.capable[0])[0])
    state.open[task] = True
    team = team_arrays(route_arrays(problem), state, state.active, 0.0)
    shortest_s = shortest_leg_s(team)

    worth, visits = priced_lists(team, np.zeros(6), shortest_s / 1000.0)

    real = max(0.0, list_worth(problem, state, 0, [task]))
    assert real <= worth <= real + problem.weight[0, task] * shortest_s / 1000.0 + 1e-9
    assert visits[task] == 1 or real == 0.0
