from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.planner.options import after_evaluations
from coordinator.planner.sequence_search import SearchLimits, best_sequence
from swarm.allocation import Problem, TeamState, evaluate, rank_of, run
from swarm.allocation.problem import FloatArray
from swarm.allocation.rules import kernel_rule
from tests.support.problems import any_problem, random_problem, table_1

SEEDS = st.integers(0, 2**32 - 1)
NO_LISTING = SearchLimits(first_rounds=0, first_rounds_large_fleet=0)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def objective_of(problem: Problem, sequence: tuple[int, ...], rule: str) -> float:
    routes, _ = run(problem, TeamState.at_start(problem), rank_of(sequence), kernel_rule(rule))
    return evaluate(problem, routes)[0]


def best_of_all(problem: Problem, rule: str) -> float:
    sequences = permutations(range(problem.n_uav))
    return max(objective_of(problem, sequence, rule) for sequence in sequences)


@settings(deadline=None, max_examples=60)
@given(
    seed=SEEDS,
    n_uav=st.integers(1, 4),
    n_task=st.integers(0, 8),
    rule=st.sampled_from(["greedy", "lookahead"]),
)
def test_small_fleets_get_the_best_of_all_sequences(
    seed: int, n_uav: int, n_task: int, rule: str
) -> None:
    problem = any_problem(seed, n_uav, n_task)

    found = best_sequence(problem, kernel_rule(rule), rng())

    assert found.exhaustive
    assert found.objective == pytest.approx(best_of_all(problem, rule), abs=1e-9)
    assert objective_of(problem, found.sequence, rule) == pytest.approx(found.objective, abs=1e-9)


def grid_problem(seed: int, n_uav: int, n_task: int) -> Problem:
    """Few distinct speeds, places and values, so that UAVs equal each other and become free at
    the same times."""
    random = np.random.default_rng(seed)

    def few(*shape: int) -> FloatArray:
        return random.integers(0, 3, shape).astype(float)

    template = random_problem(random, n_uav, n_task)
    return Problem(
        uav_ids=template.uav_ids,
        task_ids=template.task_ids,
        start_enu_m=few(n_uav, 3) * [1.0, 0.0, 0.0],
        task_enu_m=few(n_task, 3) * [1.0, 1.0, 0.0],
        speed_m_s=random.choice([1.0, 2.0], n_uav),
        value=random.choice([1.0, 2.0, 3.0], n_task),
        service_s=random.choice([0.0, 1.0], n_task),
        success=np.full((n_uav, n_task), 0.5),
        survival=np.ones((n_uav, n_task)),
        horizon_s=9.0,
        acceleration_m_s2=random.choice([0.5, np.inf], n_uav) if seed % 2 else None,
    )


@settings(deadline=None, max_examples=80)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(1, 8))
def test_ties_and_equal_uavs_hide_no_better_sequence(seed: int, n_uav: int, n_task: int) -> None:
    problem = grid_problem(seed, n_uav, n_task)

    found = best_sequence(problem, kernel_rule("greedy"), rng())

    assert found.exhaustive
    assert found.objective == pytest.approx(best_of_all(problem, "greedy"))


def test_each_distinct_first_round_is_evaluated_once() -> None:
    found = best_sequence(table_1(), kernel_rule("greedy"), rng())

    assert found.evaluations == 4  # of six sequences, two pairs of which begin alike


def test_equal_objectives_go_to_the_first_sequence_in_scenario_order() -> None:
    assert best_sequence(table_1(), kernel_rule("greedy"), rng()).sequence == (0, 2, 1)


def test_equal_uavs_need_one_evaluation() -> None:
    problem = random_problem(np.random.default_rng(0), 7, 20)
    equal = Problem(
        uav_ids=problem.uav_ids,
        task_ids=problem.task_ids,
        start_enu_m=np.zeros((7, 3)),
        task_enu_m=problem.task_enu_m,
        speed_m_s=np.full(7, 3.0),
        value=problem.value,
        service_s=problem.service_s,
        success=np.ones((7, 20)),
        survival=np.ones((7, 20)),
        horizon_s=30.0,
    )

    found = best_sequence(equal, kernel_rule("greedy"), rng())

    assert found.exhaustive
    assert (found.sequence, found.evaluations) == (tuple(range(7)), 1)


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_state_on_the_way_is_searched_exhaustively_too(seed: int) -> None:
    random = np.random.default_rng(seed)
    problem = random_problem(random, 4, 9, lowest_survival=0.5)
    state = TeamState.at_start(problem)
    state.free_s[:] = random.choice([1.0, 2.0], 4)
    state.survived[:] = random.uniform(0.2, 1.0, 4)
    state.open[:2] = False
    state.active[int(random.integers(4))] = False
    rule = kernel_rule("greedy")

    found = best_sequence(problem, rule, rng(), state=state)

    values = []
    for sequence in permutations(range(4)):
        routes, completion_s = run(problem, state, rank_of(sequence), rule)
        value = 0.0
        for uav, route in enumerate(routes):
            survived = float(state.survived[uav])
            for task in route:
                left_s = problem.horizon_s - float(completion_s[task])
                value += survived * float(problem.weight[uav, task]) * left_s
                survived *= float(problem.survival[uav, task])
        values.append(value)
    assert found.exhaustive
    assert found.objective == pytest.approx(max(values), abs=1e-9)
    assert not state.active[found.sequence[-1]]


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_local_search_finds_the_best_of_a_small_fleet(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed), 4, 10)

    found = best_sequence(problem, kernel_rule("greedy"), rng(), limits=NO_LISTING)

    assert not found.exhaustive
    assert found.objective == pytest.approx(best_of_all(problem, "greedy"))


