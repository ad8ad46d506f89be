from __future__ import annotations

from itertools import permutations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import Problem, TeamState, rank_of, rule_by_name
from tests.support.problems import line_of_tasks, random_problem, with_acceleration


def lookahead_choice(problem: Problem) -> int:
    """First task of the best tour of the only UAV, by trying all tours."""
    best, choice = -np.inf, -1
    for tour in permutations(range(problem.n_task)):
        free_s, survived, place, value = 0.0, 1.0, problem.start_enu_m[0], 0.0
        for task in tour:
            free_s += float(problem.travel_s(0, place)[task]) + float(problem.service_s[task])
            value += survived * float(problem.weight[0, task]) * (problem.horizon_s - free_s)
            survived *= float(problem.survival[0, task])
            place = problem.task_enu_m[task]
        if value > best:
            best, choice = value, tour[0]
    return choice


def certified(problem: Problem) -> tuple[bool, int]:
    decision = rule_by_name("greedy").decide(problem, TeamState.at_start(problem), rank_of([0]), 0)
    assert decision is not None
    return decision.certificate, decision.task


@settings(deadline=None, max_examples=150)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_task=st.integers(1, 5),
    highest=st.floats(0.0, 0.6),
    horizon_s=st.sampled_from([1.0, 3.0, 8.0, 50.0]),
    accelerates=st.booleans(),
)
def test_certified_greedy_choice_is_the_lookahead_choice(
    seed: int, n_task: int, highest: float, horizon_s: float, accelerates: bool
) -> None:
    problem = random_problem(
        np.random.default_rng(seed),
        1,
        n_task,
        lowest_survival=0.0,
        highest_survival=highest,
        horizon_s=horizon_s,
    )
    if accelerates:
        problem = with_acceleration(problem, seed)

    certificate, task = certified(problem)

    if certificate:
        assert task == lookahead_choice(problem)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), highest=st.floats(0.0, 0.6))
def test_both_rules_claim_the_same(seed: int, highest: float) -> None:
    problem = random_problem(
        np.random.default_rng(seed), 1, 5, lowest_survival=0.0, highest_survival=highest
    )
    state = TeamState.at_start(problem)
    greedy, lookahead = (
        rule_by_name(name).decide(problem, state, rank_of([0]), 0)
        for name in ("greedy", "lookahead")
    )

    assert greedy is not None
    assert lookahead is not None
    assert greedy.certificate == lookahead.certificate
    if greedy.certificate:
        assert greedy.task == lookahead.task


def test_the_bound_is_where_the_theorem_puts_it() -> None:
    # λ = 1/2, so (1 − λ)/(2 − λ) = 1/3
    assert certified(line_of_tasks([2.0, 1.0], horizon_s=100.0, survival=0.333))[0]
    assert not certified(line_of_tasks([2.0, 1.0], horizon_s=100.0, survival=0.334))[0]


def test_certain_survival_proves_nothing() -> None:
    assert not certified(line_of_tasks([9.0, 1.0], horizon_s=100.0, survival=1.0))[0]


def test_single_task_is_always_agreed_on() -> None:
    assert certified(line_of_tasks([1.0], horizon_s=5.0, survival=1.0))[0]


def test_worthless_best_task_proves_nothing() -> None:
    assert not certified(line_of_tasks([0.0, 0.0], horizon_s=100.0, survival=0.1))[0]
    assert not certified(line_of_tasks([2.0, 1.0], horizon_s=9.0, survival=0.1))[0]


def test_late_rest_of_the_tour_proves_nothing() -> None:
    # both score well alone, but whichever comes second comes 18 s after the horizon
    assert not certified(line_of_tasks([2.0, 1.0], horizon_s=12.0, survival=0.1))[0]


def test_late_rest_can_indeed_turn_the_choice() -> None:
    # greedy takes the better first task; flying the heavy one late costs lookahead more
    problem = line_of_tasks([1.0, 1.01, 1.5], horizon_s=10.5, survival=0.2)

    certificate, task = certified(problem)

    assert not certificate or task == lookahead_choice(problem)
