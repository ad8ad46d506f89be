from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, permutations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import TeamState
from swarm.allocation.rules import team_arrays, team_at_start
from swarm.kernels.routes_bound import Timetable, relaxed_lists, worthy_timed_lists
from tests.support.problems import any_problem, table_1
from tests.support.reference import list_worth, timed_list_worth


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
    team = team_arrays(problem, state, state.active, 0.0)
    price = rng.uniform(0.0, 10.0, n_task)

    found = relaxed_lists(team, price, share)

    assert found is not None
    worth = float(found.bound.sum())
    tasks = np.flatnonzero(problem.capable[0]).tolist()
    routes = chain.from_iterable(permutations(tasks, k) for k in range(len(tasks) + 1))
    best = max(list_worth(problem, state, 0, route) - price[list(route)].sum() for route in routes)
    assert worth >= best - 1e-9 * (1.0 + abs(best))
    assert found.lists[1] == []
    assert (worth > 0.0) == bool(found.lists[0])
    paid = float(price[found.lists[0]].sum())
    assert found.worth[0] == pytest.approx(found.bound[0] + paid)


def test_with_fine_buckets_one_visit_is_worth_nearly_what_it_is() -> None:
    problem = any_problem(3, 1, 6)
    state = TeamState.at_start(problem)
    state.open[:] = False
    task = int(np.flatnonzero(problem.capable[0])[0])
    state.open[task] = True
    team = team_arrays(problem, state, state.active, 0.0)

    found = relaxed_lists(team, np.zeros(6), 1e-3)

    assert found is not None
    real = max(0.0, list_worth(problem, state, 0, [task]))
    assert real <= found.bound[0] <= real + problem.weight[0, task] * 1e-3 + 1e-9
    assert found.lists[0] == ([task] if real > 0.0 else [])


def random_timetable(rng: np.random.Generator, n_uav: int, n_task: int) -> Timetable:
    """Deadlines, release times, and legs of any length, down to none at all."""
    shape = (n_uav, n_task)
    leg_s = rng.uniform(0.0, 3.0, (n_uav, n_task, n_task))
    leg_s *= rng.integers(0, 2, leg_s.shape)
    return Timetable(
        first_s=rng.uniform(0.0, 3.0, shape),
        leg_s=leg_s,
        earliest_s=rng.uniform(0.0, 6.0, shape) * rng.integers(0, 2, shape),
        latest_s=np.where(rng.random(shape) < 0.5, np.inf, rng.uniform(0.0, 9.0, shape)),
    )


def lists_of(tasks: list[int]) -> Iterator[tuple[int, ...]]:
    return chain.from_iterable(permutations(tasks, k) for k in range(len(tasks) + 1))


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_task=st.integers(1, 5),
    bucket_s=st.floats(0.01, 5.0),
    expansions=st.sampled_from([0, 1, 3, 10_000]),
)
def test_timed_lists_are_bounded_and_searched_as_the_plain_definition_says(
    seed: int, n_task: int, bucket_s: float, expansions: int
) -> None:
    rng = np.random.default_rng(seed)
    problem = any_problem(seed, 2, n_task)
    deadly = rng.random(problem.survival.shape) < 0.2
    problem = replace(problem, survival=np.where(deadly, 0.0, problem.survival))
    timetable = random_timetable(rng, 2, n_task)
    team = team_at_start(problem)
    price = rng.uniform(0.0, 10.0, n_task)

    found = relaxed_lists(team, price, bucket_s, timetable=timetable, expansions=expansions)

    assert found is not None
    worth = float(found.bound.sum())
    best = 0.0
    for uav in range(2):
        paid = [0.0]
        for route in lists_of(np.flatnonzero(problem.capable[uav]).tolist()):
            value = timed_list_worth(problem, timetable, uav, route)
            if value is not None:
                paid.append(value - float(price[list(route)].sum()))
        best += max(paid)
    assert worth >= best - 1e-9 * (1.0 + best)
    if expansions == 10_000:
        assert worth <= best * (1.0 + 1e-4) + 1e-9
        assert all(len(set(one)) == len(one) for one in found.lists)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_task=st.integers(1, 5),
    bucket_s=st.floats(0.01, 5.0),
    share=st.floats(0.0, 2.0),
)
def test_worthy_timed_lists_are_all_that_earn_nearly_as_much_as_the_best(
    seed: int, n_task: int, bucket_s: float, share: float
) -> None:
    rng = np.random.default_rng(seed)
    problem = any_problem(seed, 2, n_task)
    deadly = rng.random(problem.survival.shape) < 0.2
    problem = replace(problem, survival=np.where(deadly, 0.0, problem.survival))
    timetable = random_timetable(rng, 2, n_task)
    price = rng.uniform(0.0, 10.0, n_task)
    best: list[dict[tuple[int, ...], float]] = [{(): 0.0}, {(): 0.0}]
    for uav in range(2):
        for route in lists_of(np.flatnonzero(problem.capable[uav]).tolist()):
            value = timed_list_worth(problem, timetable, uav, route)
            before = timed_list_worth(problem, timetable, uav, route[:-1])
            if route and value is not None and before is not None and value > before:
                key = tuple(sorted(route))
                best[uav][key] = max(value, best[uav].get(key, -np.inf))
    most = [max(w - float(price[list(k)].sum()) for k, w in each.items()) for each in best]
    slack = share * (1.0 + max(most))

    found = worthy_timed_lists(
        team_at_start(problem),
        price,
        np.array(most),
        slack,
        bucket_s,
        heads=10_000,
        timetable=timetable,
    )

    assert found is not None
    said: list[dict[tuple[int, ...], float]] = [{}, {}]
    for uav, one, worth in zip(found.uav.tolist(), found.lists, found.worth, strict=True):
        key = tuple(sorted(one))
        assert worth == pytest.approx(timed_list_worth(problem, timetable, uav, one), rel=1e-9)
        assert key not in said[uav]
        said[uav][key] = worth
    for uav in range(2):
        for key, worth in best[uav].items():
            more = worth - float(price[list(key)].sum()) - (most[uav] - slack)
            if key and more > 1e-9:
                assert said[uav][key] == pytest.approx(worth, rel=1e-9)
            elif more < -1e-9:
                assert key not in said[uav]


