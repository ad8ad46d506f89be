"""Lookahead in the field: the own best list, exactly for few tasks, well for many."""

from __future__ import annotations

import random

import pytest

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels import field
from swarm.kernels.field import FIELD_GREEDY, FIELD_LOOKAHEAD, FieldRuleCode
from tests.support.field_missions import mission_of
from tests.support.field_oracle.brute import best_plan
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.field_oracle.scenario import read
from tests.support.seeds import sweeps

ARCS_IN_WIND = 1e-3
"""The oracle flies arcs in straight pieces of half a degree."""


def problem_of(seed: int, kind: str, n_uavs: int, n_tasks: int) -> FieldProblem:
    draft = made_up(seed, kind, n_uavs, n_tasks)
    return FieldProblem.from_mission(mission_of(draft).known_at_start())


def worth(problem: FieldProblem, rule: FieldRuleCode) -> tuple[int, float]:
    """Required tasks left out, and J, of lists that can be flown."""
    state = FieldState.at_start(problem)
    lists = field.run_rule(problem.kernel, state, rule).lists(problem.n_uav)
    flown = field.fly_lists(problem.kernel, state, lists)
    assert flown.feasible
    assert all(items[-1] >= 0 for items in lists if items)
    done = {item // 2 for items in lists for item in items if item >= 0}
    left_out = [
        task for task in range(problem.n_task) if problem.required[task] and task not in done
    ]
    return len(left_out), float(flown.value.sum())


@pytest.mark.parametrize("sweep", sweeps(4, 30))
@pytest.mark.parametrize("kind", KINDS)
def test_alone_it_finds_the_optimum(kind: str, sweep: range) -> None:
    close = ARCS_IN_WIND if kind == "all" else 1e-8
    for seed in sweep:
        problem = problem_of(seed, kind, n_uavs=1, n_tasks=4)
        optimum = best_plan(read(made_up(seed, kind, 1, 4)))
        step = field.decide(problem.kernel, FieldState.at_start(problem), 0, FIELD_LOOKAHEAD)

        n_left_out, value = worth(problem, FIELD_LOOKAHEAD)

        assert n_left_out == optimum.n_left_out
        assert value == pytest.approx(optimum.objective, rel=close, abs=close)
        if step is not None:
            assert step.score == pytest.approx(value, rel=close, abs=close)


@pytest.mark.parametrize("kind", ["slots", "energy", "windows", "lines", "all"])
def test_its_lists_can_be_flown_by_a_team(kind: str) -> None:
    better = 0
    for seed in range(10):
        problem = problem_of(seed, kind, n_uavs=3, n_tasks=6)
        greedy, lookahead = worth(problem, FIELD_GREEDY), worth(problem, FIELD_LOOKAHEAD)
        better += (lookahead[0], -lookahead[1]) <= (greedy[0], -greedy[1])
    assert better >= 5


def test_of_many_tasks_it_makes_no_less_than_greedy() -> None:
    for seed in range(8):
        problem = problem_of(seed, "acceleration", n_uavs=1, n_tasks=14)
        state = FieldState.at_start(problem)

        step = field.decide(problem.kernel, state, 0, FIELD_LOOKAHEAD)

        assert step is not None
        assert step.score is not None
        assert step.score >= worth(problem, FIELD_GREEDY)[1]


def test_a_base_without_a_slot_in_time_is_not_flown_to() -> None:
    """Another UAV stands there for good."""
    for seed in range(10):
        problem = problem_of(seed, "slots", n_uavs=2, n_tasks=4)
        state = FieldState.at_start(problem)
        state.landed_at[1] = 0
        state.active[1] = False

        step = field.decide(problem.kernel, state, 0, FIELD_LOOKAHEAD)

        assert step is None or step.item >= 0


def test_both_rules_decide_as_in_a_run() -> None:
    rng = random.Random(1)
    for rule in (FIELD_GREEDY, FIELD_LOOKAHEAD):
        for seed in range(10):
            problem = problem_of(seed, rng.choice(KINDS), n_uavs=1, n_tasks=5)
            state = FieldState.at_start(problem)
            step = field.decide(problem.kernel, state, 0, rule)
            runs = field.run_rule(problem.kernel, state, rule)

            assert (step is None) == (len(runs.items) == 0)
            if step is not None:
                assert step.item == runs.items[0]
                assert list(step[1:5]) == runs.times_s[0].tolist()
