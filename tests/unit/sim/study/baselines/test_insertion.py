from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.study.baselines.insertion import Insertion
from swarm.allocation.reference import objective
from tests.problems import random_problem


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
