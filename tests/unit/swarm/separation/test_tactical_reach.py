"""A cylinder round a motion holds all of it; and looking no further where two are apart changes no
advice."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.kernels.motions import FloatArray, least_distance_m
from swarm.separation.tactical import TacticalResolver
from swarm.separation.tactical_advice import OwnFlight
from swarm.separation.tactical_motion import (
    STEP_S,
    Agility,
    Place,
    motion_m,
)
from swarm.separation.tactical_reach import Cylinder, reach
from swarm.separation.tactical_traffic import (
    Grade,
    NearbyTrack,
    Precedence,
    TrafficPicture,
    TrafficRules,
    TrafficWord,
)

RULES = TrafficRules(10.0, 12.0, low_m=0.0, high_m=120.0)
WHOLLY_M = 1e-9

flat = st.floats(-60.0, 60.0)
heights = st.one_of(st.just(30.0), st.floats(29.9, 30.1), st.floats(0.0, 120.0))
places = st.tuples(flat, flat, heights)
paces = st.floats(-8.0, 8.0)
velocities = st.tuples(paces, paces, st.one_of(st.just(0.0), st.floats(-2.5, 2.5)))
paths = st.lists(places, max_size=4).map(tuple)
speeds = st.floats(0.5, 12.0)
agilities = st.sampled_from([Agility(0.5), Agility(1.5), Agility(2.5)])
words = st.builds(
    TrafficWord,
    places,
    velocities,
    paths,
    speeds,
    st.builds(Precedence, st.sampled_from(Grade), st.integers(0, 9)),
)


def holds(cylinder: Cylinder, way_m: FloatArray) -> bool:
    """Whether all these places are in it."""
    east_m, north_m, _ = cylinder.centre_m
    from_centre_m = np.hypot(way_m[:, 0] - east_m, way_m[:, 1] - north_m)
    return bool(
        np.all(from_centre_m <= cylinder.radius_m + WHOLLY_M)
        and np.all(way_m[:, 2] >= cylinder.low_m - WHOLLY_M)
        and np.all(way_m[:, 2] <= cylinder.high_m + WHOLLY_M)
    )


@given(places, velocities, paths, speeds, agilities, st.floats(0.0, 14.0))
def test_it_holds_all_of_a_flight_and_of_one_that_brakes(
    place: Place,
    velocity: Place,
    path: tuple[Place, ...],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
) -> None:
    flown = place, velocity, path, speed_m_s, agility
    fast_m_s = max(speed_m_s, math.hypot(*velocity))
    stands_s = drive_s + fast_m_s / agility.acceleration_m_s2 + STEP_S

    assert holds(reach(*flown, drive_s), motion_m(*flown, math.inf, drive_s))
    assert holds(reach(*flown, drive_s, brakes=True), motion_m(*flown, drive_s, stands_s))


@given(words, st.floats(0.0, 20.0))
def test_what_is_reckoned_with_of_another_one_is_held(word: TrafficWord, age_s: float) -> None:
    track = NearbyTrack(word, 100.0, age_s)
    stops_m, stray_m = track.stops_m(100.0, RULES)
    east_m, north_m = word.position_enu_m[0] - 200.0, word.position_enu_m[1]
    elsewhere = Cylinder((east_m, north_m, 0.0), 0.0, 0.0, 0.0)

    assert holds(track.reach_ahead(100.0, RULES), track.expected_m(100.0, RULES))
    assert holds(track.reach_of_stops(100.0, RULES), stops_m)
    apart_m = least_distance_m(np.array([elsewhere.centre_m]), stops_m, stray_m)
    assert track.reach_of_stops(100.0, RULES).distance_m(elsewhere) <= apart_m + WHOLLY_M
    column_m = track.column_m()
    assert (column_m is not None) == track.is_upright
    if column_m is not None:
        assert holds(track.column, column_m)


def test_the_distance_of_two_is_that_of_their_nearest_places() -> None:
    one, other = (
        Cylinder((0.0, 0.0, 30.0), 5.0, 28.0, 30.0),
        Cylinder((20.0, 0.0, 0.0), 3.0, 34.0, 40.0),
    )

    assert one.distance_m(other) == other.distance_m(one) == math.hypot(12.0, 4.0)
    assert one.grown((4.0, 1.0)).distance_m(other) == math.hypot(8.0, 3.0)
    assert one.grown((90.0, 90.0)).distance_m(other) == 0.0


@pytest.mark.parametrize("seed", range(12))
def test_advice_is_the_same_as_if_everybody_was_looked_at_closely(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the layers of a crowd, some of which climb, over some seconds."""
    rng = np.random.default_rng(seed)

    def drawn(uav: str) -> tuple[str, TrafficWord]:
        layer_m = float(rng.choice([30.0, 42.0, 54.0]))
        corners = [(*rng.uniform(-80.0, 80.0, 2).tolist(), layer_m) for _ in range(3)]
        grade = Grade(int(rng.choice([0, 1, 1, 1, 2])))
        if grade is Grade.BOUND:
            corners[1:] = [(*corners[0][:2], 80.0)]
        heading = [b - a for a, b in zip(*corners[:2], strict=True)]
        share = 8.0 / max(1.0, math.hypot(*heading))
        velocity = tuple(share * each for each in heading)
        path = () if grade is Grade.FREE else tuple(corners[1:])
        rank = int(rng.integers(0, 20))
        return uav, TrafficWord(corners[0], velocity, path, 8.0, Precedence(grade, rank))

    crowd = dict(drawn(f"u{number}") for number in range(14))
    mine = crowd.pop("u0")
    own = OwnFlight(
        *(mine.position_enu_m, mine.velocity_enu_m_s, mine.path_enu_m, mine.speed_m_s),
        Precedence(Grade.FLYING, 10),
    )

    def advised() -> list[object]:
        picture, resolver = TrafficPicture(RULES, 1e9), TacticalResolver("u0", RULES)
        for uav, word in crowd.items():
            picture.hear(uav, word, 0.0, 0.1)
        return [resolver.decide(own, picture, tick * RULES.tick_s) for tick in range(12)]

    quick = advised()
    monkeypatch.setattr(Cylinder, "distance_m", lambda _one, _other: 0.0)
    assert quick == advised()


@given(words, places, st.floats(0.0, 20.0), st.floats(10.0, 200.0))
def test_who_is_forgotten_has_flown_out_of_hearing(
    word: TrafficWord, place_m: Place, age_s: float, heard_m: float
) -> None:
    """Whether or not that is clear without working out where it has flown."""
    everybody, those_heard = TrafficPicture(RULES, math.inf), TrafficPicture(RULES, heard_m)
    for picture in (everybody, those_heard):
        picture.hear("u1", word, 0.0, 0.0)
    near = [
        uav
        for uav, track in everybody.near(place_m, age_s)
        if not track.is_silent(age_s)
        or math.dist(place_m, track.expected_m(age_s, RULES)[0].tolist()) <= heard_m
    ]

    assert [uav for uav, _ in those_heard.near(place_m, age_s)] == near
