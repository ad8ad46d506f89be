"""An agent's process dies and starts anew while its vehicle flies: nothing is flown twice."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from sim.world.network import IdealNetwork
from sim.world.settings import RestartMemory, WorldSettings
from sim.world.virtual_world import World
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.protocol.timing import Timing
from tests.support.fleet_builders import plan_for, random_mission
from tests.support.seeds import seeds

FAR_M, SPEED_M_S = 200.0, 4.0
TIMING = Timing(status_s=60.0)
FOUND = [RestartMemory.DISK, RestartMemory.NONE]


def world_of(mission: Mission, seed: int = 0) -> World:
    names = [str(uav.id) for uav in mission.uavs]
    setting = WorldSettings(lambda queue: IdealNetwork(queue, 0.02), kept=names)
    return World(mission, plan_for, method="greedy", seed=seed, timing=TIMING, setting=setting)


def restart(world: World, uav: str, at_s: float, down_s: float, found: RestartMemory) -> None:
    """The process of ``uav`` dies then, and starts anew with what is ``found``."""

    def begin_anew() -> None:
        world.restart(uav, found)

    world.queue.at(at_s, partial(world.crash, uav))
    world.queue.at(at_s + down_s, begin_anew)


def long_leg() -> Mission:
    """``u0`` alone can do ``far``; ``u1`` has a task of its own."""
    return Mission(
        "test",
        1000.0,
        (
            Uav(UavId("u0"), (0.0, 0.0, 0.0), SPEED_M_S, success={"near": 0.0}),
            Uav(UavId("u1"), (9.0, 0.0, 0.0), SPEED_M_S, success={"far": 0.0}),
        ),
        (
            Task(TaskId("far"), (FAR_M, 0.0, 0.0), 1.0, service_s=5.0),
            Task(TaskId("near"), (9.0, FAR_M, 0.0), 1.0),
        ),
    )


@pytest.mark.parametrize("found", FOUND)
@pytest.mark.parametrize("at_s", [3.0, 20.0, 45.0])
def test_a_task_is_done_as_early_as_if_nothing_had_happened(
    found: RestartMemory, at_s: float
) -> None:
    """The vehicle flew on towards it, and turns back for nothing."""
    world = world_of(long_leg())
    restart(world, "u0", at_s, 3.0, found)
    assert world.run(limit_s=1e4)

    result = world.mission_state.result()
    assert result.executed_routes[UavId("u0")] == ("far",)
    assert result.duplicate_visits == 0
    assert world.finished == {"coordinator": 0, "u0": 0, "u1": 0}
    assert result.executed_completion_s[TaskId("far")] == pytest.approx(
        FAR_M / SPEED_M_S + 5.0, abs=0.1
    )


@pytest.mark.parametrize("found", FOUND)
def test_a_service_that_was_cut_short_begins_again(found: RestartMemory) -> None:
    world = world_of(long_leg())
    died_s, down_s = FAR_M / SPEED_M_S + 4.0, 2.0
    restart(world, "u0", died_s, down_s, found)
    assert world.run(limit_s=1e4)

    completed_s = world.mission_state.result().executed_completion_s[TaskId("far")]
    assert world.zero_s is not None
    assert completed_s + world.zero_s > died_s + down_s + 5.0
    assert completed_s + world.zero_s < died_s + down_s + 7.0


@cache
def flown(seed: int) -> World:
    """Every agent of a random fleet dies once, and starts anew with its disk or without."""
    rng = np.random.default_rng([seed, 91])
    n_uav, n_task = int(rng.integers(2, 6)), int(rng.integers(2, 14))
    world = world_of(random_mission(rng, n_uav=n_uav, n_task=n_task), seed)
    for uav in world.mission.uavs:
        at_s, down_s = float(rng.uniform(1.0, 60.0)), float(rng.uniform(0.05, 8.0))
        # With nothing kept and everybody gone there would be nobody to learn from.
        found = FOUND[int(rng.integers(2))] if at_s < 20.0 else RestartMemory.DISK
        restart(world, str(uav.id), at_s, down_s, found)
    assert world.run(limit_s=1e5)
    return world


QUICK, THOROUGH = 16, 40


@pytest.mark.parametrize("seed", seeds(QUICK, THOROUGH))
def test_when_every_agent_is_restarted_every_task_is_done(seed: int) -> None:
    world = flown(seed)

    result = world.mission_state.result()
    assert result.open == ()
    assert all(status == 0 for status in world.finished.values())
    assert set(world.finished) == {"coordinator", *(str(uav.id) for uav in world.mission.uavs)}


@pytest.mark.parametrize("n_seed", [QUICK, pytest.param(THOROUGH, marks=pytest.mark.slow)])
def test_and_hardly_any_is_visited_twice(n_seed: int) -> None:
    results = [flown(seed).mission_state.result() for seed in range(n_seed)]

    visits = sum(len(result.done) + result.duplicate_visits for result in results)
    assert sum(result.duplicate_visits for result in results) <= 0.02 * visits
