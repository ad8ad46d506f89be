from __future__ import annotations

import numpy as np

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import guided_plan, make_plan
from swarm.allocation import TeamState, evaluate
from tests.support.problems import random_problem, table_1_mission


class StillClock:
    """Time stands still."""

    def now_s(self) -> float:
        return 0.0

    def wall_delay_s(self, delay_s: float) -> float:
        return delay_s


def test_guided_plans_table_1_to_its_optimum() -> None:
    plan = make_plan(table_1_mission(), "guided", clock=StillClock())

    assert round(plan.objective, 4) == 120.3335
    assert plan.gap == 0.0
    assert plan.sequence is not None
    assert sorted(plan.sequence) == ["uav1", "uav2", "uav3"]


def test_the_sequence_is_by_first_completion_and_idle_uavs_come_last() -> None:
    problem = random_problem(np.random.default_rng(0), 6, 4, horizon_s=30.0)

    plan = guided_plan(problem)

    _, completion_s = evaluate(problem, plan.routes)
    first_s = [completion_s[plan.routes[uav][0]] for uav in plan.sequence if plan.routes[uav]]
    assert first_s == sorted(first_s)
    idle = [not plan.routes[uav] for uav in plan.sequence]
    assert idle == sorted(idle)


def test_the_same_seed_gives_the_same_plan() -> None:
    problem = random_problem(np.random.default_rng(1), 12, 60, horizon_s=60.0)

    a, b = (guided_plan(problem, seed=3, threads=n) for n in (1, 2))

    assert a == b


def test_it_stops_when_told() -> None:
    problem = random_problem(np.random.default_rng(1), 12, 60, horizon_s=60.0)

    by_limit = guided_plan(problem, stop=after_evaluations(5000))
    by_flag = guided_plan(problem, stop=lambda iterations: iterations > 3000)
    at_once = guided_plan(problem, stop=lambda _: True)

    assert 5000 <= by_limit.iterations <= 7000
    assert 3000 < by_flag.iterations <= 6000
    assert at_once.iterations == 0
    assert sorted(t for r in at_once.routes for t in r) == list(range(60))


def test_replanning_from_a_live_state_gives_open_tasks_to_active_uavs() -> None:
    problem = random_problem(np.random.default_rng(1), 4, 20, horizon_s=60.0)
    before = guided_plan(problem)
    state = TeamState.at_start(problem)
    state.active[2] = False
    state.open[:7] = False
    state.free_s[:] = (3.0, 5.0, 0.0, np.inf)

    plan = guided_plan(problem, state=state, lists=before.routes)

    assert plan.routes[2] == ()
    assert sorted(t for r in plan.routes for t in r) == list(range(7, 20))
