from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import Decision, Problem, TeamState, rank_of, rule_by_name
from swarm.kernels.lower_level import EXACT_TASKS
from tests.support.problems import any_problem, line_of_tasks, random_problem, table_1

SEEDS = st.integers(0, 2**32 - 1)


def first_decision(problem: Problem, name: str, uav: int = 0) -> Decision:
    rank = rank_of(range(problem.n_uav))
    decision = rule_by_name(name).decide(problem, TeamState.at_start(problem), rank, uav)
    assert decision is not None
    return decision


@pytest.mark.parametrize("name", ["greedy", "lookahead"])
def test_equal_scores_go_to_the_smaller_index(name: str) -> None:
    assert first_decision(line_of_tasks([1.0, 1.0]), name).task == 0


def test_greedy_takes_late_tasks_too() -> None:
    decision = first_decision(line_of_tasks([2.0, 1.0], horizon_s=5.0), "greedy")

    assert (decision.task, decision.score, decision.second_score) == (1, -5.0, -10.0)


def test_scores_are_worth_and_second_best_worth() -> None:
    decision = first_decision(line_of_tasks([3.0, 2.0]), "greedy")

    assert (decision.score, decision.second_score) == (270.0, 180.0)
    assert (decision.decided_s, decision.completion_s) == (0.0, 10.0)
    assert decision.exact


def test_lookahead_scores_are_those_of_whole_tours() -> None:
    decision = first_decision(line_of_tasks([3.0, 2.0]), "lookahead")

    assert (decision.score, decision.second_score) == (270.0 + 140.0, 180.0 + 210.0)
    assert decision.exact


@pytest.mark.parametrize("name", ["greedy", "lookahead"])
def test_last_task_has_no_second(name: str) -> None:
    decision = first_decision(line_of_tasks([3.0]), name)

    assert decision.second_score is None
    assert decision.certificate
    assert decision.exact


@given(seed=SEEDS, n_task=st.integers(2, 12), name=st.sampled_from(["greedy", "lookahead"]))
@settings(deadline=None)
def test_worth_scales_with_the_chance_to_be_still_there(seed: int, n_task: int, name: str) -> None:
    problem = any_problem(seed, 2, n_task)
    rule, rank = rule_by_name(name), rank_of([0, 1])
    sure, unsure = TeamState.at_start(problem), TeamState.at_start(problem)
    unsure.survived[:] = 0.5

    for uav in (0, 1):
        one, half = (rule.decide(problem, state, rank, uav) for state in (sure, unsure))
        if one is None or half is None:
            assert one is half
            continue
        assert half.task == one.task
        assert half.score == pytest.approx(0.5 * one.score)


@given(seed=SEEDS)
@settings(deadline=None, max_examples=25)
def test_lookahead_does_not_depend_on_what_was_asked_before(seed: int) -> None:
    problem = any_problem(seed, 2, 9)
    rng = np.random.default_rng(seed)
    used, rank = rule_by_name("lookahead"), rank_of([0, 1])
    for _ in range(6):
        state = TeamState.at_start(problem)
        state.open[:] = rng.uniform(size=9) < 0.6
        state.place_enu_m[:] = rng.uniform(0.0, 10.0, (2, 3))
        state.free_s[:] = rng.uniform(0.0, 3.0, 2)

        fresh = rule_by_name("lookahead")

        assert used.decide(problem, state, rank, 1) == fresh.decide(problem, state, rank, 1)


def test_lookahead_says_where_it_stops_being_exact() -> None:
    rng = np.random.default_rng(5)

    assert first_decision(random_problem(rng, 1, EXACT_TASKS), "lookahead").exact
    assert not first_decision(random_problem(rng, 1, EXACT_TASKS + 1), "lookahead").exact


def test_lookahead_over_many_tasks_respects_capability() -> None:
    problem = random_problem(np.random.default_rng(8), 2, 30, incapable_frac=0.4)

    for uav in (0, 1):
        assert problem.capable[uav, first_decision(problem, "lookahead", uav).task]


def test_lookahead_over_many_deadly_tasks_is_proven_by_the_certificate() -> None:
    problem = random_problem(
        np.random.default_rng(2), 1, 20, lowest_survival=0.0, highest_survival=0.0, horizon_s=30.0
    )

    decision = first_decision(problem, "lookahead")

    assert decision.certificate
    assert decision.exact
    assert decision.task == first_decision(problem, "greedy").task


def test_unknown_rule_is_refused() -> None:
    with pytest.raises(ValueError, match="guided"):
        rule_by_name("guided")


def test_nothing_open_gives_no_decision() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    state.open[:] = False

    for name in ("greedy", "lookahead"):
        assert rule_by_name(name).decide(problem, state, rank_of([0, 1, 2]), 0) is None
