"""No plan of the field's problem is better than its bound."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.field_bound import FieldBound, field_bound
from coordinator.planner.field_exact import field_optimum_before
from coordinator.planner.options import after_evaluations
from swarm.allocation.field import FieldProblem
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.seeds import sweeps


def problem_of(seed: int, kind: str, n_uavs: int = 2, n_tasks: int = 5) -> FieldProblem:
    return FieldProblem.from_mission(
        mission_of(made_up(seed, kind, n_uavs, n_tasks)).known_at_start()
    )


def trivial(problem: FieldProblem) -> FieldBound:
    return field_bound(problem, lambda _: True)


@pytest.mark.parametrize("sweep", sweeps(4, 30))
@pytest.mark.parametrize("kind", KINDS)
def test_no_optimum_is_above_its_bound(kind: str, sweep: range) -> None:
    for seed in sweep:
        problem = problem_of(seed, kind, 2 + seed % 2)
        best = field_optimum_before(problem, None)
        assert best is not None
        assert best.proven
        loose, bound = trivial(problem), field_bound(problem, after_evaluations(40))
        assert bound.fewest_left_out == loose.fewest_left_out <= best.n_left_out
        assert best.objective <= bound.objective <= loose.objective, (kind, seed)


def test_bound_is_close_where_batteries_are_endless() -> None:
    shares, loose_shares = [], []
    for seed in range(10):
        problem = problem_of(seed, "windows", 3, 7)
        best = field_optimum_before(problem, None)
        assert best is not None
        shares.append(best.objective / field_bound(problem, after_evaluations(80)).objective)
        loose_shares.append(best.objective / trivial(problem).objective)
    assert np.mean(shares) > 0.98
    assert np.mean(shares) > np.mean(loose_shares)


def test_it_only_ever_falls_and_every_fall_is_told() -> None:
    problem = problem_of(2, "all", 3, 8)
    told: list[float] = []

    bound = field_bound(problem, after_evaluations(40), progress=told.append)

    assert len(told) > 1
    assert told == sorted(set(told), reverse=True)
    assert told[0] < trivial(problem).objective
    assert told[-1] == bound.objective


def test_large_networks_are_bounded_without_looking_for_shorter_ways(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("coordinator.planner.field_bound._MOST_NODES", 3)
    for seed in range(4):
        problem = problem_of(seed, "all")
        best = field_optimum_before(problem, None)
        assert best is not None
        assert best.objective <= field_bound(problem, after_evaluations(20)).objective
