"""UAVs that share layers over hills keep apart, and off the ground."""

from __future__ import annotations

from dataclasses import replace

import pytest

from sim.faults.case import quick_plan
from sim.world.simulation import SimulatedMission, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import Mission
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.support.hilly_fleet import hilly_mission, levelled


def fly(mission: Mission) -> SimulatedMission:
    return simulate_mission(
        mission, method="greedy", seed=1, uncertainty=Uncertainty(), planner=quick_plan
    )


def assert_kept(mission: Mission, flown: SimulatedMission) -> None:
    """Nobody nearer to anybody than the separation, nor to the ground than the clearance."""
    assert mission.terrain is not None
    assert mission.separation_m is not None
    nearest_m, lowest_m = flown.world.closest_approach_m(), flown.world.lowest_clearance_m()
    assert nearest_m is not None
    assert lowest_m is not None
    assert nearest_m >= mission.separation_m - 1e-6
    assert lowest_m >= mission.terrain.clearance_m


def test_the_ridge_is_crossed_by_all_in_two_layers() -> None:
    ridge = load_scenario(resolve_scenario("ridge"))
    mission = replace(ridge, separation_m=12.0, band_m=(20.0, 34.5))
    flown = fly(mission)

    assert_kept(mission, flown)
    assert sorted(flown.result.done) == sorted(task.id for task in ridge.tasks)


@pytest.mark.parametrize(
    "seed", [2, 3, *(pytest.param(s, marks=pytest.mark.slow) for s in range(4, 25))]
)
def test_random_hills_are_crossed_without_coming_near_to_anybody(seed: int) -> None:
    mission = hilly_mission(seed)
    flown = fly(mission)

    assert_kept(mission, flown)
    assert sorted(flown.result.done) == sorted(task.id for task in mission.tasks)


def test_without_a_separation_some_would_meet() -> None:
    nearest_m = [
        fly(replace(hilly_mission(seed), separation_m=None, band_m=None)).world.closest_approach_m()
        for seed in (2, 3)
    ]
    assert min(each for each in nearest_m if each is not None) < 6.0


@pytest.mark.parametrize("seed", [8, 9])
def test_the_air_of_a_lost_keeper_is_still_shared(seed: int) -> None:
    """Each of four has a seat in two of the three stacks at least; one crashes half-way."""
    mission = hilly_mission(seed, n_uav=4, n_task=8)
    flown = simulate_mission(
        mission, method="greedy", seed=seed, uncertainty=Uncertainty(loss=0.25), planner=quick_plan
    )

    assert_kept(mission, flown)
    assert len(flown.lost_because) == 1
    assert sorted(flown.result.done) == sorted(task.id for task in mission.tasks)


@pytest.mark.parametrize("seed", [4, 7])
def test_who_makes_room_from_the_height_of_a_task_goes_to_a_layer(seed: int) -> None:
    """Not as far from there as that layer is from its own: lower than anything was to be flown."""
    mission = levelled(hilly_mission(seed))
    flown = fly(mission)

    assert mission.band_m is not None
    asked_m = [mission.band_m[0], *(task.height_m for task in mission.tasks if task.height_m)]
    tracks = flown.world.tracks.values()
    flown_m = [piece.place_enu_m[2] for track in tracks for piece in track.pieces()]
    assert min(flown_m) >= min(asked_m) - 1e-6
