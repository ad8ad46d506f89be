"""Crowded missions with few layers and everything that goes wrong: nobody comes too near."""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_OF_MANY, FIRST_WITH_SEPARATION, play
from sim.faults.generator import random_case
from sim.world.closest_approach import closest_approach

TWENTY = range(FIRST_WITH_SEPARATION, FIRST_WITH_SEPARATION + 20)
BROKEN_ONCE = {
    3000062: "an agent that was held up took its UAV for slow, and its battery for empty early",
    3000150: "the slab of a lost keeper was shut, and a task in it left undone",
    3000173: "who waited for a slanted way through two slabs kept another from making room",
    3000182: "who had landed from another layer took off into the air below its own",
    3000192: "a return from the ground left a wish for another way standing",
    3000195: "the last resort led through another UAV",
    3001022: "who left a task's height asked for air far above its layer, and waited in a zone",
    3001046: "the judge took UAVs to be in other layers than they flew in",
    3001103: "who was stopped on its way down took a quarter of a minute for it, and fell",
}


def test_no_pair_comes_nearer_than_the_separation_whatever_goes_wrong() -> None:
    for seed in TWENTY:
        _check(seed)


@pytest.mark.parametrize("seed", BROKEN_ONCE)
def test_what_broke_once_holds(seed: int) -> None:
    _check(seed)


def test_a_larger_fleet_keeps_apart_too() -> None:
    case = random_case(FIRST_OF_MANY + 5)
    assert case.uavs > 6
    _check(FIRST_OF_MANY + 5)


def _check(seed: int) -> None:
    done = play(random_case(seed))
    asked_m, nearest = done.world.mission.separation_m, closest_approach(done.world.tracks)
    assert done.broken is None, f"{seed}: {done.broken}"
    assert asked_m is not None
    assert nearest is None or nearest.distance_m >= asked_m - 1e-3, f"{seed}: {nearest}"
