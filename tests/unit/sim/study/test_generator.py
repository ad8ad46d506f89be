from __future__ import annotations

import numpy as np

from coordinator.planner.options import after_evaluations
from coordinator.planner.plan import guided_plan
from sim.study.generator import random_mission
from swarm.allocation import evaluate


def test_the_same_seed_draws_the_same_mission() -> None:
    a, b, other = (random_mission(5, 20, seed) for seed in (1, 1, 2))

    np.testing.assert_array_equal(a.task_enu_m, b.task_enu_m)
    np.testing.assert_array_equal(a.success, b.success)
    assert not np.array_equal(a.task_enu_m, other.task_enu_m)


def test_the_horizon_leaves_a_good_plan_some_room() -> None:
    for n_uav, n_task in ((3, 10), (10, 50), (20, 300)):
        problem = random_mission(n_uav, n_task, 1)
        plan = guided_plan(problem, stop=after_evaluations(20_000))
        _, completion_s = evaluate(problem, plan.routes)

        assert 1.0 < problem.horizon_s / completion_s.max() < 2.0