def test_local_search_is_repeatable_and_keeps_to_its_evaluations() -> None:
    problem = random_problem(np.random.default_rng(11), 14, 40)

    first, second = (
        best_sequence(
            problem, kernel_rule("greedy"), rng(), after_evaluations(60), limits=NO_LISTING
        )
        for _ in range(2)
    )

    assert first == second
    assert 1 <= first.evaluations <= 60


def test_more_work_never_makes_it_worse() -> None:
    problem = random_problem(np.random.default_rng(12), 14, 40)

    values = [
        best_sequence(
            problem, kernel_rule("greedy"), rng(), after_evaluations(limit), limits=NO_LISTING
        ).objective
        for limit in (1, 20, 100, 300)
    ]

    assert values == sorted(values)


@pytest.mark.parametrize("n_uav", [3, 12])
def test_stopped_at_once_still_gives_a_sequence(n_uav: int) -> None:
    problem = random_problem(np.random.default_rng(1), n_uav, 15)

    found = best_sequence(problem, kernel_rule("greedy"), rng(), lambda _: True)

    assert sorted(found.sequence) == list(range(n_uav))
    assert found.evaluations == 1
    assert not found.exhaustive


def test_no_uav_and_no_task_are_searched_without_complaint() -> None:
    for n_uav, n_task in ((0, 3), (3, 0), (10, 0)):
        problem = random_problem(np.random.default_rng(1), n_uav, n_task)

        found = best_sequence(problem, kernel_rule("greedy"), rng())

        assert found.sequence == tuple(range(n_uav))
        assert found.objective == 0.0


def one_depot_problem(n_uav: int, n_task: int) -> Problem:
    """Different UAVs from one place to tasks in a row: nearly every order begins differently."""
    template = random_problem(np.random.default_rng(6), n_uav, n_task)
    return Problem(
        uav_ids=template.uav_ids,
        task_ids=template.task_ids,
        start_enu_m=np.zeros((n_uav, 3)),
        task_enu_m=template.task_enu_m,
        speed_m_s=template.speed_m_s,
        value=np.array([2.0**i for i in range(n_task)]),
        service_s=template.service_s,
        success=template.success,
        survival=template.survival,
        horizon_s=60.0,
    )


def test_many_first_rounds_are_climbed_and_then_all_tried() -> None:
    problem = one_depot_problem(6, 10)

    found = best_sequence(problem, kernel_rule("greedy"), rng())

    assert found.exhaustive
    assert 200 < found.evaluations <= 720
    assert found.objective == pytest.approx(best_of_all(problem, "greedy"))


def test_stopped_among_many_first_rounds_the_climb_has_paid() -> None:
    problem = one_depot_problem(6, 10)
    rule = kernel_rule("greedy")

    found = best_sequence(problem, rule, rng(), after_evaluations(150))

    assert not found.exhaustive
    best = best_of_all(problem, "greedy")
    assert found.objective >= 0.99 * best


def test_stopped_in_the_first_evaluation_the_lists_are_whole_and_their_end_is_greedy() -> None:
    problem = random_problem(np.random.default_rng(3), 9, 40)

    found = best_sequence(problem, kernel_rule("lookahead"), rng(), lambda _: True)

    assert found.evaluations == 0
    assert not found.exhaustive
    assert sorted(task for route in found.routes for task in route) == list(range(40))
    assert found.objective == pytest.approx(evaluate(problem, found.routes)[0])
    greedy = objective_of(problem, found.sequence, "greedy")
    assert found.objective == pytest.approx(greedy)


@pytest.mark.parametrize("rule", ["greedy", "lookahead"])
def test_lists_are_those_the_sequence_leads_to(rule: str) -> None:
    problem = random_problem(np.random.default_rng(8), 10, 20)

    found = best_sequence(problem, kernel_rule(rule), rng(), after_evaluations(40))

    state = TeamState.at_start(problem)
    routes, _ = run(problem, state, rank_of(found.sequence), kernel_rule(rule))
    assert [list(route) for route in found.routes] == routes