def test_too_many_worthy_timed_lists_are_none() -> None:
    team = team_at_start(any_problem(1, 3, 30))

    assert worthy_timed_lists(team, np.zeros(30), np.zeros(3), 1.0, 0.1, heads=50) is None


def test_search_among_real_lists_only_lowers_the_bound() -> None:
    problem = any_problem(7, 3, 12)
    team = team_at_start(problem)
    worths = []
    for expansions in (0, 10, 100, 10_000):
        found = relaxed_lists(team, np.full(12, 0.1), 0.02, expansions=expansions)
        assert found is not None
        worths.append(float(found.bound.sum()))

    assert worths == sorted(worths, reverse=True)
    assert worths[-1] < worths[0]


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("first_s", np.full((2, 3), -1.0)),
        ("leg_s", np.zeros((2, 3))),
        ("earliest_s", np.full((2, 3), np.inf)),
        ("latest_s", np.full((2, 3), np.nan)),
    ],
)
def test_wrong_timetables_are_refused_by_name(name: str, wrong: npt.NDArray[np.float64]) -> None:
    times = np.zeros((2, 3))
    right = {
        "first_s": times,
        "leg_s": np.zeros((2, 3, 3)),
        "earliest_s": times,
        "latest_s": times,
    }

    with pytest.raises(ValueError, match=name):
        Timetable(**{**right, name: wrong})


def test_told_to_give_up_it_has_no_answer() -> None:
    problem = any_problem(1, 3, 200)
    state = TeamState.at_start(problem)
    team = team_arrays(problem, state, state.active, 0.0)
    bucket_s = problem.horizon_s / 400.0

    price, most = np.zeros(200), np.zeros(3)
    assert relaxed_lists(team, price, bucket_s, should_stop=lambda: True) is None
    assert (
        worthy_timed_lists(team, price, most, 0.0, bucket_s, heads=10_000, should_stop=lambda: True)
        is None
    )


@pytest.mark.parametrize(
    ("name", "price", "bucket_s", "threads"),
    [
        ("price", [1.0], 0.1, 1),
        ("price", [np.nan] * 8, 0.1, 1),
        ("price", [-1.0] * 8, 0.1, 1),
        ("bucket_s", [1.0] * 8, 0.0, 1),
        ("bucket_s", [1.0] * 8, float("nan"), 1),
        ("bucket_s", [1.0] * 8, 1e-9, 1),
        ("threads", [1.0] * 8, 0.1, 0),
    ],
)
def test_wrong_arguments_are_refused_by_name(
    name: str, price: list[float], bucket_s: float, threads: int
) -> None:
    team = team_at_start(table_1())

    with pytest.raises(ValueError, match=name):
        relaxed_lists(team, np.array(price), bucket_s, threads=threads)
    with pytest.raises(ValueError, match=name):
        worthy_timed_lists(
            team, np.array(price), np.zeros(3), 0.0, bucket_s, heads=1, threads=threads
        )


@pytest.mark.parametrize(
    ("name", "most", "slack", "heads"),
    [
        ("most", np.zeros(2), 0.0, 1),
        ("most", np.full(3, np.nan), 0.0, 1),
        ("slack", np.zeros(3), -1.0, 1),
        ("heads", np.zeros(3), 0.0, 0),
    ],
)
def test_wrong_wishes_for_worthy_lists_are_refused_by_name(
    name: str, most: npt.NDArray[np.float64], slack: float, heads: int
) -> None:
    team = team_at_start(table_1())

    with pytest.raises(ValueError, match=name):
        worthy_timed_lists(team, np.ones(8), most, slack, 0.1, heads=heads)
