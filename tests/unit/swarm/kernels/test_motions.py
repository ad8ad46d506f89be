"""Motions of the next seconds and how near they come, against their definitions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.kernels.motions import least_distance_m, meetings, sampled_motion
from swarm.separation.tactical_motion import Agility, motion_m
from tests.support import motions_reference as reference

coordinates = st.one_of(st.floats(-300.0, 300.0), st.sampled_from([0.0, 30.0, 42.0]))
places = st.tuples(coordinates, coordinates, coordinates)
velocities = st.tuples(*(st.floats(-15.0, 15.0) for _ in range(3)))
paths = st.lists(places, max_size=5).map(tuple)
agilities = st.builds(Agility, st.floats(0.3, 5.0), st.floats(0.3, 5.0))
drives = st.one_of(st.just(math.inf), st.floats(0.0, 15.0))
rows = st.integers(1, 12)


def arrays(seed: int, *shape: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.random.default_rng(seed).uniform(-50.0, 50.0, shape)


@given(places, velocities, paths, st.floats(0.1, 25.0), agilities, drives, st.floats(0.0, 20.0))
def test_a_motion_is_as_defined(
    position_m: tuple[float, float, float],
    velocity_m_s: tuple[float, float, float],
    path_m: tuple[tuple[float, float, float], ...],
    speed_m_s: float,
    agility: Agility,
    drive_s: float,
    span_s: float,
) -> None:
    flown = position_m, velocity_m_s, path_m, speed_m_s, agility, drive_s, span_s
    np.testing.assert_allclose(motion_m(*flown), reference.motion_m(*flown), rtol=0.0, atol=1e-9)


@given(st.integers(0, 2**32 - 1), st.integers(0, 8), st.integers(2, 40))
def test_meetings_are_as_defined(seed: int, pairs: int, samples: int) -> None:
    some_m, others_m = arrays(seed, 2, pairs, samples, 3)
    some_m[: pairs // 2] = others_m[: pairs // 2] + 7.0  # these are as near all the time
    distance_m, when = meetings(some_m, others_m)
    expected_m, _ = reference.meetings(some_m, others_m)
    np.testing.assert_allclose(distance_m, expected_m, rtol=0.0, atol=1e-9)
    for k in range(pairs):  # at that moment they are as near as that
        step = min(int(when[k]), samples - 2)
        share = when[k] - step
        apart_m = some_m[k] - others_m[k]
        then_m = apart_m[step] + share * (apart_m[step + 1] - apart_m[step])
        assert math.dist(then_m, (0.0, 0.0, 0.0)) == pytest.approx(expected_m[k], abs=1e-9)


def test_of_moments_as_near_the_first_is_meant() -> None:
    still_m = np.zeros((1, 9, 3))
    assert [float(each[0]) for each in meetings(still_m, still_m + 2.0)] == [math.sqrt(12.0), 0.0]


@given(
    st.integers(0, 2**32 - 1),
    rows,
    rows,
    st.tuples(st.floats(0.0, 60.0), st.one_of(st.just(0.0), st.floats(0.0, 60.0))),
)
def test_the_least_distance_is_as_defined(
    seed: int, some: int, others: int, stray_m: tuple[float, float]
) -> None:
    some_m, others_m = arrays(seed, some, 3), arrays(seed + 1, others, 3)
    expected_m = reference.least_distance_m(some_m, others_m, stray_m)
    assert least_distance_m(some_m, others_m, stray_m) == pytest.approx(expected_m, abs=1e-9)


def test_who_hardly_brakes_is_looked_at_for_hours_and_not_for_ever() -> None:
    here_m, east_m_s = (0.0, 0.0, 30.0), (10.0, 0.0, 0.0)
    way_m = motion_m(here_m, east_m_s, (), 10.0, Agility(1e-6), math.inf, 10.0 / 1e-6)

    assert way_m.shape == (100_001, 3)
    assert way_m[-1, 0] == pytest.approx(250_000.0, rel=0.01)


NAN, HERE = (math.nan, 0.0, 0.0), (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position_m", "velocity_m_s", "path_m", "steps", "told"),
    [
        (NAN, HERE, (), 3, "position_m must be finite"),
        (HERE, NAN, (), 3, "velocity_m_s must be finite"),
        (HERE, HERE, (HERE, NAN), 3, "path_m must be finite"),
        (HERE, HERE, (), -1, "steps must be between 0 and 100000"),
    ],
)
def test_what_is_no_motion_is_refused(
    position_m: tuple[float, float, float],
    velocity_m_s: tuple[float, float, float],
    path_m: tuple[tuple[float, float, float], ...],
    steps: int,
    told: str,
) -> None:
    with pytest.raises(ValueError, match=told):
        sampled_motion(position_m, velocity_m_s, path_m, 5.0, 1.5, 1.5, math.inf, 0.25, steps)


def test_what_are_no_places_is_refused() -> None:
    two, three = np.zeros((2, 3)), np.zeros((3, 3))
    with pytest.raises(ValueError, match=r"others_m must have shape \(1, 2, 3\)"):
        meetings(two[None], three[None])
    with pytest.raises(ValueError, match="two samples or more"):
        meetings(two[:1][None], two[:1][None])
    with pytest.raises(ValueError, match="some_m must be finite"):
        meetings(np.full((1, 2, 3), math.nan), two[None])
    with pytest.raises(ValueError, match="places must not be none"):
        least_distance_m(two[:0], three)
    with pytest.raises(ValueError, match=r"some_m must have shape \(2, 3\)"):
        least_distance_m(np.zeros((2, 2)), three)
    with pytest.raises(ValueError, match="stray_m must be >= 0"):
        least_distance_m(two, three, (-1.0, 0.0))
