"""Crowded missions with few layers and everything that goes wrong: nobody comes too near."""

from __future__ import annotations

from sim.faults.case import FIRST_WITH_SEPARATION, play
from sim.faults.generator import random_case
from sim.world.closest_approach import closest_approach

TWENTY = range(FIRST_WITH_SEPARATION, FIRST_WITH_SEPARATION + 20)


def test_no_pair_comes_nearer_than_the_separation_whatever_goes_wrong() -> None:
    for seed in TWENTY:
        done = play(random_case(seed))
        asked_m, nearest = done.world.mission.separation_m, closest_approach(done.world.tracks)
        assert done.broken is None, f"{seed}: {done.broken}"
        assert asked_m is not None
        assert nearest is None or nearest.distance_m >= asked_m - 1e-3, f"{seed}: {nearest}"
