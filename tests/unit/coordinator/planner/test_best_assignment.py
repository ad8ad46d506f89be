from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from coordinator.planner.assignment import best_assignment


@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(0, 9), st.integers(0, 9)),
    levels=st.integers(1, 9),
)
def test_the_same_pairs_come_out_as_of_scipy_ties_included(
    seed: int, shape: tuple[int, int], levels: int
) -> None:
    rng = np.random.default_rng(seed)
    scores = rng.integers(0, levels, shape) * rng.choice([1.0, 0.1])
    scores[rng.random(shape) < 0.2] = -100.0

    rows, columns = linear_sum_assignment(scores, maximize=True)

    assert best_assignment(scores) == dict(zip(rows.tolist(), columns.tolist(), strict=True))
