from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation.long_tours import good_tours, tour_values
from swarm.allocation.problem import FloatArray
from swarm.allocation.tours import best_tour, legs_s, tour_table
from tests.problems import random_problem

SEEDS = st.integers(0, 2**32 - 1)


def tour_problem(
    seed: int, n: int, lowest_survival: float, sign: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Completion times of first tasks, weights, survival, legs and horizon."""
    problem = random_problem(np.random.default_rng(seed), 1, n, lowest_survival=lowest_survival)
    tasks = np.arange(n)
    completion_s = problem.travel_s(0, problem.start_enu_m[0]) + problem.service_s
    leg_s = legs_s(problem, 0, tasks)
    return completion_s, sign * problem.weight[0], problem.survival[0], leg_s, problem.horizon_s


@settings(deadline=None)
@given(
    seed=SEEDS,
    n=st.integers(1, 6),
    lowest=st.sampled_from([1.0, 0.6, 0.0]),
    sign=st.sampled_from([1.0, -1.0]),
)
def test_table_knows_the_best_tour_of_every_subset(
    seed: int, n: int, lowest: float, sign: float
) -> None:
    completion_s, weight, survival, leg_s, horizon_s = tour_problem(seed, n, lowest, sign)
    table = tour_table(weight, survival, leg_s, horizon_s)
    values = table.values(completion_s)

    for mask in range(1, 1 << n):
        inside = [i for i in range(n) if mask >> i & 1]
        tours = np.array(list(permutations(inside)))
        worth = tour_values(tours, completion_s, weight, survival, leg_s, horizon_s)
        by_first = table.first_values(mask, completion_s)
        for first in range(n):
            expected = max(worth[tours[:, 0] == first], default=-np.inf)
            assert by_first[first] == pytest.approx(expected, abs=1e-9)
        assert values[mask] == pytest.approx(worth.max(), abs=1e-9)
        found = np.array([best_tour(table, mask, completion_s, leg_s)])
        assert tour_values(
            found, completion_s, weight, survival, leg_s, horizon_s
        ) == pytest.approx(worth.max(), abs=1e-9)


@pytest.mark.parametrize("lowest", [1.0, 0.7])
def test_heuristic_tours_come_close_to_the_best(lowest: float) -> None:
    losses = []
    for seed in range(15):
        arguments = tour_problem(seed, 11, lowest)
        completion_s, weight, survival, leg_s, _ = arguments
        best = tour_table(weight, survival, leg_s, 30.0).values(completion_s)[-1]
        tour, value, second = good_tours(completion_s, weight, survival, leg_s, 30.0)
        worth = tour_values(tour[None], completion_s, weight, survival, leg_s, 30.0)[0]
        assert value == pytest.approx(worth)
        assert sorted(tour) == list(range(11))
        assert second <= best + 1e-9
        losses.append((best - value) / best)
    assert min(losses) >= -1e-12
    assert np.mean(losses) < 0.002


def test_heuristic_is_the_same_every_time() -> None:
    arguments = tour_problem(4, 25, 0.9)

    assert good_tours(*arguments)[0].tolist() == good_tours(*arguments)[0].tolist()
