"""UAVs and the coordinator are lost, messages take their time: the tasks are done all the same."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from sim.world.settings import ScheduledLosses
from swarm.model import TaskId, UavId
from swarm.model.ids import COORDINATOR
from tests.support.fleet_builders import WatchedWorld, able_uavs, random_mission
from tests.support.seeds import seeds

SEEDS = seeds(40, 120)


def rough_world(seed: int) -> WatchedWorld:
    """A world with pop-ups, latency, and losses after the start, all at random."""
    rng = np.random.default_rng([seed, 77])
    n_uav, n_task = int(rng.integers(1, 8)), int(rng.integers(1, 20))
    mission = random_mission(rng, n_uav=n_uav, n_task=n_task, popup_frac=0.3)
    lost = [uav.id for uav in mission.uavs if rng.random() < 0.4]
    dies = rng.random() < 0.4 and not any(task.appears_s for task in mission.tasks)
    faults = ScheduledLosses(
        lost_at_s={uav: float(rng.uniform(1.0, 120.0)) for uav in lost},
        coordinator_lost_at_s=float(rng.uniform(1.0, 120.0)) if dies else None,
    )
    latency_s = float(rng.uniform(0.0, 0.05))
    return WatchedWorld(mission, seed=seed, faults=faults, latency_s=latency_s)


@cache
def flown(seed: int) -> WatchedWorld:
    """The same after its mission, which must have ended."""
    world = rough_world(seed)
    assert world.run(limit_s=1e5)
    return world


def survivors(world: WatchedWorld) -> set[str]:
    """UAVs whose process ended by itself."""
    return set(world.finished) - {COORDINATOR}


@pytest.mark.parametrize("seed", SEEDS)
def test_tasks_are_done_as_long_as_one_capable_uav_is_left(seed: int) -> None:
    world = flown(seed)

    result = world.mission_state.result()
    by_id = {task.id: task for task in world.mission.tasks}
    for task in result.open:
        assert able_uavs(world.mission, by_id[task], survivors(world)) == []
    assert result.failed == ()
    assert all(world.finished[uav] == 0 for uav in survivors(world))
    if COORDINATOR in world.finished:
        assert world.finished[COORDINATOR] == (1 if result.open else 0)


@pytest.mark.parametrize("seed", SEEDS)
def test_two_living_uavs_share_a_claim_only_while_news_is_under_way(seed: int) -> None:
    world = flown(seed)

    assert all(shared_s <= world.latency_s + 1e-9 for shared_s in world.shared_s.values())
    assert world.mission_state.result().duplicate_visits == 0


@pytest.mark.parametrize("seed", SEEDS)
def test_no_task_is_claimed_before_it_appears(seed: int) -> None:
    world = flown(seed)

    zero_s = world.zero_s
    assert zero_s is not None
    appears_s = {task.id: task.appears_s for task in world.mission.tasks}
    for made_s, _, claim in world.claimed:
        if claim.task is not None:
            assert made_s >= zero_s + appears_s[TaskId(claim.task)]
            assert claim.decided_s <= made_s
    for task, completed_s in world.mission_state.result().executed_completion_s.items():
        assert completed_s >= appears_s[task]


@pytest.mark.parametrize("seed", SEEDS)
def test_story_tells_every_loss_and_no_other(seed: int) -> None:
    world = flown(seed)

    lost = set(world.mission_state.result().lost_uavs)
    sentences = [line.text.replace(";", "").split() for line in world.mission_state.story]
    told = {words[0] for words in sentences if words[1:2] == ["lost"]}
    assert told - {COORDINATOR} == lost
    assert lost == {uav.id for uav in world.mission.uavs} - survivors(world)


def test_same_seed_same_story() -> None:
    for seed in range(10):
        again = rough_world(seed)
        again.run(limit_s=1e5)

        assert again.mission_state.story == flown(seed).mission_state.story
        assert again.claimed == flown(seed).claimed


def test_one_who_is_lost_before_the_start_is_planned_around() -> None:
    for seed in range(10):
        rng = np.random.default_rng([seed, 5])
        mission = random_mission(rng, n_uav=4, n_task=8, incapable_frac=0.0)
        world = WatchedWorld(mission, latency_s=0.02)
        world.queue.at(0.03, partial(world.lose, "u2"))

        assert world.run(limit_s=1e5)

        result = world.mission_state.result()
        assert result.open == ()
        plan = world.mission_state.plan
        assert plan is not None
        assert result.executed_routes == {**plan.routes, UavId("u2"): ()}
        assert set(world.finished) == {COORDINATOR, "u0", "u1", "u3"}
        assert set(world.finished.values()) == {0}
