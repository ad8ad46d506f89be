"""Evaluations are done many at a time: what that must not change, and what it makes possible."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.options import after_evaluations
from coordinator.planner.sequence_search import SearchLimits, SequenceSearch, best_sequence
from swarm.allocation import TeamState, evaluate, rank_of, run
from swarm.allocation.rules import kernel_rule
from tests.support.problems import random_problem

NO_LISTING = SearchLimits(first_rounds=0, first_rounds_large_fleet=0)


def search(rule: str, threads: int, limit: int = 200, n_task: int = 40) -> SequenceSearch:
    return best_sequence(
        random_problem(np.random.default_rng(11), 14, n_task),
        kernel_rule(rule),
        np.random.default_rng(0),
        after_evaluations(limit),
        limits=NO_LISTING,
        threads=threads,
    )


@pytest.mark.parametrize(("rule", "n_task"), [("greedy", 40), ("lookahead", 12)])
def test_threads_change_nothing(rule: str, n_task: int) -> None:
    assert search(rule, 1, n_task=n_task) == search(rule, 3, n_task=n_task)


def test_every_limit_is_kept_to_the_last_evaluation() -> None:
    for limit in (1, 2, 7, 33, 64):
        assert 1 <= search("greedy", 2, limit).evaluations <= limit


def test_objective_is_that_of_the_sequence() -> None:
    problem = random_problem(np.random.default_rng(11), 14, 40)

    found = search("greedy", 2)

    rank = rank_of(found.sequence)
    routes, _ = run(problem, TeamState.at_start(problem), rank, kernel_rule("greedy"))
    assert evaluate(problem, routes)[0] == pytest.approx(found.objective, abs=1e-9)


def test_progress_is_told_and_never_falls() -> None:
    told: list[tuple[int, float]] = []

    found = best_sequence(
        random_problem(np.random.default_rng(11), 14, 40),
        kernel_rule("greedy"),
        np.random.default_rng(0),
        after_evaluations(200),
        limits=NO_LISTING,
        progress=lambda evaluations, best: told.append((evaluations, best)),
    )

    assert told == sorted(told)
    assert told[-1] == (found.evaluations, found.objective)


def test_ctrl_c_gives_the_best_so_far() -> None:
    told: list[float] = []

    def interrupt(evaluations: int, best: float) -> None:
        told.append(best)
        if evaluations > 50:
            raise KeyboardInterrupt

    found = best_sequence(
        random_problem(np.random.default_rng(11), 14, 40),
        kernel_rule("greedy"),
        np.random.default_rng(0),
        limits=NO_LISTING,
        progress=interrupt,
    )

    assert not found.exhaustive
    assert found.objective == told[-1]
    assert sorted(found.sequence) == list(range(14))


def test_ctrl_c_before_anything_is_known_is_passed_on() -> None:
    def interrupt(evaluations: float) -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        best_sequence(
            random_problem(np.random.default_rng(11), 14, 40),
            kernel_rule("greedy"),
            np.random.default_rng(0),
            interrupt,
        )
