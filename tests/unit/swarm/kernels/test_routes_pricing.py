"""Lists against prices, held against all lists; and prices against what they are to minimise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.study.generator import random_mission
from swarm.allocation import Problem, TeamState
from swarm.allocation.problem import FloatArray
from swarm.allocation.rules import team_arrays, team_at_start
from swarm.kernels.routes import TeamArrays
from swarm.kernels.routes_pricing import ListBundle, price_lists, worthy_lists
from tests.support.problems import any_problem
from tests.support.reference import list_worth

Worths = dict[tuple[int, ...], float]


def some_state(
    seed: int, n_uav: int, n_task: int
) -> tuple[Problem, TeamState, TeamArrays, FloatArray]:
    """A team on its way, the last UAV out of action, some tasks in one place; and prices."""
    rng = np.random.default_rng([seed, 2])
    problem = any_problem(seed, n_uav, n_task)
    places_m, service_s = problem.task_enu_m.copy(), problem.service_s.copy()
    if seed % 3 == 0:
        alike = rng.integers(0, n_task, n_task // 2 + 1)
        places_m[alike], service_s[alike] = places_m[alike[0]], 0.0
    problem = replace(
        problem,
        task_enu_m=places_m,
        service_s=service_s,
        survival=np.ones_like(problem.survival),  # which is not looked at
    )
    state = TeamState.at_start(problem)
    state.free_s[:] = rng.uniform(0.0, 4.0, n_uav)
    state.survived[:] = rng.uniform(0.3, 1.0, n_uav)
    state.place_enu_m[:] = rng.uniform(0.0, 10.0, (n_uav, 3))
    state.active[-1] = n_uav == 1
    state.open[0] = seed % 5 != 0
    team = team_arrays(problem, state, state.active, 0.0)
    price = rng.uniform(0.0, 20.0, n_task) * rng.integers(0, 2, n_task)
    return problem, state, team, price


def all_lists(problem: Problem, state: TeamState, uav: int) -> Iterator[tuple[int, ...]]:
    if not state.active[uav]:
        return iter([()])
    tasks = np.flatnonzero(problem.capable[uav] & state.open).tolist()
    return chain.from_iterable(permutations(tasks, k) for k in range(len(tasks) + 1))


def earned(
    problem: Problem, state: TeamState, uav: int, route: tuple[int, ...], price: FloatArray
) -> float:
    return list_worth(problem, state, uav, route) - float(price[list(route)].sum())


@settings(deadline=None, max_examples=80)
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 3), n_task=st.integers(1, 6))
def test_among_few_tasks_the_best_of_all_lists_is_found(seed: int, n_uav: int, n_task: int) -> None:
    problem, state, team, price = some_state(seed, n_uav, n_task)

    found = price_lists(team, price)

    assert found is not None
    for uav in range(n_uav):
        best = max(
            earned(problem, state, uav, one, price) for one in all_lists(problem, state, uav)
        )
        route = tuple(found.lists[uav])
        assert found.bound[uav] == pytest.approx(best, rel=1e-9, abs=1e-9)
        assert earned(problem, state, uav, route, price) == pytest.approx(best, rel=1e-9, abs=1e-9)
        assert found.worth[uav] == pytest.approx(list_worth(problem, state, uav, route), rel=1e-9)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), heads=st.integers(1, 4))
def test_cut_short_it_still_bounds_all_lists(seed: int, heads: int) -> None:
    problem, state, team, price = some_state(seed, 2, 6)

    found = price_lists(team, price, heads=heads)

    assert found is not None
    best = max(earned(problem, state, 0, one, price) for one in all_lists(problem, state, 0))
    assert found.bound[0] >= best - 1e-9 * (1.0 + best)
    paid = float(price[found.lists[0]].sum())
    assert found.worth[0] == pytest.approx(found.bound[0] + paid)
    assert found.bound[1] == 0.0
    assert found.lists[1] == []


def in_one_place(n_task: int, price_frac: float) -> tuple[Problem, FloatArray]:
    """Tasks that cost so much of what they are worth to who is there at once."""
    apart = random_mission(2, n_task, 0)
    places_m = np.tile(apart.task_enu_m[0], (n_task, 1))
    problem = replace(apart, task_enu_m=places_m, service_s=np.zeros(n_task))
    return problem, price_frac * problem.weight.mean(axis=0) * problem.horizon_s


def test_sixty_tasks_in_one_place_are_bounded_by_what_all_of_them_earn() -> None:
    problem, price = in_one_place(60, 0.5)
    team = team_at_start(problem)

    found = price_lists(team, price, heads=100)

    assert found is not None
    for uav in range(2):
        left_s = problem.horizon_s - problem.travel_s(uav, problem.start_enu_m[uav])
        every = np.maximum(0.0, problem.weight[uav] * left_s - price).sum()
        assert found.bound[uav] >= every * (1.0 - 1e-9)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), n_task=st.integers(1, 6), share=st.floats(0.0, 2.0))
def test_worthy_lists_are_all_that_earn_nearly_as_much_as_the_best(
    seed: int, n_task: int, share: float
) -> None:
    problem, state, team, price = some_state(seed, 2, n_task)
    best: list[Worths] = [{}, {}]
    for uav in range(2):
        for route in all_lists(problem, state, uav):
            key, worth = tuple(sorted(route)), list_worth(problem, state, uav, route)
            best[uav][key] = max(worth, best[uav].get(key, -np.inf))
    most = [max(w - float(price[list(k)].sum()) for k, w in each.items()) for each in best]
    slack = share * (1.0 + max(most))

    found = worthy_lists(team, price, np.array(most), slack)

    assert found is not None
    said: list[Worths] = [{}, {}]
    for owner, one, worth in zip(found.uav.tolist(), found.lists, found.worth, strict=True):
        assert worth == pytest.approx(list_worth(problem, state, owner, tuple(one)), rel=1e-9)
        key = tuple(sorted(one))
        assert key not in said[owner]
        said[owner][key] = worth
    for uav in range(2):
        for key, worth in best[uav].items():
            more = worth - float(price[list(key)].sum()) - (most[uav] - slack)
            if key and more > 1e-9:
                assert said[uav][key] == pytest.approx(worth, rel=1e-9)
            elif more < -1e-9:
                assert key not in said[uav]


def test_too_many_worthy_lists_are_none() -> None:
    team = team_at_start(random_mission(3, 30, 0))

    assert worthy_lists(team, np.zeros(30), np.zeros(3), 1.0, heads=50) is None


def test_threads_change_no_bit() -> None:
    team = team_at_start(random_mission(7, 60, 3))
    price = np.random.default_rng(0).uniform(0.0, 1500.0, 60)

    one, three = price_lists(team, price, threads=1), price_lists(team, price, threads=3)

    assert one is not None
    assert three is not None
    assert one.lists == three.lists
    assert one.bound.tobytes() == three.bound.tobytes()
    assert one.worth.tobytes() == three.worth.tobytes()


def test_it_asks_all_the_while_that_tails_in_one_place_are_held_against_each_other() -> None:
    """Some 25 ms of work, nearly all of it for tails, between which 10 ms went by unasked."""
    problem, price = in_one_place(24, 0.9)
    asked = []

    def goes_on() -> bool:
        asked.append(0)
        return False

    team = team_at_start(problem)
    assert price_lists(team, price, heads=1, threads=1, should_stop=goes_on) is not None
    assert len(asked) >= 20


def test_told_to_give_up_there_is_no_answer() -> None:
    team = team_at_start(random_mission(4, 400, 0))
    price, most = np.zeros(400), np.zeros(4)
    asked = []

    def stop() -> bool:
        asked.append(0)
        return True

    assert price_lists(team, price, threads=1, should_stop=stop) is None
    assert worthy_lists(team, price, most, 0.0, threads=1, should_stop=stop) is None
    assert len(asked) == 2


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1))
def test_prices_of_a_bundle_are_the_best_near_the_centre(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_uav, n_task, n_list = 3, 5, 12
    centre, step = rng.uniform(0.0, 5.0, n_task), float(rng.uniform(0.1, 5.0))
    uavs = np.sort(rng.integers(0, n_uav, n_list)).tolist()
    lists = [rng.integers(0, n_task, rng.integers(1, 4)).tolist() for _ in range(n_list)]
    worth = rng.uniform(0.0, 20.0, n_list).tolist()

    def value(price: FloatArray) -> float:
        most = np.zeros(n_uav)
        for uav, one, worthy in zip(uavs, lists, worth, strict=True):
            most[uav] = max(most[uav], worthy - float(price[one].sum()))
        return float(price.sum() + most.sum())

    def near(price: FloatArray) -> float:
        return value(price) + float(((price - centre) ** 2).sum()) / (2.0 * step)

    bundle = ListBundle(n_uav, centre)
    bundle.add(uavs, worth, lists)
    price = bundle.solve(step, 1e-10, sweeps=100_000)

    assert bundle.value == pytest.approx(value(price), rel=1e-12)
    assert (price >= 0.0).all()
    for _ in range(200):
        other = np.maximum(0.0, price + rng.normal(0.0, 10.0 ** rng.uniform(-4, 0), n_task))
        assert near(price) <= near(other) + 1e-7
    shares = bundle.shares()
    assert (shares >= 0.0).all()
    assert (np.bincount(uavs, weights=shares, minlength=n_uav) <= 1.0 + 1e-9).all()


@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 2**32 - 1))
def test_lists_that_a_bundle_knows_leave_it_as_it_was(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_list = 4000
    lists = [rng.integers(0, 6, rng.integers(1, 8)).tolist() for _ in range(n_list)]
    worths = rng.choice(np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), n_list)
    distinct = {(tuple(one), worth) for one, worth in zip(lists, worths.tolist(), strict=True)}
    bundle = ListBundle(2, rng.uniform(0.0, 1.0, 6))

    bundle.add([1] * n_list, worths, lists)
    bundle.solve(1.0, 0.0, sweeps=20)
    value, shares = bundle.value, bundle.shares()
    again = rng.permutation(n_list)
    bundle.add([1] * n_list, worths[again], [lists[k] for k in again])

    assert len(shares) == len(distinct) < n_list
    assert bundle.shares().tobytes() == shares.tobytes()
    assert bundle.value == value
    bundle.add([0], [worths[0]], [lists[0]])  # which another UAV does not know
    assert len(bundle.shares()) == len(distinct) + 1


def test_from_centre_to_centre_prices_reach_the_best() -> None:
    bundle = ListBundle(2, np.zeros(1))
    bundle.add([0, 1], [10.0, 4.0], [[0], [0]])

    prices = []
    for _ in range(20):
        price = bundle.solve(1.0, 1e-12, sweeps=1000)
        bundle.move_centre(price)
        prices.append(float(price[0]))

    assert prices == sorted(prices)
    assert 4.0 - 1e-9 <= prices[-1] <= 10.0 + 1e-9
    assert bundle.value == pytest.approx(10.0)


@pytest.mark.parametrize(
    ("name", "price", "heads", "threads"),
    [
        ("price", [1.0], 1, 1),
        ("price", [np.nan] * 5, 1, 1),
        ("price", [-1.0] * 5, 1, 1),
        ("heads", [1.0] * 5, 0, 1),
        ("threads", [1.0] * 5, 1, 0),
    ],
)
def test_wrong_arguments_are_refused_by_name(
    name: str, price: list[float], heads: int, threads: int
) -> None:
    team = team_at_start(random_mission(2, 5, 0))

    with pytest.raises(ValueError, match=name):
        price_lists(team, np.array(price), heads=heads, threads=threads)


def test_wrong_lists_floors_and_steps_are_refused() -> None:
    team = team_at_start(random_mission(2, 5, 0))
    bundle = ListBundle(2, np.zeros(5))

    with pytest.raises(ValueError, match="most"):
        worthy_lists(team, np.zeros(5), np.zeros(3), 1.0)
    with pytest.raises(ValueError, match="slack"):
        worthy_lists(team, np.zeros(5), np.zeros(2), -1.0)
    with pytest.raises(ValueError, match="uav"):
        bundle.add([2], [1.0], [[0]])
    with pytest.raises(ValueError, match="lists"):
        bundle.add([0], [1.0], [[5]])
    with pytest.raises(ValueError, match="length"):
        bundle.add([0], [1.0], [])
    with pytest.raises(ValueError, match="step"):
        bundle.solve(0.0, 0.0, sweeps=1)
