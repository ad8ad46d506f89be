from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import (
    Problem,
    TeamState,
    decisions,
    evaluate,
    next_decision,
    rank_of,
    rule_by_name,
    run,
)
from swarm.allocation.lower_level import Decision, Rule
from swarm.allocation.problem import FloatArray, IntArray
from tests.support import reference
from tests.support.problems import any_problem, random_problem, table_1

SEEDS = st.integers(0, 2**32 - 1)


@settings(deadline=None)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(0, 8))
def test_greedy_lists_equal_the_definition(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    sequence = np.random.default_rng(seed).permutation(n_uav).tolist()

    routes, _ = run(problem, TeamState.at_start(problem), rank_of(sequence), rule_by_name("greedy"))

    assert routes == reference.lists(problem, sequence, "greedy")


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(1, 3), n_task=st.integers(0, 5))
def test_lookahead_lists_equal_the_definition(seed: int, n_uav: int, n_task: int) -> None:
    problem = any_problem(seed, n_uav, n_task)
    sequence = np.random.default_rng(seed).permutation(n_uav).tolist()

    routes, _ = run(
        problem, TeamState.at_start(problem), rank_of(sequence), rule_by_name("lookahead")
    )

    assert routes == reference.lists(problem, sequence, "lookahead")


@settings(deadline=None)
@given(seed=SEEDS, n_task=st.integers(0, 12), name=st.sampled_from(["greedy", "lookahead"]))
def test_decisions_complete_at_the_very_times_their_lists_do(
    seed: int, n_task: int, name: str
) -> None:
    problem = any_problem(seed, 3, n_task)

    routes, completion_s = run(
        problem, TeamState.at_start(problem), rank_of([2, 0, 1]), rule_by_name(name)
    )

    assert np.array_equal(completion_s, evaluate(problem, routes)[1], equal_nan=True)


@given(seed=SEEDS, n_task=st.integers(1, 10))
def test_deciding_one_by_one_from_the_state_equals_the_run(seed: int, n_task: int) -> None:
    problem = any_problem(seed, 3, n_task)
    rank, rule, state = rank_of([1, 2, 0]), rule_by_name("greedy"), TeamState.at_start(problem)

    for decision in decisions(problem, TeamState.at_start(problem), rank, rule):
        assert decision.decided_s == state.free_s[decision.uav]
        assert next_decision(problem, state, rank, rule, decision.uav) == decision
        state.apply(problem, decision)

    assert not (problem.capable & state.open).any()


def test_the_state_passed_in_is_left_alone() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)

    run(problem, state, rank_of([0, 1, 2]), rule_by_name("greedy"))

    assert state.open.all()
    assert not state.free_s.any()


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(0, 8))
def test_it_ends_with_the_turn_of_the_last_uav_asked_about(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    state, rank = TeamState.at_start(problem), np.arange(n_uav)
    everything = list(decisions(problem, state, rank, rule_by_name("greedy")))

    for uav in range(n_uav):
        rule = _Asked(rule_by_name("greedy"))
        until = list(decisions(problem, state, rank, rule, last=uav))

        own = [k for k, decision in enumerate(everything) if decision.uav == uav]
        assert until == everything[: own[0] + 1 if own else len(until)]
        assert rule.uavs[-1:] == [uav]
        assert rule.uavs.count(uav) == 1


class _Asked:
    """A rule that notes whom it was asked about."""

    def __init__(self, rule: Rule) -> None:
        self._rule = rule
        self.name = rule.name
        self.uavs: list[int] = []

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        self.uavs.append(uav)
        return self._rule.decide(problem, state, rank, uav)


def test_equal_times_are_ordered_by_the_sequence() -> None:
    problem = table_1()

    def first_deciders(sequence: list[int]) -> list[int]:
        state = TeamState.at_start(problem)
        found = decisions(problem, state, rank_of(sequence), rule_by_name("greedy"))
        return [decision.uav for decision in found][:3]

    assert first_deciders([2, 0, 1]) == [2, 0, 1]
    assert first_deciders([1, 2, 0]) == [1, 2, 0]


def test_equal_ranks_are_ordered_by_index() -> None:
    problem = table_1()
    rank = np.zeros(3, dtype=np.int64)

    found = decisions(problem, TeamState.at_start(problem), rank, rule_by_name("greedy"))

    assert [decision.uav for decision in found][:3] == [0, 1, 2]


def test_earliest_free_uav_decides_next_whatever_its_rank() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    state.free_s[:] = [0.3, 0.2, 0.1]

    found = decisions(problem, state, rank_of([0, 1, 2]), rule_by_name("greedy"))

    assert [decision.uav for decision in found][:3] == [2, 1, 0]


def test_inactive_uavs_and_closed_tasks_stay_out() -> None:
    problem = table_1()
    state = TeamState.at_start(problem)
    state.active[1] = False
    state.open[:3] = False
    rule = rule_by_name("greedy")

    routes, completion_s = run(problem, state, rank_of([0, 1, 2]), rule)

    assert routes[1] == []
    assert sorted(routes[0] + routes[2]) == [3, 4, 5, 6, 7]
    assert np.isnan(completion_s[:3]).all()
    assert next_decision(problem, state, rank_of([0, 1, 2]), rule, 1) is None


def test_uav_with_nothing_it_is_capable_of_leaves_the_rest_to_others() -> None:
    capable = random_problem(np.random.default_rng(1), 2, 4)
    success = capable.success.copy()
    success[0] = [0.0, 0.0, 0.0, 0.9]
    problem = problem_with(capable, success)

    routes, _ = run(
        problem, TeamState.at_start(problem), rank_of([0, 1]), rule_by_name("lookahead")
    )

    assert routes[0] == [3]
    assert sorted(routes[1]) == [0, 1, 2]


def problem_with(problem: Problem, success: FloatArray) -> Problem:
    names = ("uav_ids", "task_ids", "start_enu_m", "task_enu_m", "speed_m_s", "value")
    given_: dict[str, Any] = {n: getattr(problem, n) for n in (*names, "service_s", "survival")}
    return Problem(**given_, success=success, horizon_s=problem.horizon_s)


def test_wrong_sequence_is_refused() -> None:
    for sequence in ([0, 0], [1, 2], [-1, 0]):
        with pytest.raises(ValueError, match="sequence"):
            rank_of(sequence)


def test_state_of_mixed_shapes_is_refused() -> None:
    state = TeamState.at_start(table_1())

    with pytest.raises(ValueError, match="survived"):
        replace(state, survived=np.ones(2))
