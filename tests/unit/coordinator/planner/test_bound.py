from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.bound import UpperBound, trivial_bound, upper_bound
from coordinator.planner.exact import optimum
from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import guided_plan
from sim.study.generator import random_mission
from swarm.allocation.problem import Problem
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes_bound import priced_lists, shortest_legs_s
from tests.support.problems import any_problem, random_problem, table_1


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 3), n_task=st.integers(0, 6))
def test_no_bound_is_below_the_optimum(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    best = optimum(problem)

    bound = upper_bound(problem, best.routes)

    assert bound.objective >= best.objective - 1e-9 * abs(best.objective)
    assert bound.objective <= trivial_bound(problem)
    assert trivial_bound(problem) >= best.objective - 1e-9 * abs(best.objective)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_prices_give_a_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 2, 5, horizon_s=float(rng.uniform(2.0, 12.0)))
    team = team_at_start(problem)
    price = rng.uniform(0.0, 20.0, 5)

    worth, visits = priced_lists(team, price, shortest_legs_s(team).min() * rng.uniform(0.05, 1.0))

    best = optimum(problem).objective
    assert price.sum() + worth >= best - 1e-9 * abs(best)
    assert worth >= 0.0
    assert visits.min() >= 0


def test_it_is_closer_than_the_trivial_bound() -> None:
    problem = random_mission(10, 50, 1)
    plan = guided_plan(problem)

    bound = upper_bound(problem, plan.routes)

    assert is_lagrangian(bound, problem)
    assert 1.0 - plan.objective / bound.objective < 0.06
    assert 1.0 - plan.objective / trivial_bound(problem) > 0.15


def test_two_tasks_in_one_place_do_not_spoil_it() -> None:
    apart = random_mission(6, 24, 1)
    places_m, service_s = apart.task_enu_m.copy(), apart.service_s.copy()
    places_m[1], service_s[:2] = places_m[0], 0.0
    together = replace(apart, task_enu_m=places_m, service_s=service_s)
    gaps = []
    for problem in (apart, together):
        plan = guided_plan(problem, stop=after_evaluations(5000))

        bound = upper_bound(problem, plan.routes)

        assert is_lagrangian(bound, problem)
        gaps.append(1.0 - plan.objective / bound.objective)
    assert gaps[1] < gaps[0] + 0.01


def test_told_to_stop_before_there_is_any_it_is_the_trivial_one() -> None:
    problem = random_mission(10, 50, 1)

    bound = upper_bound(problem, guided_plan(problem).routes, lambda _: True)

    assert bound == UpperBound(trivial_bound(problem), steps=0)


def is_lagrangian(bound: UpperBound, problem: Problem) -> bool:
    """Of the two bounds only this one changes prices, and only it is ever below the trivial one."""
    return bound.steps > 0 and bound.objective < trivial_bound(problem)


def test_threads_do_not_change_it_and_it_stops_when_told() -> None:
    problem = table_1()
    routes = optimum(problem).routes

    assert upper_bound(problem, routes, threads=1) == upper_bound(problem, routes, threads=3)
    assert upper_bound(problem, routes, after_evaluations(2)).steps == 2


def test_nothing_to_do_is_worth_nothing() -> None:
    problem = random_problem(np.random.default_rng(0), 2, 3, incapable_frac=1.0)

    assert upper_bound(problem, [[], []]).objective == 0.0


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
    problem = table_1()
    team = team_at_start(problem)

    with pytest.raises(ValueError, match=name):
        priced_lists(team, np.array(price), bucket_s, threads=threads)
