"""UAVs that would meet in one layer: with a separation they pass above each other, or wait."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from agent.core.agent_core import AgentCore
from agent.core.interface import Action, Event
from sim.faults.case import quick_plan
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.protocol.events import Publish
from swarm.protocol.uav_messages import Claim

NIGHT = pytest.mark.slow
FOUR = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (100.0, 100.0)]
"""Starts; everybody's task is opposite."""


def crossing(layers: int) -> Mission:
    """Four UAVs each of which can do the task opposite alone, through the middle."""
    fleet = tuple(
        Uav(UavId(f"u{k}"), (*start, 0.0), 10.0, {f"t{k}": 1.0}) for k, start in enumerate(FOUR)
    )
    board = tuple(
        Task(TaskId(f"t{k}"), (100.0 - east, 100.0 - north, 0.0), 1.0)
        for k, (east, north) in enumerate(FOUR)
    )
    band_m = (30.0, 30.5 + 12.0 * (layers - 1))
    return Mission("crossing", 400.0, fleet, board, 0.0, separation_m=10.0, band_m=band_m)


def exchange(seed: int) -> Mission:
    """Two to six UAVs in one layer, each with the task at the start of another one."""
    rng = np.random.default_rng([seed, 5])
    count, half_m = int(rng.integers(2, 7)), float(rng.uniform(40.0, 80.0))
    places: list[tuple[float, float, float]] = []
    while len(places) < count:
        east_m, north_m = rng.uniform(-half_m, half_m, 2).tolist()
        place = east_m, north_m, 0.0
        if all(math.dist(place, other) >= 24.0 for other in places):
            places.append(place)
    ends = np.roll(places, -int(rng.integers(1, count)), axis=0).tolist()
    fleet = tuple(Uav(UavId(f"u{k}"), at, 10.0, {f"t{k}": 1.0}) for k, at in enumerate(places))
    board = tuple(Task(TaskId(f"t{k}"), tuple(at), 1.0) for k, at in enumerate(ends))
    return Mission("exchange", 600.0, fleet, board, separation_m=10.0, band_m=(30.0, 30.5))


def fly(mission: Mission) -> SimulatedMission:
    return simulate_mission(
        mission, method="greedy", seed=1, uncertainty=Uncertainty(), planner=quick_plan
    )


@pytest.mark.parametrize("layers", [1, 2, 4])
def test_who_would_meet_in_the_middle_keeps_the_distance_and_all_is_done(layers: int) -> None:
    flown = fly(crossing(layers))
    nearest_m = flown.world.closest_approach_m()

    assert sorted(flown.result.done) == ["t0", "t1", "t2", "t3"]
    assert nearest_m is not None
    assert nearest_m >= 10.0 - 1e-6


@pytest.mark.parametrize("seed", [*range(3), *(pytest.param(s, marks=NIGHT) for s in range(3, 20))])
def test_in_one_layer_all_change_places(seed: int) -> None:
    """Everybody's task is where another one hovers, who can't leave before somebody has."""
    mission = exchange(seed)
    flown = fly(mission)
    nearest_m = flown.world.closest_approach_m()

    assert sorted(flown.result.done) == sorted(task.id for task in mission.tasks)
    assert nearest_m is not None
    assert nearest_m >= 10.0 - 1e-6


def test_who_gave_up_a_way_that_others_were_in_asks_for_it_again_soon() -> None:
    """Two fly at a time, for 14 s; who waited for them set off after 40 s, as if refused."""
    flown = fly(crossing(2))

    assert flown.result.makespan_s < 35.0


def test_without_a_separation_they_pass_in_their_own_layers() -> None:
    nearest_m = fly(replace(crossing(4), separation_m=None)).world.closest_approach_m()

    assert nearest_m is not None
    assert nearest_m < 10.0


class SaysOnce(AgentCore):
    """Fails if it says in one step what it claims, and then something else."""

    def step(self, event: Event, now_s: float) -> list[Action]:
        actions = super().step(event, now_s)
        said = [action.message.body for action in actions if isinstance(action, Publish)]
        assert sum(isinstance(body, Claim) for body in said) <= 1
        return actions


def test_a_claim_and_the_way_that_it_asks_for_are_one_word() -> None:
    flown = simulate_mission(
        crossing(2),
        method="greedy",
        seed=1,
        uncertainty=Uncertainty(),
        planner=quick_plan,
        make_agent=SaysOnce,
    )

    assert sorted(flown.result.done) == ["t0", "t1", "t2", "t3"]
