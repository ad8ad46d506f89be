from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.study.baselines.cbba import Insertion
from swarm.allocation import TeamState, evaluate
from tests.support.problems import random_problem
from tests.support.reference import objective


@given(seed=st.integers(0, 2**32 - 1))
def test_gains_are_differences_of_the_objective(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 2, 7, lowest_survival=0.5)
    path = rng.permutation(7)[: rng.integers(0, 7)].tolist()
    gains, places = Insertion(problem).gains(1, path)
    without = objective(problem, [[], path])
    for task in set(range(7)) - set(path):
        worth = [
            objective(problem, [[], [*path[:place], task, *path[place:]]]) - without
            for place in range(len(path) + 1)
        ]
        assert gains[task] == pytest.approx(max(worth), abs=1e-9)
        assert worth[places[task]] == pytest.approx(max(worth), abs=1e-9)


@given(seed=st.integers(0, 2**32 - 1))
def test_gains_count_from_where_the_team_stands(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 1, 5, lowest_survival=0.5)
    state = TeamState.at_start(problem)
    state.free_s += rng.uniform(0.0, 9.0)
    state.place_enu_m += rng.uniform(-3.0, 3.0, (1, 3))
    state.survived *= rng.uniform(0.2, 1.0)
    path = [3, 1]
    gains, places = Insertion(problem, state).gains(0, path)
    without, _ = evaluate(problem, [path], state)
    for task in (0, 2, 4):
        place = int(places[task])
        worth, _ = evaluate(problem, [[*path[:place], task, *path[place:]]], state)
        assert gains[task] == pytest.approx(worth - without, abs=1e-9)
