from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm.allocation import Problem, TeamState, evaluate, run
from swarm.allocation.lower_level import Decision, decisions
from swarm.allocation.problem import IntArray
from swarm.allocation.rules import GuidedRule, team_arrays, team_at_start
from swarm.kernels.rollout import count_idle, guided_choice
from swarm.kernels.routes import ListArrays, optimise_routes
from tests.support.problems import any_problem, random_problem
from tests.support.reference import repaired, team_worth

SEEDS = st.integers(0, 2**32 - 1)


def any_lists(problem: Problem, rng: np.random.Generator, left_out: float = 0.0) -> list[list[int]]:
    lists: list[list[int]] = [[] for _ in range(problem.n_uav)]
    for task in rng.permutation(problem.n_task):
        able = np.flatnonzero(problem.capable[:, task])
        if len(able) and rng.uniform() >= left_out:
            lists[rng.choice(able)].append(int(task))
    return lists


def rule_of(problem: Problem, lists: list[list[int]], **options: Any) -> GuidedRule:
    by_id: dict[str, list[str]] = {
        uav: [problem.task_ids[task] for task in route]
        for uav, route in zip(problem.uav_ids, lists, strict=True)
    }
    return GuidedRule(by_id, **options)


@settings(deadline=None, max_examples=80)
@given(seed=SEEDS, n_uav=st.integers(1, 5), n_task=st.integers(0, 15))
def test_undisturbed_the_executed_lists_are_worth_no_less_than_the_published(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    lists = any_lists(problem, np.random.default_rng(seed))

    routes, _ = run(problem, TeamState.at_start(problem), np.arange(n_uav), rule_of(problem, lists))

    assert sorted(t for r in routes for t in r) == sorted(t for r in lists for t in r)
    planned = evaluate(problem, lists)[0]
    assert evaluate(problem, routes)[0] >= planned - 1e-8 * (1.0 + abs(planned))


@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_lists_without_a_gaining_move_are_kept_to_the_letter(seed: int) -> None:
    problem = random_problem(np.random.default_rng(seed), 4, 25, horizon_s=30.0)
    lists, _ = optimise_routes(team_at_start(problem), iterations=500)

    routes, _ = run(problem, TeamState.at_start(problem), np.arange(4), rule_of(problem, lists))

    assert routes == lists


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(1, 4), n_task=st.integers(1, 12))
def test_a_choice_is_worth_what_the_whole_team_then_flies(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    lists = any_lists(problem, np.random.default_rng(seed))
    state = TeamState.at_start(problem)
    team = team_arrays(problem, state, state.active, 0.0)

    choice = guided_choice(team, lists, 0)

    planned = lists[0][0] if lists[0] else None
    assert choice.planned == planned
    before = team_worth(problem, state, lists)
    moved = [[t for t in route if t != choice.task] for route in lists]
    if choice.task is not None:
        moved[0].insert(0, choice.task)
    scale = 1.0 + abs(before)
    assert abs(team_worth(problem, state, moved) - choice.worth) <= 1e-9 * scale
    assert choice.worth >= before - 1e-9 * scale
    if choice.task != planned:
        assert choice.worth > before
    values = choice.valued if choice.task is None else choice.valued[1:]
    assert choice.valued[:1] == ((choice.task, choice.worth),) or choice.task is None
    assert list(values) == sorted(values, key=lambda value: -value[1])
    assert choice.second_worth == (values[0][1] if values else None)
    for task, worth in choice.valued:
        first = [[t for t in route if t != task] for route in lists]
        first[0].insert(0, task)
        assert abs(team_worth(problem, state, first) - worth) <= 1e-9 * scale


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(2, 5), n_task=st.integers(1, 15))
def test_after_a_loss_and_pop_ups_every_task_is_still_done(
    seed: int, n_uav: int, n_task: int
) -> None:
    problem = any_problem(seed, n_uav, n_task)
    rng = np.random.default_rng(seed)
    lists = any_lists(problem, rng, left_out=0.3)
    state = TeamState.at_start(problem)
    state.active[rng.integers(n_uav)] = False
    state.free_s[:] = rng.uniform(0.0, 3.0, n_uav)

    routes, _ = run(problem, state, np.arange(n_uav), rule_of(problem, lists, repair_iterations=20))

    able = (problem.capable & state.active[:, None]).any(axis=0)
    done = sorted(t for route in routes for t in route)
    # a task that only UAVs can do that went home early may stay, but only then
    assert set(done) <= set(np.flatnonzero(able).tolist())
    everybody = problem.capable[state.active].all(axis=0)
    assert set(np.flatnonzero(able & everybody).tolist()) <= set(done)


