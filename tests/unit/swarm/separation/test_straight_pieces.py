"""What is left of a path, in the plane and in space."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.separation.straight_pieces import (
    is_same_path,
    not_flown,
    off_piece_m,
    still_ahead,
    thinned,
)


@given(seed=st.integers(0, 2**32 - 1), dimensions=st.sampled_from([2, 3]))
def test_the_distance_of_a_piece_is_that_of_its_nearest_place(seed: int, dimensions: int) -> None:
    rng = np.random.default_rng(seed)
    place, begin, end = rng.uniform(-10.0, 10.0, (3, dimensions))
    places = begin + np.linspace(0.0, 1.0, 2001)[:, None] * (end - begin)
    least_m = float(np.linalg.norm(places - place, axis=1).min())

    found_m = off_piece_m(place.tolist(), begin.tolist(), end.tolist())

    assert found_m <= least_m + 1e-9
    assert found_m == pytest.approx(least_m, abs=math.dist(begin, end) / 2000.0)


def test_a_piece_without_length_is_its_place() -> None:
    assert off_piece_m((3.0, 4.0), (0.0, 0.0), (0.0, 0.0)) == 5.0


def test_corners_at_other_heights_are_told_apart() -> None:
    climb = ((0.0, 0.0, 10.0), (0.0, 0.0, 40.0), (50.0, 0.0, 40.0))

    assert still_ahead(climb, (0.0, 0.0, 20.0)) == ((0.0, 0.0, 20.0), *climb[1:])
    assert still_ahead(climb, (9.0, 0.0, 39.0)) == ((9.0, 0.0, 39.0), climb[2])


def test_what_has_been_flown_of_a_path_is_left_out() -> None:
    path = ((0.0, 0.0, 30.0), (0.0, 0.0, 40.0), (50.0, 0.0, 40.0), (50.0, 60.0, 40.0))

    assert not_flown(path, (0.3, 0.0, 36.0)) == ((0.0, 0.0, 36.0), *path[1:])
    assert not_flown(path, (50.0, 20.0, 40.2)) == ((50.0, 20.0, 40.0), path[3])
    assert not_flown(path, (25.0, 5.0, 40.0)) == path


def test_who_comes_by_the_same_place_twice_may_be_there_for_the_first_time() -> None:
    there_and_back = ((0.0, 0.0, 30.0), (90.0, 0.0, 30.0), (90.0, 0.5, 30.0), (0.0, 0.5, 30.0))

    assert not_flown(there_and_back, (40.0, 0.4, 30.0)) == ((40.0, 0.0, 30.0), *there_and_back[1:])


def test_a_path_round_an_arc_is_thinned_and_keeps_to_it() -> None:
    turns = np.linspace(0.0, np.pi, 200)
    arc = tuple((2.0 * math.cos(t), 2.0 * math.sin(t), 30.0) for t in turns.tolist())
    path = ((2.0, -50.0, 30.0), *arc, (-2.0, -50.0, 30.0))

    fine, coarse = thinned(path, 100), thinned(path, 12)

    assert (fine[0], fine[-1]) == (coarse[0], coarse[-1]) == (path[0], path[-1])
    assert len(coarse) <= 12 < len(fine) <= 60
    for kept, off_m in ((fine, 1e-3), (coarse, 0.1)):
        pieces = list(itertools.pairwise(kept))
        assert set(kept) <= set(path)
        assert max(min(off_piece_m(each, *piece) for piece in pieces) for each in path) <= off_m


def test_corners_of_a_short_path_stay() -> None:
    path = ((0.0, 0.0, 30.0), (0.0, 0.0, 40.0), (50.0, 1.0, 40.0))

    assert thinned(path, 100) == path
    assert thinned(path[:1], 100) == path[:1]


def test_a_path_is_the_same_from_a_little_farther_on_and_not_round_another_corner() -> None:
    path = ((0.0, 0.0, 30.0), (50.0, 0.0, 30.0), (50.0, 60.0, 30.0))

    assert is_same_path(path, ((0.4, 0.2, 30.0), *path[1:]))
    assert not is_same_path(path, (path[0], (50.0, 0.2, 30.0), path[2]))
    assert not is_same_path(path, path[:2])
