"""The closest approach of two tracks against what one finds by looking very often."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from sim.world.closest_approach import _apart_m, _boxes_m, closest_approach
from sim.world.flown_path import FlownPath, MotionPiece
from sim.world.motion import Point, ramps_over
from sim.world.track import Track, drifting


def straight(start: Point, stop: Point, speed_m_s: float, change_m_s2: float | None) -> FlownPath:
    length_m = math.dist(start, stop)
    if change_m_s2 is None:
        return FlownPath((start, stop), (0.0, 1.0), length_m / speed_m_s)
    ramps = ramps_over(length_m, 0.0, speed_m_s, change_m_s2, change_m_s2)
    return FlownPath((start, stop), (0.0, 1.0), ramps.duration_s, ramps)


def random_track(rng: np.random.Generator, change_m_s2: float | None) -> Track:
    track, now_s = Track(), float(rng.uniform(0.0, 3.0))
    here: Point = tuple(rng.uniform(0.0, 60.0, 3).tolist())
    track.lift_off(here, now_s)
    for _ in range(4):
        stop: Point = tuple(rng.uniform(0.0, 60.0, 3).tolist())
        path = straight(here, stop, float(rng.uniform(3.0, 12.0)), change_m_s2)
        track.fly(path.pieces(now_s), stop, now_s)
        flown_s = path.duration_s * float(rng.choice([0.6, 1.0, 1.3]))
        here, now_s = path.position_enu_m(flown_s), now_s + flown_s
        track.fly([], here, now_s)
    track.touch_down(now_s + 1.0)
    return track


@pytest.mark.parametrize("change_m_s2", [None, 1.5])
def test_it_is_what_one_finds_by_looking_very_often(change_m_s2: float | None) -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        tracks = {name: random_track(rng, change_m_s2) for name in ("a", "b", "c")}
        found = closest_approach(tracks)
        assert found is not None
        places = [tracks[uav].position_enu_m(found.at_s) for uav in found.uavs]
        assert places[0] is not None
        assert places[1] is not None
        assert math.dist(places[0], places[1]) == pytest.approx(found.distance_m, abs=1e-6)
        seen_m = math.inf
        for now_s in np.arange(0.0, 60.0, 0.02).tolist():
            there = [p for p in (t.position_enu_m(now_s) for t in tracks.values()) if p is not None]
            seen_m = min(
                [seen_m, *(math.dist(p, q) for n, p in enumerate(there) for q in there[:n])]
            )
        assert found.distance_m <= seen_m + 1e-9
        assert seen_m <= found.distance_m + 0.02 * 24.0


def test_who_is_on_the_ground_is_near_to_nobody() -> None:
    one, other = Track(), Track()
    one.lift_off((0.0, 0.0, 10.0), 0.0)
    one.touch_down(5.0)
    other.lift_off((3.0, 4.0, 10.0), 6.0)
    assert closest_approach({"a": one, "b": other}) is None

    one.lift_off((3.0, 0.0, 10.0), 7.0)
    found = closest_approach({"a": one, "b": other})
    assert found is not None
    assert (found.distance_m, found.at_s, found.uavs) == (4.0, 7.0, ("a", "b"))


def test_a_single_one_is_near_to_nobody() -> None:
    track = Track()
    track.lift_off((0.0, 0.0, 0.0), 0.0)

    assert closest_approach({"a": track}) is None


def test_a_drift_is_added_evenly_to_what_is_believed() -> None:
    piece = MotionPiece(2.0, 6.0, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    (true,) = drifting([piece], (0.0, 1.0, 0.0), (0.0, 3.0, 0.0))

    assert true.position_enu_m(2.0) == (0.0, 1.0, 0.0)
    assert true.position_enu_m(6.0) == (4.0, 3.0, 0.0)


def test_a_way_that_takes_no_time_is_flown_where_it_ends() -> None:
    """As one of a nanometre in a mission's tenth minute: the clock is the same after it."""
    piece = MotionPiece(600.0, 600.0, (5.0, 0.0, 10.0), (1.0, 0.0, 0.0))
    (true,) = drifting([piece], (0.0, 1.0, 0.0), (0.0, 3.0, 0.0))

    assert true.position_enu_m(600.0) == (5.0, 3.0, 10.0)


@pytest.mark.parametrize("change_m_s2", [None, 1.5])
def test_pairs_that_are_far_from_each_other_all_the_time_change_nothing(
    change_m_s2: float | None,
) -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        tracks = {f"u{number}": random_track(rng, change_m_s2) for number in range(8)}
        pairs = [
            found
            for one, other in itertools.combinations(tracks, 2)
            if (found := closest_approach({one: tracks[one], other: tracks[other]})) is not None
        ]
        assert closest_approach(tracks) == min(pairs, key=lambda found: found.distance_m)


def test_boxes_hold_all_places_at_which_a_vehicle_is() -> None:
    for seed in range(20):
        rng = np.random.default_rng(seed)
        tracks = [random_track(rng, 1.5) for _ in range(2)]
        boxes_m = _boxes_m([track.pieces() for track in tracks])
        least_m = _apart_m(boxes_m, 0)[0]
        for now_s in np.arange(0.0, 60.0, 0.05).tolist():
            one, other = (track.position_enu_m(now_s) for track in tracks)
            if one is not None and other is not None:
                assert math.dist(one, other) >= least_m
