"""Messages get lost, doubled and out of order, UAVs disappear: repetition mends it all."""

from __future__ import annotations

from functools import cache, partial

import numpy as np
import pytest

from sim.world import Faults
from swarm.config import Timing
from swarm.events import BusFact, Heard
from swarm.model import TaskId
from swarm.model.ids import COORDINATOR
from tests.fleet_builders import WatchedWorld, able_uavs, random_mission

SEEDS = range(40)
SETTLED_S = 5 * Timing().announce_s
"""By then a register has been repeated so often that everyone has heard it."""


class BadNetworkWorld(WatchedWorld):
    """Every receiver hears every message 0, 1 or 2 times, each time after a delay of its own.

    The onlooker alone hears all, so that what it tells is what happened.
    """

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng([seed, 31])
        n_uav, n_task = int(rng.integers(2, 7)), int(rng.integers(1, 16))
        mission = random_mission(rng, n_uav=n_uav, n_task=n_task, popup_frac=0.2)
        lost = [uav.id for uav in mission.uavs if rng.random() < 0.25]
        faults = Faults({uav: float(rng.uniform(1.0, 100.0)) for uav in lost})
        timing = Timing(status_s=60.0, silence_s=60.0)
        super().__init__(mission, seed=seed, faults=faults, timing=timing, latency_s=0.02)
        self._rng = rng
        self._drop_frac = float(rng.choice([0.05, 0.2, 0.4]))
        self._delay_s = float(rng.choice([0.05, 0.3]))

    def _tell_everyone(self, fact: BusFact, sender: str | None) -> None:
        self._later(self._latency_s, lambda: self._observe(fact))
        for name in (COORDINATOR, *self._agents):
            copies = 1
            if isinstance(fact, Heard):
                copies = int(self._rng.random() >= self._drop_frac) + int(self._rng.random() < 0.1)
            for _ in range(copies if name != sender else 0):
                delay_s = float(self._rng.uniform(0.0, self._delay_s))
                self._later(delay_s, partial(self._step, name, fact))


@cache
def flown(seed: int) -> BadNetworkWorld:
    world = BadNetworkWorld(seed)
    assert world.run(limit_s=1e4)
    return world


@pytest.mark.parametrize("seed", SEEDS)
def test_tasks_are_done_and_everybody_comes_home(seed: int) -> None:
    world = flown(seed)

    result = world.observer.result()
    home = set(world.finished) - {COORDINATOR}
    by_id = {task.id: task for task in world.mission.tasks}
    assert [t for t in result.open if able_uavs(world.mission, by_id[t], home)] == []
    assert home == {uav.id for uav in world.mission.uavs} - set(result.lost_uavs)
    assert world.finished == {**dict.fromkeys(home, 0), COORDINATOR: 1 if result.open else 0}


@pytest.mark.parametrize("seed", SEEDS)
def test_no_task_stays_claimed_by_two_living_uavs(seed: int) -> None:
    assert max(flown(seed).shared_s.values(), default=0.0) < SETTLED_S


@pytest.mark.parametrize("seed", SEEDS)
def test_claims_name_tasks_that_have_appeared(seed: int) -> None:
    world = flown(seed)

    zero_s = world._coordinator._zero_s
    assert zero_s is not None
    appears_s = {task.id: task.appears_s for task in world.mission.tasks}
    for made_s, _, claim in world.claimed:
        if claim.task is not None:
            assert made_s >= zero_s + appears_s[TaskId(claim.task)]


def test_two_visits_to_one_task_are_rare() -> None:
    results = [flown(seed).observer.result() for seed in SEEDS]

    visits = sum(len(result.done) + result.duplicate_visits for result in results)
    assert sum(result.duplicate_visits for result in results) < 0.05 * visits
