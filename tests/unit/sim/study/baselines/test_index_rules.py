from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim.study.baselines.index_rules import Routes, makespan_s, nearest_first, value_per_time
from swarm.allocation import Problem, TeamState, rank_of
from swarm.allocation.index_rules import NEAREST, VALUE_PER_TIME, IndexRule
from tests.support.problems import random_problem, table_1
from tests.support.reference import completion_s


def by_hand(problem: Problem, sequence: list[int], rule: str) -> Routes:
    """Fig. 1 with an index, from its definition."""
    free_s = [0.0] * problem.n_uav
    at = [np.array(place) for place in problem.start_enu_m]
    routes: Routes = [[] for _ in range(problem.n_uav)]
    left = set(range(problem.n_task))
    while True:
        able = [u for u in range(problem.n_uav) if any(problem.capable[u, t] for t in left)]
        if not able:
            return routes
        uav = min(able, key=lambda u: (free_s[u], sequence.index(u)))
        best: tuple[float, int, float] | None = None
        for task in sorted(t for t in left if problem.capable[uav, t]):
            fly_s = float(np.linalg.norm(problem.task_enu_m[task] - at[uav]))
            fly_s /= float(problem.speed_m_s[uav])
            busy_s = fly_s + float(problem.service_s[task])
            worth = float(problem.success[uav, task] * problem.value[task])
            index = -fly_s if rule == "nearest" else worth / busy_s
            if best is None or index > best[0]:
                best = (index, task, busy_s)
        assert best is not None
        _, task, busy_s = best
        free_s[uav] += busy_s
        at[uav] = problem.task_enu_m[task]
        routes[uav].append(task)
        left.remove(task)


@given(seed=st.integers(0, 2**32 - 1))
def test_index_rules_follow_their_definition(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = random_problem(rng, 3, 9, incapable_frac=0.2)
    sequence = rng.permutation(3).tolist()
    assert nearest_first(problem, sequence) == by_hand(problem, sequence, "nearest")
    assert value_per_time(problem, sequence) == by_hand(problem, sequence, "value per time")


def test_sequence_is_that_of_the_problem_by_default() -> None:
    problem = table_1()
    assert nearest_first(problem) == nearest_first(problem, range(3))
    assert sum(map(len, nearest_first(problem))) == problem.n_task


@pytest.mark.parametrize("rule", [NEAREST, VALUE_PER_TIME])
def test_decisions_tell_their_times_and_scores(rule: IndexRule) -> None:
    problem = table_1()
    state, rank = TeamState.at_start(problem), rank_of(range(3))
    decision = rule.decide(problem, state, rank, 0)
    assert decision is not None
    assert decision.second_score is not None
    assert decision.score >= decision.second_score
    assert decision.completion_s == completion_s(problem, [[decision.task], [], []])[decision.task]
    state.open[:] = False
    assert rule.decide(problem, state, rank, 0) is None
    state.open[3] = True
    last = rule.decide(problem, state, rank, 0)
    assert last is not None
    assert (last.task, last.second_score) == (3, None)


def test_task_on_the_spot_that_takes_no_time_comes_first() -> None:
    problem = table_1()
    places = problem.task_enu_m.copy()
    places[7] = problem.start_enu_m[0]
    problem = replace(problem, task_enu_m=places)
    assert value_per_time(problem)[0][0] == 7


def test_makespan_is_the_last_completion() -> None:
    problem = table_1()
    routes = [[1, 2], [], [0]]
    assert makespan_s(problem, routes) == max(completion_s(problem, routes).values())
    assert makespan_s(problem, [[], [], []]) == 0.0
