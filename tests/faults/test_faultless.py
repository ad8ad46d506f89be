"""Without faults the fleet executes the offline plan, decision for decision (section III.C)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sim.world.simulation import simulate_mission
from sim.world.uncertainty import Uncertainty
from tests.support.builders import with_accelerations
from tests.support.field_missions import mission_of
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.fleet_builders import WatchedWorld, plan_for, random_mission
from tests.support.seeds import seeds

WITHOUT_SLOTS = tuple(kind for kind in KINDS if kind != "slots")
"""Plans let nobody wait on the ground for a slot; there more can be done than was planned."""


@pytest.mark.parametrize("seed", seeds(40, 200))
def test_greedy_lists_are_executed_as_planned(seed: int) -> None:
    executed_lists_equal_the_offline_plan("greedy", seed, 8, 25)


@pytest.mark.parametrize("seed", seeds(15, 40))
def test_lookahead_lists_are_executed_as_planned(seed: int) -> None:
    executed_lists_equal_the_offline_plan("lookahead", seed, 4, 9)


@pytest.mark.parametrize("method", ["greedy", "lookahead"])
@pytest.mark.parametrize("seed", seeds(10, 40))
def test_lists_of_uavs_that_speed_up_slowly_are_executed_as_planned(seed: int, method: str) -> None:
    executed_lists_equal_the_offline_plan(method, seed, 4, 9, accelerates=True)


def executed_lists_equal_the_offline_plan(
    method: str, seed: int, most_uavs: int, most_tasks: int, *, accelerates: bool = False
) -> None:
    rng = np.random.default_rng([seed, most_tasks])
    n_uav = int(rng.integers(1, most_uavs + 1))
    n_task = int(rng.integers(1, most_tasks + 1))
    mission = random_mission(rng, n_uav=n_uav, n_task=n_task)
    if accelerates:
        mission = with_accelerations(mission, rng)
    plan = plan_for(mission, method, seed)
    world = WatchedWorld(mission, lambda *_: plan, method=method, seed=seed)

    assert world.run(limit_s=1e5)

    result = world.mission_state.result()
    assert result.executed_routes == plan.routes
    assert result.executed_completion_s == pytest.approx(plan.completion_s, abs=1e-9)
    assert result.executed_objective == pytest.approx(plan.objective, abs=1e-6)
    assert set(result.done) == {task.id for task in mission.tasks}
    assert (result.duplicate_visits, result.open, result.lost_uavs) == (0, (), ())
    assert world.finished == dict.fromkeys(["coordinator", *(u.id for u in mission.uavs)], 0)


@pytest.mark.parametrize("method", ["greedy", "lookahead", "guided"])
@pytest.mark.parametrize("kind", WITHOUT_SLOTS)
@pytest.mark.parametrize("seed", seeds(1, 12))
def test_lists_of_the_field_are_executed_as_planned(seed: int, kind: str, method: str) -> None:
    mission = replace(mission_of(made_up(seed, kind, 3, 5)), schema=2).known_at_start()
    flown = simulate_mission(mission, method=method, seed=seed, uncertainty=Uncertainty())

    plan = flown.world.mission_state.plan
    assert plan is not None
    assert flown.result.executed_routes == plan.routes
    assert flown.result.executed_completion_s == pytest.approx(plan.completion_s, abs=1e-6)


@pytest.mark.parametrize("method", ["greedy", "lookahead", "guided"])
@pytest.mark.parametrize("seed", seeds(3, 12))
def test_where_uavs_wait_for_slots_all_that_is_planned_is_done(seed: int, method: str) -> None:
    """Who has nothing to do lands beside the slots, gets a battery there, and may do more."""
    mission = replace(mission_of(made_up(seed, "slots", 3, 5)), schema=2).known_at_start()
    flown = simulate_mission(mission, method=method, seed=seed, uncertainty=Uncertainty())

    plan = flown.world.mission_state.plan
    assert plan is not None
    assert {task for route in plan.routes.values() for task in route} <= set(flown.result.done)
