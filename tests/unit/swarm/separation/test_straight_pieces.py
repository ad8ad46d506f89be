"""What is left of a path, in the plane and in space."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.separation.straight_pieces import off_piece_m, still_ahead


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
