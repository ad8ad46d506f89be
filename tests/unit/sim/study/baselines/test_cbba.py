from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.exact import optimum
from coordinator.planner.options import after_evaluations
from sim.study.baselines.cbba import Insertion, cbba
from swarm.allocation import Problem, TeamState, evaluate
from swarm.model import TaskId, UavId
from tests.support.problems import random_problem, table_1

SEEDS = st.integers(0, 2**32 - 1)


def at_one_place(rng: np.random.Generator, n_uav: int, n_task: int) -> Problem:
    """All tasks at one place and worth their time: here marginal gains do diminish.

    A UAV's own best order is Smith's, its worth is submodular in the tasks it has, and
    insertion finds that order; so the guarantee of the auction holds.
    """
    service_s = rng.uniform(0.0, 3.0, n_task)
    start_enu_m = rng.uniform(0.0, 5.0, (n_uav, 3))
    return Problem(
        uav_ids=tuple(UavId(f"u{i}") for i in range(n_uav)),
        task_ids=tuple(TaskId(f"t{i}") for i in range(n_task)),
        start_enu_m=start_enu_m,
        task_enu_m=np.zeros((n_task, 3)),
        speed_m_s=rng.uniform(1.0, 4.0, n_uav),
        value=rng.uniform(0.0, 5.0, n_task),
        service_s=service_s,
        success=rng.uniform(0.05, 1.0, (n_uav, n_task)),
        survival=np.ones((n_uav, n_task)),
        horizon_s=9.0 + float(service_s.sum()),
    )


def sequential_greedy(problem: Problem) -> list[list[int]]:
    """What the auction converges to: the best of all bids wins, again and again."""
    insertion = Insertion(problem)
    routes: list[list[int]] = [[] for _ in range(problem.n_uav)]
    last = [np.inf] * problem.n_uav
    left = {t for t in range(problem.n_task) if problem.capable[:, t].any()}
    while left:
        bids = []
        for uav, route in enumerate(routes):
            gains, places = insertion.gains(uav, route)
            for task in left:
                if problem.capable[uav, task]:
                    bid = min(float(gains[task]), last[uav])
                    bids.append((-bid, uav, -float(gains[task]), task, int(places[task])))
        bid, uav, _, task, place = min(bids)
        routes[uav].insert(place, task)
        last[uav] = -bid
        left.remove(task)
    return routes


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS)
def test_lists_are_disjoint_complete_and_agreed_upon(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n_uav, n_task = int(rng.integers(1, 6)), int(rng.integers(0, 13))
    problem = random_problem(rng, n_uav, n_task, incapable_frac=0.3, lowest_survival=0.6)
    result = cbba(problem)
    taken = sorted(task for route in result.routes for task in route)
    assert taken == np.flatnonzero(problem.capable.any(axis=0)).tolist()
    assert all(problem.capable[u, t] for u, route in enumerate(result.routes) for t in route)
    assert result.converged
    assert result.completed == 0
    assert cbba(problem) == result


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_auction_ends_as_the_best_bid_of_all_would(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = at_one_place(rng, int(rng.integers(1, 5)), int(rng.integers(1, 10)))
    expected, _ = evaluate(problem, sequential_greedy(problem))
    assert evaluate(problem, cbba(problem).routes)[0] == pytest.approx(expected, rel=1e-9)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS)
def test_worth_is_at_least_half_the_optimum_where_gains_diminish(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = at_one_place(rng, int(rng.integers(1, 4)), int(rng.integers(1, 7)))
    worth, _ = evaluate(problem, cbba(problem).routes)
    assert worth >= 0.5 * optimum(problem).objective


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_trivial_cases_are_solved_to_the_optimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    one_task = random_problem(rng, 4, 1)
    assert evaluate(one_task, cbba(one_task).routes)[0] == pytest.approx(
        optimum(one_task).objective
    )
    one_uav = at_one_place(rng, 1, 6)
    assert evaluate(one_uav, cbba(one_uav).routes)[0] == pytest.approx(optimum(one_uav).objective)


@settings(max_examples=30, deadline=None)
@given(seed=SEEDS)
def test_what_is_open_is_auctioned_among_the_living_from_where_they_stand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 4, 9, incapable_frac=0.2)
    state = TeamState.at_start(problem)
    state.open[rng.choice(9, size=int(rng.integers(0, 9)), replace=False)] = False
    state.active[rng.choice(4, size=int(rng.integers(0, 4)), replace=False)] = False
    state.place_enu_m += rng.uniform(-3.0, 3.0, (4, 3))
    uavs, tasks = np.flatnonzero(state.active), np.flatnonzero(state.open)
    alone = Problem(
        uav_ids=tuple(problem.uav_ids[u] for u in uavs),
        task_ids=tuple(problem.task_ids[t] for t in tasks),
        start_enu_m=state.place_enu_m[uavs],
        task_enu_m=problem.task_enu_m[tasks],
        speed_m_s=problem.speed_m_s[uavs],
        value=problem.value[tasks],
        service_s=problem.service_s[tasks],
        success=problem.success[np.ix_(uavs, tasks)],
        survival=problem.survival[np.ix_(uavs, tasks)],
        horizon_s=problem.horizon_s,
    )
    expected: list[list[int]] = [[] for _ in range(4)]
    for row, route in zip(uavs.tolist(), cbba(alone).routes, strict=True):
        expected[row] = tasks[route].tolist()
    assert cbba(problem, state=state).routes == expected


def test_who_is_free_later_bids_less() -> None:
    problem = random_problem(np.random.default_rng(2), 2, 1)
    state = TeamState.at_start(problem)
    winner = next(u for u, route in enumerate(cbba(problem).routes) if route)
    state.free_s[winner] += 1e3
    assert cbba(problem, state=state).routes[1 - winner] == [0]


def test_nobody_alive_wins_nothing() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    state.active[:] = False
    assert cbba(problem, state=state).routes == [[], [], []]


def test_capacity_grows_where_it_would_hold_a_uav_back() -> None:
    rng = np.random.default_rng(5)
    problem = at_one_place(rng, 3, 12)
    success = problem.success.copy()
    success[1:, :] *= 1e-6  # so that one UAV wants nearly everything
    lopsided = replace(problem, success=success)
    result = cbba(lopsided)
    assert max(map(len, result.routes)) > 2 * 4 + 2
    assert sorted(task for route in result.routes for task in route) == list(range(12))


def test_stopped_auction_still_gives_disjoint_complete_lists() -> None:
    problem = random_problem(np.random.default_rng(1), 4, 20)
    for rounds in (1, 2):
        result = cbba(problem, should_stop=after_evaluations(rounds))
        assert not result.converged
        assert result.rounds == rounds
        assert sorted(task for route in result.routes for task in route) == list(range(20))
