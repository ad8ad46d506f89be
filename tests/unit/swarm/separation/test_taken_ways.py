"""Who is near to a way: nobody who comes too near is left out, whatever was said before."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest

from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.slabs import Slabs, apart, planned_apart_m
from swarm.separation.taken_ways import Starter, TakenWays

SLABS = Slabs.between(10.0, (30.0,))
NEAR_M = planned_apart_m(SLABS.separation_m)
SIDE_M = 150.0


def random_way(rng: np.random.Generator, number: int) -> ClaimedWay:
    places = rng.uniform(0.0, SIDE_M, (int(rng.integers(0, 4)), 2))
    path = tuple((east_m, north_m, 30.0) for east_m, north_m in places.tolist())
    return ClaimedWay(number, path, flies=bool(rng.random() < 0.5), grounded=not path)


def fleet_of(rng: np.random.Generator, count: int) -> list[Starter]:
    places = rng.uniform(0.0, SIDE_M, (count, 2)).tolist()
    return [Starter(f"u{k}", (east_m, north_m, 30.0)) for k, (east_m, north_m) in enumerate(places)]


@pytest.mark.parametrize("seed", range(20))
def test_all_who_are_too_near_to_a_way_are_found_by_whatever_was_said_last(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ways, claims = TakenWays(fleet_of(rng, 8), NEAR_M), dict[str, Claim]()
    left_out = 0
    for number in range(1, 30):
        uav = str(rng.choice(ways.uavs))
        claims[uav] = Claim(ClaimPhase.IDLE, None, 0.0, 0, 0.0, way=random_way(rng, number))
        own = random_way(rng, number)
        path = np.array(own.path_enu_m).reshape(-1, 3)
        near = ways.near(path, claims)
        for other in ways.uavs:
            way = ways.way(other, claims)
            meets = not apart(SLABS, path, ways.wanted(other, way))
            assert other in near or not meets
            assert ways.may_meet("somebody", own, other, way) or not meets
            left_out += other not in near
        ways.look_at(claims)
        assert ways.asking == {each for each in ways.uavs if not ways.way(each, claims).flies}
    assert left_out > 0


def test_who_looks_with_other_words_than_another_one_sees_what_they_say() -> None:
    ways = TakenWays([Starter("u0", (0.0, 0.0, 30.0)), Starter("u1", (100.0, 0.0, 30.0))], NEAR_M)
    gone = Claim(ClaimPhase.OUT, None, 0.0, 0, 0.0, way=ClaimedWay(1, (), heir="u1"))
    place = np.array([[0.0, 5.0, 30.0]])

    assert ways.near(place, {}) == ["u0"]
    assert ways.near(place, {"u0": gone}) == []
    assert ways.successions == {"u0": ((), True, "u1")}
    assert ways.near(place, {}) == ["u0"]
    assert ways.successions == {}


def test_claims_that_may_change_are_looked_at_anew_and_those_that_cannot_only_once() -> None:
    ways = TakenWays([Starter("u0", (0.0, 0.0, 30.0))], NEAR_M)
    gone = Claim(ClaimPhase.OUT, None, 0.0, 0, 0.0, way=ClaimedWay(1, (), heir="u1"))
    place = np.array([[0.0, 5.0, 30.0]])
    claims = dict[str, Claim]()
    assert ways.near(place, claims) == ["u0"]
    claims["u0"] = gone
    assert ways.near(place, claims) == []

    there, left = MappingProxyType[str, Claim]({}), MappingProxyType({"u0": gone})
    assert [ways.near(place, each) for each in (there, there, left, there)] == [
        ["u0"],
        ["u0"],
        [],
        ["u0"],
    ]
