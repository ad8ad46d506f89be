"""The rule `guided` in virtual time: never below its plan, and no task lost when UAVs are."""

from __future__ import annotations

import numpy as np
import pytest

from coordinator.planner.plan import make_plan
from sim.world.settings import ScheduledLosses
from sim.world.virtual_world import World
from swarm.model import Mission, Plan
from swarm.runtime.clock import SystemClock
from tests.support.fleet_builders import able_uavs, random_mission
from tests.support.seeds import seeds


def plan(mission: Mission, method: str, seed: int) -> Plan:
    return make_plan(mission, method, clock=SystemClock(), seed=seed)


def mission_of(seed: int, n_uav: int, n_task: int) -> Mission:
    return random_mission(np.random.default_rng(seed), n_uav=n_uav, n_task=n_task)


@pytest.mark.parametrize("seed", seeds(16, 40))
def test_faultless_execution_is_never_worth_less_than_its_plan(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    mission = mission_of(seed, int(rng.integers(1, 8)), int(rng.integers(1, 25)))
    world = World(mission, plan, method="guided", seed=seed)

    assert world.run(1e6)
    result, planned = world.mission_state.result(), world.mission_state.plan
    assert planned is not None
    assert len(result.done) == len(mission.tasks)
    assert result.duplicate_visits == 0
    slack = 1e-9 * max(1.0, abs(planned.objective))
    assert result.executed_objective >= planned.objective - slack


@pytest.mark.parametrize("seed", seeds(12, 40))
def test_lists_of_lost_uavs_are_done_by_the_others(seed: int) -> None:
    mission = mission_of(seed, 5, 18)
    rng = np.random.default_rng(2000 + seed)
    lost = [uav.id for uav in mission.uavs[: int(rng.integers(1, 4))]]
    faults = ScheduledLosses({uav: float(rng.uniform(0.5, 40.0)) for uav in lost})
    world = World(mission, plan, method="guided", seed=seed, faults=faults, latency_s=0.01)

    assert world.run(1e6)
    result = world.mission_state.result()
    left = [uav.id for uav in mission.uavs if uav.id not in lost]
    doable = {task.id for task in mission.tasks if able_uavs(mission, task, left)}
    assert doable <= set(result.done)
