"""Rules that rank the open tasks, wherever a method can be named."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.plan import METHODS, ONLINE_METHODS, make_plan
from coordinator.planner.sequence_search import search_sequence
from swarm.allocation import TeamState, evaluate, rank_of, rule_by_name, run
from swarm.allocation.index_rules import INDEX_RULES, NEAREST, VALUE_PER_TIME
from swarm.allocation.rules import kernel_rule
from swarm.runtime.clock import SystemClock
from swarm.scenario import load_scenario, resolve_scenario
from tests.support.problems import random_problem, table_1

EVERY = pytest.mark.parametrize("name", INDEX_RULES)


def test_nearest_takes_the_task_that_is_reached_soonest() -> None:
    problem = random_problem(np.random.default_rng(3), 2, 6)
    decision = NEAREST.decide(problem, TeamState.at_start(problem), np.array([0, 1]), 1)

    assert decision is not None
    assert decision.task == int(np.argmin(problem.travel_s(1, problem.start_enu_m[1])))


@EVERY
def test_a_rule_is_known_by_its_name_and_is_a_method(name: str) -> None:
    assert rule_by_name(name) is INDEX_RULES[name]
    assert name in ONLINE_METHODS
    assert name in METHODS
    with pytest.raises(ValueError, match="greedy, lookahead"):
        kernel_rule(name)


@EVERY
def test_scores_begin_with_the_task_that_is_taken(name: str) -> None:
    rule = INDEX_RULES[name]
    for seed in range(20):
        problem = random_problem(np.random.default_rng(seed), 3, 7, incapable_frac=0.3)
        state = TeamState.at_start(problem)
        decision = rule.decide(problem, state, np.arange(3), 0)
        scored = rule.valued(problem, state, 0, 4)
        assert (decision is None) == (scored == ())
        if decision is not None:
            assert scored[0] == (decision.task, decision.score)
            assert [score for _, score in scored] == sorted((s for _, s in scored), reverse=True)


@EVERY
def test_a_plan_by_it_is_the_best_of_all_orders_of_few_uavs(name: str) -> None:
    problem, mission = table_1(), load_scenario(resolve_scenario("table-1"))
    plan = make_plan(mission, name, clock=SystemClock())

    by_order = {}
    for order in ((a, b, 3 - a - b) for a in range(3) for b in range(3) if a != b):
        routes, _ = run(problem, TeamState.at_start(problem), rank_of(order), INDEX_RULES[name])
        by_order[order] = evaluate(problem, routes)[0]
    assert plan.objective == max(by_order.values())
    assert plan.evaluations == 6


def test_many_uavs_get_the_best_order_of_those_tried() -> None:
    problem = random_problem(np.random.default_rng(1), 8, 20)
    found = search_sequence(problem, VALUE_PER_TIME, np.random.default_rng(0))
    own, _ = run(problem, TeamState.at_start(problem), np.arange(8), VALUE_PER_TIME)

    assert not found.exhaustive
    assert found.objective >= evaluate(problem, own)[0]
    assert found.objective == evaluate(problem, found.routes)[0]
    stopped = search_sequence(
        problem, VALUE_PER_TIME, np.random.default_rng(0), lambda spent: spent > 3
    )
    assert stopped.evaluations == 3