@settings(deadline=None, max_examples=25)
@given(seed=SEEDS, n_task=st.sampled_from((12, 40, 151, 180)), lowest=st.sampled_from((0.8, 1.0)))
def test_lists_are_repaired_as_defined_and_searching_makes_them_no_worse(
    seed: int, n_task: int, lowest: float
) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 9, n_task, lowest_survival=lowest, horizon_s=60.0)
    lists = any_lists(problem, rng, left_out=0.15)
    state = TeamState.at_start(problem)
    state.active[8] = False
    lists[8] = []
    uav = int(rng.integers(8))
    team = team_arrays(problem, state, state.active, 0.0)
    defined = repaired(problem, state, lists)
    worth = team_worth(problem, state, defined)

    choice = guided_choice(team, lists, uav)
    searched = guided_choice(team, lists, uav, iterations=30)

    assert choice.planned == (defined[uav][0] if defined[uav] else None)
    if choice.planned is not None:
        assert dict(choice.valued)[choice.planned] == pytest.approx(worth, rel=1e-9)
    assert searched.worth >= worth - 1e-9 * (1.0 + abs(worth))


@pytest.mark.parametrize(("n_uav", "n_task"), [(6, 30), (12, 200)])
def test_every_replica_decides_alike(n_uav: int, n_task: int) -> None:
    problem = random_problem(np.random.default_rng(4), n_uav, n_task, horizon_s=30.0)
    lists = any_lists(problem, np.random.default_rng(4), left_out=0.3)
    state = TeamState.at_start(problem)
    rank = np.arange(n_uav)
    used, fresh = rule_of(problem, lists), rule_of(problem, lists)
    used.decide(problem, state, rank, 3)

    a, b = (rule.decide(problem, state, rank, 0) for rule in (used, fresh))

    assert isinstance(a, Decision)
    assert a == b


@settings(deadline=None, max_examples=40)
@given(seed=SEEDS, iterations=st.sampled_from([0, 20]))
def test_lists_kept_as_arrays_are_decided_by_alike(seed: int, iterations: int) -> None:
    problem = any_problem(seed, 3, 9)
    lists = any_lists(problem, np.random.default_rng(seed), left_out=0.2)
    team = team_at_start(problem)
    arrays = ListArrays.of(lists, 3, 9)

    for uav in range(3):
        found = [guided_choice(team, each, uav, iterations=iterations) for each in (lists, arrays)]
        assert found[0] == found[1]


def test_a_uav_free_at_an_unknown_time_does_not_spoil_the_numbers() -> None:
    problem = random_problem(np.random.default_rng(4), 3, 12, horizon_s=30.0)
    lists = any_lists(problem, np.random.default_rng(4))
    state = TeamState.at_start(problem)
    state.free_s[:] = (1.0, np.inf, 2.0)

    decision = rule_of(problem, lists).decide(problem, state, np.arange(3), 0)

    assert decision is not None
    assert np.isfinite(decision.score)


def test_nothing_open_needs_no_decision() -> None:
    problem = random_problem(np.random.default_rng(4), 3, 12, horizon_s=30.0)
    state = TeamState.at_start(problem)
    state.open[:] = False

    assert rule_of(problem, [[], [], []]).decide(problem, state, np.arange(3), 0) is None


def test_a_wrong_call_is_refused() -> None:
    problem = random_problem(np.random.default_rng(4), 2, 3, horizon_s=30.0)
    state = TeamState.at_start(problem)
    state.active[1] = False
    team = team_arrays(problem, state, state.active, 0.0)

    for uav in (-1, 1, 2):
        with pytest.raises(ValueError, match="uav"):
            guided_choice(team, [[], []], uav)
    with pytest.raises(ValueError, match="iterations"):
        guided_choice(team, [[], []], 0, iterations=-1)
    with pytest.raises(ValueError, match="lists"):
        guided_choice(team, [[]], 0)


