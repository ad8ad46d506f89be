from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation.problem import FloatArray
from swarm.kernels._kernels import TourTable
from tests.support import reference
from tests.support.problems import random_problem
from tests.support.tours import good_tour, tour_table

SEEDS = st.integers(0, 2**32 - 1)
TourProblem = tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]


def tour_problem(seed: int, n: int, lowest_survival: float, sign: float = 1.0) -> TourProblem:
    """Completion times of first tasks, weights, survival, legs and horizon."""
    problem = random_problem(np.random.default_rng(seed), 1, n, lowest_survival=lowest_survival)
    completion_s = problem.travel_s(0, problem.start_enu_m[0]) + problem.service_s
    leg_s = np.array(
        [problem.travel_s(0, place) + problem.service_s for place in problem.task_enu_m]
    ).reshape(n, n)
    return completion_s, sign * problem.weight[0], problem.survival[0], leg_s, problem.horizon_s


def table_of(case: TourProblem) -> TourTable:
    _, weight, survival, leg_s, horizon_s = case
    return tour_table(weight, survival, leg_s, horizon_s)


@settings(deadline=None)
@given(
    seed=SEEDS,
    n=st.integers(0, 6),
    lowest=st.sampled_from([1.0, 0.6, 0.0]),
    sign=st.sampled_from([1.0, -1.0]),
)
def test_table_knows_the_best_tour_of_every_subset(
    seed: int, n: int, lowest: float, sign: float
) -> None:
    case = tour_problem(seed, n, lowest, sign)
    completion_s = case[0]
    table = table_of(case)
    values = table.values(completion_s)

    assert values[0] == 0.0
    for mask in range(1, 1 << n):
        inside = [i for i in range(n) if mask >> i & 1]
        worth = {tour: reference.tour_worth(tour, *case) for tour in permutations(inside)}
        by_first = table.first_values(mask, completion_s)
        for first in range(n):
            expected = max((w for t, w in worth.items() if t[0] == first), default=-np.inf)
            assert by_first[first] == pytest.approx(expected, abs=1e-9)
        assert values[mask] == pytest.approx(max(worth.values()), abs=1e-9)
        found = tuple(table.best_tour(mask, completion_s).tolist())
        assert worth[found] == pytest.approx(max(worth.values()), abs=1e-9)


@pytest.mark.parametrize("lowest", [1.0, 0.6])
def test_table_over_more_tasks_knows_their_best_tour(lowest: float) -> None:
    case = tour_problem(3, 8, lowest)

    found = table_of(case).values(case[0])[-1]

    best = max(reference.tour_worth(tour, *case) for tour in permutations(range(8)))
    assert found == pytest.approx(best, abs=1e-9)


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS, lowest=st.sampled_from([1.0, 0.6]))
def test_larger_tables_say_the_same_of_their_subsets(seed: int, lowest: float) -> None:
    completion_s, weight, survival, leg_s, horizon_s = tour_problem(seed, 9, lowest)
    part = np.flatnonzero(np.random.default_rng(seed).uniform(size=9) < 0.6)

    whole = tour_table(weight, survival, leg_s, horizon_s)
    alone = tour_table(weight[part], survival[part], leg_s[np.ix_(part, part)], horizon_s)

    mask = sum(1 << int(i) for i in part)
    expected = alone.first_values((1 << len(part)) - 1, completion_s[part])
    assert whole.first_values(mask, completion_s)[part].tolist() == expected.tolist()


@pytest.mark.parametrize("lowest", [1.0, 0.7])
def test_heuristic_tours_come_close_to_the_best(lowest: float) -> None:
    losses = []
    for seed in range(15):
        completion_s, weight, survival, leg_s, _ = tour_problem(seed, 11, lowest)
        best = tour_table(weight, survival, leg_s, 30.0).values(completion_s)[-1]
        tour, value, second = good_tour(completion_s, weight, survival, leg_s, 30.0)
        worth = reference.tour_worth(tour.tolist(), completion_s, weight, survival, leg_s, 30.0)
        assert value == pytest.approx(worth)
        assert sorted(tour) == list(range(11))
        assert second <= best + 1e-9
        losses.append((best - value) / best)
    assert min(losses) >= -1e-12
    assert np.mean(losses) < 0.002


@settings(deadline=None, max_examples=40)
@given(seed=SEEDS, n=st.integers(2, 40), lowest=st.sampled_from([1.0, 0.6, 0.0]))
def test_heuristic_tour_is_complete_and_worth_what_it_says(
    seed: int, n: int, lowest: float
) -> None:
    case = tour_problem(seed, n, lowest)

    tour, value, second = good_tour(*case)

    assert sorted(tour) == list(range(n))
    assert value == pytest.approx(reference.tour_worth(tour.tolist(), *case), abs=1e-9)
    assert second <= value + 1e-9 * abs(value)


def test_heuristic_is_the_same_every_time() -> None:
    case = tour_problem(4, 25, 0.9)

    assert good_tour(*case)[0].tolist() == good_tour(*case)[0].tolist()


def test_long_tours_are_still_tours() -> None:
    case = tour_problem(6, 300, 0.9)

    assert sorted(good_tour(*case)[0]) == list(range(300))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("weight", np.ones((3, 1))),
        ("weight", np.array([1.0, np.nan, 1.0])),
        ("weight", ["a", "b", "c"]),
        ("survival", np.ones(2)),
        ("survival", np.array([0.5, 1.5, 0.5])),
        ("leg_s", np.ones((3, 2))),
        ("leg_s", np.full((3, 3), np.inf)),
        ("horizon_s", float("nan")),
    ],
)
def test_wrong_argument_of_a_table_is_refused_by_name(name: str, value: object) -> None:
    given_: dict[str, object] = {
        "weight": np.ones(3),
        "survival": np.ones(3),
        "leg_s": np.ones((3, 3)),
        "horizon_s": 9.0,
    }

    with pytest.raises(ValueError, match=name):
        tour_table(**{**given_, name: value})  # type: ignore[arg-type] # wrong on purpose


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("completion_s", np.ones(1)),
        ("completion_s", np.array([1.0, np.inf, 1.0])),
        ("weight", np.ones(4)),
        ("survival", np.array([0.5, np.nan, 0.5])),
        ("leg_s", np.ones(9)),
        ("horizon_s", float("inf")),
    ],
)
def test_wrong_argument_of_a_long_tour_is_refused_by_name(name: str, value: object) -> None:
    given_: dict[str, object] = {
        "completion_s": np.ones(3),
        "weight": np.ones(3),
        "survival": np.ones(3),
        "leg_s": np.ones((3, 3)),
        "horizon_s": 9.0,
    }

    with pytest.raises(ValueError, match=name):
        good_tour(**{**given_, name: value})  # type: ignore[arg-type] # wrong on purpose


def test_too_many_tasks_for_a_table_are_refused() -> None:
    for n, survival in ((19, 1.0), (17, 0.9)):
        with pytest.raises(ValueError, match="at most"):
            tour_table(np.ones(n), np.full(n, survival), np.ones((n, n)), 9.0)


def test_sets_beyond_the_table_are_refused() -> None:
    case = tour_problem(0, 3, 1.0)
    table = table_of(case)

    for mask in (8, 2**31):
        with pytest.raises(ValueError, match="mask"):
            table.first_values(mask, case[0])
        with pytest.raises(ValueError, match="mask"):
            table.best_tour(mask, case[0])
    with pytest.raises(ValueError, match="completion_s"):
        table.values(case[0][:2])
