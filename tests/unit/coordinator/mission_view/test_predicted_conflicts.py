"""Who would come too near to whom: the motion of swarm.separation, and no pair left out."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from coordinator.mission_view.approaches import Fix
from coordinator.mission_view.predicted_conflicts import PredictedConflict, predicted_conflicts
from swarm.model.ids import COORDINATOR
from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase, Status, StatusPhase
from swarm.separation.tactical_motion import least_meeting_m
from swarm.separation.tactical_traffic import (
    Grade,
    NearbyTrack,
    Precedence,
    TrafficRules,
    TrafficWord,
)
from tests.support.builders import brief_of, mission, uav
from tests.support.observed_mission import Teller

RULES = TrafficRules(separation_m=10.0, cruise_m_s=8.0)
STILL = (0.0, 0.0, 0.0)


def fix(place: Point, velocity: Point, at_s: float = 0.0) -> Fix:
    return Fix(at_s, True, place, velocity)


def on_way(*path: Point, flies: bool = True) -> Claim:
    return Claim(ClaimPhase.HELD, "t1", 0.0, 0, 100.0, way=ClaimedWay(1, path, flies))


def test_two_on_crossing_ways_meet_where_these_cross() -> None:
    flying = {
        "u1": fix((0.0, 0.0, 30.0), (8.0, 0.0, 0.0)),
        "u2": fix((40.0, -40.0, 30.0), (0.0, 8.0, 0.0)),
    }
    claims = {
        "u1": on_way((-50.0, 0.0, 30.0), (200.0, 0.0, 30.0)),
        "u2": on_way((40.0, -60.0, 30.0), (40.0, 200.0, 30.0)),
    }

    (met,) = predicted_conflicts(flying, claims, 1.0, RULES)

    assert met.uavs == ("u1", "u2")
    assert met.in_s == pytest.approx(4.0)  # of 40 m at 8 m/s, told 1 s ago
    assert met.distance_m == pytest.approx(0.0, abs=1e-6)
    assert met.places_enu_m[0] == pytest.approx((40.0, 0.0, 30.0))


@pytest.mark.parametrize(
    ("height_m", "claim"),
    [
        (42.0, on_way((100.0, 0.0, 42.0), (0.0, 0.0, 42.0))),  # another layer
        (30.0, on_way((100.0, 0.0, 30.0), (80.0, 0.0, 30.0), (80.0, 90.0, 30.0))),  # turns off
    ],
)
def test_who_is_on_a_way_apart_is_no_conflict(height_m: float, claim: Claim) -> None:
    flying = {
        "u1": fix((0.0, 0.0, 30.0), (8.0, 0.0, 0.0)),
        "u2": fix((100.0, 0.0, height_m), (-8.0, 0.0, 0.0)),
    }
    claims = {"u1": on_way((0.0, 0.0, 30.0), (60.0, 0.0, 30.0))}

    assert predicted_conflicts(flying, claims | {"u2": claim}, 0.0, RULES) == ()
    assert predicted_conflicts(flying | {"u2": fix((100.0, 0.0, 30.0), STILL)}, {}, 0.0, RULES) == (
        ()
    )


def test_who_stands_to_let_another_one_pass_is_not_taken_to_fly_on() -> None:
    passing = fix((0.0, 0.0, 30.0), (8.0, 0.0, 0.0))
    way = on_way((40.0, -20.0, 30.0), (40.0, 100.0, 30.0))
    stands = fix((40.0, -15.0, 30.0), STILL)
    flies = fix((40.0, -15.0, 30.0), (0.0, 3.0, 0.0))
    claims = {"u1": on_way((0.0, 0.0, 30.0), (200.0, 0.0, 30.0)), "u2": way}

    assert predicted_conflicts({"u1": passing, "u2": stands}, claims, 0.0, RULES) == ()
    assert len(predicted_conflicts({"u1": passing, "u2": flies}, claims, 0.0, RULES)) == 1


def test_who_lands_goes_on_down_and_not_back_to_the_end_of_its_way() -> None:
    above, below = (0.0, 0.0, 50.0), (0.0, 6.0, 20.0)
    flying = {"u1": fix((0.0, 0.0, 45.0), (0.0, 0.0, -1.5)), "u2": fix(below, STILL)}
    climbing = {"u1": flying["u1"], "u2": fix((0.0, 6.0, 62.0), STILL)}
    claims = {"u1": on_way((90.0, 0.0, 50.0), above)}

    assert len(predicted_conflicts(flying, claims, 0.0, replace(RULES, cruise_m_s=16.0))) == 1
    assert predicted_conflicts(climbing, claims, 0.0, RULES) == ()


def test_every_pair_is_looked_at_and_moves_as_uavs_take_each_other_to_move() -> None:
    rng = np.random.default_rng(0)
    found_any = 0
    for _ in range(20):
        flying, claims, tracks = {}, {}, {}
        for number in range(12):
            east, north, up = rng.uniform((0.0, 0.0, 20.0), (150.0, 150.0, 60.0)).tolist()
            end: Point = tuple(rng.uniform((0.0, 0.0, 20.0), (150.0, 150.0, 60.0)).tolist())
            towards = np.array(end) - (east, north, up)
            speed_m_s = float(rng.uniform(0.5, 8.0))
            velocity: Point = tuple((speed_m_s * towards / np.linalg.norm(towards)).tolist())
            said_s, name = float(rng.uniform(0.0, 1.0)), f"u{number:02}"
            flying[name] = fix((east, north, up), velocity, said_s)
            claims[name] = on_way((east, north, up), end)
            word = TrafficWord(
                (east, north, up), velocity, (end,), speed_m_s, Precedence(Grade.FLYING, 0)
            )
            tracks[name] = NearbyTrack(word, 1.0, 1.0 - said_s).expected_m(1.0, RULES)

        found = predicted_conflicts(flying, claims, 1.0, RULES)

        apart_m = {
            pair: least_meeting_m(tracks[pair[0]], tracks[pair[1]])
            for pair in itertools.combinations(sorted(tracks), 2)
        }
        near = {pair: m for pair, m in apart_m.items() if m < RULES.separation_m}
        assert {each.uavs: each.distance_m for each in found} == pytest.approx(near)
        assert [each.in_s for each in found] == sorted(each.in_s for each in found)
        for each in found:
            assert np.linalg.norm(np.subtract(*each.places_enu_m)) == pytest.approx(
                each.distance_m, abs=1e-6
            )
        found_any += len(found)
    assert found_any > 20


def approaching(separation_m: float | None) -> Teller:
    """Two UAVs that fly at each other."""
    flown = mission([uav("u1"), uav("u2")], [])
    teller = Teller(flown)
    teller.say(COORDINATOR, replace(brief_of(flown), separation_m=separation_m))
    teller.begin()
    for who, east_m, speed_m_s in (("u1", 0.0, 3.0), ("u2", 40.0, -3.0)):
        place, velocity = (east_m, 0.0, 30.0), (speed_m_s, 0.0, 0.0)
        teller.say(who, Status(StatusPhase.FLYING, None, place, velocity, None, 0.0, {}, ""))
    return teller


def test_only_a_mission_that_asks_for_a_distance_has_conflicts() -> None:
    assert approaching(None).mission_state.conflicts(0.5) == ()
    (met,) = approaching(10.0).mission_state.conflicts(0.5)
    assert isinstance(met, PredictedConflict)
    assert met.uavs == ("u1", "u2")
    assert met.distance_m < 10.0
