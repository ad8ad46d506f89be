from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.bound import UpperBound, meets, trivial_bound, upper_bound
from coordinator.planner.exact import optimum
from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import guided_plan
from sim.study.generator import random_mission
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import Problem
from swarm.allocation.rules import team_at_start
from swarm.kernels.routes_pricing import price_lists
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
@given(seed=st.integers(0, 2**32 - 1), n_uav=st.integers(1, 4), n_task=st.integers(2, 7))
def test_it_proves_what_the_exact_solver_finds(seed: int, n_uav: int, n_task: int) -> None:
    rng = np.random.default_rng(seed)
    incapable = float(rng.choice([0.0, 0.3]))
    problem = random_problem(rng, n_uav, n_task, horizon_s=40.0, incapable_frac=incapable)
    best = optimum(problem)
    none: list[list[int]] = [[] for _ in range(n_uav)]
    poor = none if seed % 2 else guided_plan(problem).routes

    bound = upper_bound(problem, poor)

    assert meets(bound.objective, best.objective)
    assert bound.objective >= best.objective - 1e-9 * abs(best.objective)
    found = evaluate(problem, bound.lists or poor)[0]
    assert found == pytest.approx(best.objective, rel=1e-9)


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_prices_give_a_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 2, 5, horizon_s=float(rng.uniform(2.0, 12.0)))
    price = rng.uniform(0.0, 20.0, 5)

    found = price_lists(team_at_start(problem), price)

    assert found is not None
    best = optimum(problem).objective
    assert price.sum() + found.bound.sum() >= best - 1e-9 * abs(best)


def test_fifty_tasks_are_proven() -> None:
    for seed in (0, 1):
        problem = random_mission(10, 50, seed, horizon_s=260.0)
        plan = guided_plan(problem)

        bound = upper_bound(problem, plan.routes)

        objective = evaluate(problem, bound.lists or plan.routes)[0]
        assert objective >= plan.objective * (1.0 - 1e-12)
        assert meets(bound.objective, objective)
        assert is_lagrangian(bound, problem)


def test_it_only_ever_falls_and_every_fall_is_told() -> None:
    problem = random_mission(6, 40, 2)
    told: list[float] = []

    bound = upper_bound(problem, guided_plan(problem).routes, progress=told.append)

    assert len(told) > 1
    assert told == sorted(set(told), reverse=True)
    assert told[-1] == bound.objective


def test_short_legs_and_tasks_in_one_place_do_not_spoil_it() -> None:
    apart = random_mission(6, 24, 1)
    places_m, service_s = apart.task_enu_m.copy(), apart.service_s.copy()
    places_m[1], service_s[:2] = places_m[0], 0.0
    places_m[3:8] = places_m[2] + np.arange(5)[:, None] * 0.01
    together = replace(apart, task_enu_m=places_m, service_s=service_s)
    for problem in (apart, together):
        plan = guided_plan(problem, stop=after_evaluations(5000))

        bound = upper_bound(problem, plan.routes)

        objective = evaluate(problem, bound.lists or plan.routes)[0]
        assert bound.objective <= objective * 1.005


def test_told_to_stop_before_there_is_any_it_is_the_trivial_one() -> None:
    problem = random_mission(10, 50, 1)

    bound = upper_bound(problem, guided_plan(problem).routes, lambda _: True)

    assert bound == UpperBound(trivial_bound(problem), rounds=0)


@pytest.mark.parametrize("asked_most", [1, 3, 10, 30, 100])
def test_told_to_stop_at_any_moment_it_is_still_a_bound(asked_most: int) -> None:
    problem = random_mission(8, 60, 4)
    plan = guided_plan(problem, stop=after_evaluations(4000))
    asked = 0

    def stop(rounds: float) -> bool:
        nonlocal asked
        asked += 1
        return asked > asked_most

    bound = upper_bound(problem, plan.routes, stop, threads=1)

    assert plan.objective <= bound.objective <= trivial_bound(problem)
    assert asked <= asked_most + 8  # nothing goes on for long


def is_lagrangian(bound: UpperBound, problem: Problem) -> bool:
    """Of the two bounds only this one tries prices, and only it is ever below the trivial one."""
    return bound.rounds > 0 and bound.objective < trivial_bound(problem)


def test_threads_do_not_change_it_and_it_stops_when_told() -> None:
    problem = table_1()
    routes = optimum(problem).routes
    other = random_mission(10, 60, 5)
    lists = guided_plan(other, stop=after_evaluations(3000)).routes

    assert upper_bound(problem, routes, threads=1) == upper_bound(problem, routes, threads=3)
    assert upper_bound(other, lists, threads=1) == upper_bound(other, lists, threads=3)
    assert upper_bound(other, lists, after_evaluations(2)).rounds == 2


def test_survival_below_one_is_bounded_without_it() -> None:
    problem = random_mission(5, 25, 0, lowest_survival=0.95)
    plan = guided_plan(problem, stop=after_evaluations(4000))

    bound = upper_bound(problem, plan.routes)

    certain = replace(problem, survival=np.ones_like(problem.survival))
    assert plan.objective <= bound.objective
    assert bound.objective <= upper_bound(certain, plan.routes).objective * 1.01


def test_nothing_to_do_is_worth_nothing() -> None:
    problem = random_problem(np.random.default_rng(0), 2, 3, incapable_frac=1.0)

    assert upper_bound(problem, [[], []]).objective == 0.0
