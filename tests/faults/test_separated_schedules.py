"""Crowded missions with few layers and everything that goes wrong: nobody comes too near."""

from __future__ import annotations

import pytest

from sim.faults.case import FIRST_OF_MANY, FIRST_WITH_SEPARATION, parse_case, play
from sim.faults.generator import random_case
from sim.world.closest_approach import closest_approach

TWENTY = range(FIRST_WITH_SEPARATION, FIRST_WITH_SEPARATION + 20)
BROKEN_ONCE = {
    3000062: "an agent that was held up took its UAV for slow, and its battery for empty early",
    3000150: "the slab of a lost keeper was shut, and a task in it left undone",
    3000173: "who waited for a slanted way through two slabs kept another from making room",
    3000182: "who had landed from another layer took off into the air below its own",
    3000192: "a return from the ground left a wish for another way standing",
    3000195: "who found no way home flew through another UAV",
    3000450: "who went home climbed first, for which nobody had reckoned its battery, and fell",
    3000469: "who was on its way home stopped, asked for that way again, and lost its place",
    3001022: "who left a task's height asked for air far above its layer, and waited in a zone",
    3001046: "the judge took UAVs to be in other layers than they flew in",
    3001103: "who was stopped on its way down took a quarter of a minute for it, and fell",
    3010048: "a way round a zone had more corners than a claim can tell, and was never asked for",
    3010070: "two went home, and the one in the way of the other waited for it",
    3010092: "an heir sat beside whom it followed, and was lost: two of three seats were",
    3100409: "a vehicle told an agent that heard nobody nothing of its battery, and fell",
    3100594: "who left a task for another layer still went by its own, and fell on the way",
    3100598: "who waited for its way on a battery that drained fast took its reserve for longer",
    3100739: "who was held before it took off had let others have the air above its start",
    3010690: "an operator left whom only those had confirmed whose tokens had come up by then",
    3101968: "the mission was ended though one that was held near a task had just claimed it",
    3102180: "the judge took somebody in another layer to fly to a task's height on a slant",
    3102337: "who began anew had not been told the time, and left its task for that",
    3102434: "who stopped where it hovered, and asked for its way home at once, took it as flown",
    5002032: "who turned before its vehicle had said a word flew where nobody had granted it",
    3010313: "a line under a new zone was flown by one whose battery has no end",
}


def test_no_pair_comes_nearer_than_the_separation_whatever_goes_wrong() -> None:
    for seed in TWENTY:
        _check(seed)


@pytest.mark.parametrize("seed", BROKEN_ONCE)
def test_what_broke_once_holds(seed: int) -> None:
    _check(seed)


def test_who_is_cut_off_in_a_zone_drawn_over_it_lands_there() -> None:
    cut_off = [
        "fleet seed=3010001 uavs=6 tasks=15",
        "8 zone u1 by 0.95 for 40",
        "9.2 cut u1 for 40",
    ]
    done = play(parse_case(cut_off, "a test"))
    flown_s = done.world.tracks["u1"].flights_s
    assert done.broken is None, done.broken
    assert 9.2 < flown_s[0][1] < 20.0, flown_s


def test_a_larger_fleet_keeps_apart_too() -> None:
    case = random_case(FIRST_OF_MANY + 5)
    assert case.uavs > 6
    _check(FIRST_OF_MANY + 5)


def _check(seed: int) -> None:
    done = play(random_case(seed))
    astray_m = done.case.astray_m
    asked_m, nearest = done.world.mission.separation_m, closest_approach(done.world.tracks)
    assert done.broken is None, f"{seed}: {done.broken}"
    assert asked_m is not None
    assert nearest is None or nearest.distance_m >= asked_m - astray_m - 1e-3, f"{seed}: {nearest}"