class AskedOneByOne:
    """A rule whose idle UAVs are not passed over."""

    def __init__(self, rule: GuidedRule) -> None:
        self.name = rule.name
        self._rule = rule
        self.asked = 0

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        self.asked += 1
        return self._rule.decide(problem, state, rank, uav)


class PassedOver(AskedOneByOne):
    def count_idle(
        self, problem: Problem, state: TeamState, rank: IntArray, uavs: Sequence[int]
    ) -> int:
        return self._rule.count_idle(problem, state, rank, uavs)


@settings(deadline=None, max_examples=60)
@given(
    seed=SEEDS,
    n_uav=st.integers(2, 25),
    n_task=st.sampled_from((1, 5, 30, 160)),
    last=st.none() | st.integers(0, 24),
)
def test_idle_uavs_are_passed_over_exactly_where_they_would_take_nothing(
    seed: int, n_uav: int, n_task: int, last: int | None
) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, n_uav, n_task, lowest_survival=rng.choice((0.8, 1.0)))
    lists = any_lists(problem, rng, left_out=0.5)
    lists[n_uav // 2 :] = [[] for _ in lists[n_uav // 2 :]]
    state, rank = TeamState.at_start(problem), rng.permutation(n_uav)
    state.open &= rng.uniform(size=n_task) < rng.uniform()
    state.active &= rng.uniform(size=n_uav) < 0.9
    state.free_s[:] = np.where(rng.uniform(size=n_uav) < 0.6, 1.0, rng.uniform(1.0, 3.0, n_uav))
    one_by_one, passed_over = (
        kind(rule_of(problem, lists, repair_iterations=20)) for kind in (AskedOneByOne, PassedOver)
    )

    expected = list(decisions(problem, state, rank, one_by_one, last))

    assert list(decisions(problem, state, rank, passed_over, last)) == expected
    assert passed_over.asked <= one_by_one.asked


def test_of_many_idle_uavs_only_those_that_may_take_something_are_asked() -> None:
    rng = np.random.default_rng(7)
    problem = random_problem(rng, 40, 12, horizon_s=30.0)
    lists = [list(range(12)), *([] for _ in range(39))]
    state = TeamState.at_start(problem)
    state.open[:] = np.arange(12) == 3
    state.place_enu_m[0] = problem.task_enu_m[3]
    state.place_enu_m[1:] += 1000.0  # too far for anything before the end
    rule = PassedOver(rule_of(problem, lists))

    taken = list(decisions(problem, state, np.arange(40)[::-1], rule))

    assert [(each.uav, each.task) for each in taken] == [(0, 3)]
    assert rule.asked == 13  # the last twelve, one of which takes it, and is asked once more


@settings(deadline=None, max_examples=60)
@given(seed=SEEDS, n_uav=st.integers(10, 16), n_task=st.integers(1, 15))
def test_a_uav_idles_if_no_task_is_worth_more_as_its_only_one(
    seed: int, n_uav: int, n_task: int
) -> None:
    rng = np.random.default_rng(seed)
    problem = any_problem(seed, n_uav, n_task)
    lists = any_lists(problem, rng, left_out=0.3)
    lists[0] = []
    state = TeamState.at_start(problem)
    state.open &= rng.uniform(size=n_task) < 0.7
    team = team_arrays(problem, state, state.active, 0.0)
    kept = [[task for task in route if state.open[task]] for route in lists]
    placed = repaired(problem, state, kept)
    worth = team_worth(problem, state, placed)
    moved = []
    for task in np.flatnonzero(state.open & problem.capable[0]):
        others = [[t for t in route if t != task] for route in placed[1:]]
        moved.append(team_worth(problem, state, [[int(task)], *others]))

    idles = not placed[0] and max(moved, default=worth) <= worth + 1e-9 * abs(worth)
    idles &= n_uav > 12

    assert count_idle(team, lists, [0]) == idles


def test_those_asked_must_take_part() -> None:
    problem = random_problem(np.random.default_rng(1), 3, 4)
    state = TeamState.at_start(problem)
    state.active[1] = False
    team = team_arrays(problem, state, state.active, 0.0)
    for uavs in ([1], [0, 3], [-1]):
        with pytest.raises(ValueError, match="uavs must be indices of active UAVs"):
            count_idle(team, [[], [], []], uavs)
