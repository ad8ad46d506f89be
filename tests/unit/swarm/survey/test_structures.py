"""What a camera looks at along lines round structures."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from swarm.survey.structures import STRUCTURE_KIND, structure_middle_m

SQUARE = [(10.0, 20.0, 5.0), (30.0, 20.0, 5.0), (30.0, 40.0, 5.0), (10.0, 40.0, 5.0)]


def test_the_middle_of_a_square_is_looked_at() -> None:
    assert structure_middle_m(STRUCTURE_KIND, [*SQUARE, SQUARE[0]]) == pytest.approx((20.0, 30.0))


@given(seed=st.integers(0, 2**32 - 1), n_point=st.integers(3, 12))
def test_it_is_the_centroid_of_whatever_does_not_cross_itself(seed: int, n_point: int) -> None:
    chance = np.random.default_rng(seed)
    angles = np.sort(chance.uniform(0.0, 2.0 * math.pi, n_point))
    sizes_m = chance.uniform(5.0, 60.0, n_point)
    off_m = chance.uniform(-5000.0, 5000.0, 2)
    flat = [
        (off_m[0] + size_m * math.cos(angle), off_m[1] + size_m * math.sin(angle))
        for size_m, angle in zip(sizes_m, angles, strict=True)
    ]
    polygon = shapely.Polygon(flat)
    points = [(*point, 12.0) for point in (*flat, flat[0])]
    for way in (points, points[::-1]):
        middle_m = structure_middle_m(STRUCTURE_KIND, way)
        assert middle_m is not None
        if polygon.is_valid and polygon.area > 1.0:
            assert middle_m == pytest.approx(polygon.centroid.coords[0], abs=1e-6)


@given(st.lists(st.tuples(st.floats(-100.0, 100.0), st.floats(-100.0, 100.0)), min_size=3))
def test_it_is_never_beyond_what_is_flown_round(flat: list[tuple[float, float]]) -> None:
    middle_m = structure_middle_m(STRUCTURE_KIND, [(*point, 0.0) for point in (*flat, flat[0])])

    assert middle_m is not None
    for axis in (0, 1):
        seen = [point[axis] for point in flat]
        assert min(seen) - 1e-6 <= middle_m[axis] <= max(seen) + 1e-6


@pytest.mark.parametrize(
    ("kind", "points"),
    [
        (None, [*SQUARE, SQUARE[0]]),
        ("hay", [*SQUARE, SQUARE[0]]),
        (STRUCTURE_KIND, SQUARE),
        (STRUCTURE_KIND, [SQUARE[0], SQUARE[1], SQUARE[0]]),
        (STRUCTURE_KIND, [SQUARE[0]]),
        (STRUCTURE_KIND, [*SQUARE, (10.0, 20.0, 5.5)]),
    ],
    ids=["no kind", "another kind", "open", "there and back", "a place", "a spiral"],
)
def test_any_other_task_looks_nowhere(
    kind: str | None, points: list[tuple[float, float, float]]
) -> None:
    assert structure_middle_m(kind, points) is None


def test_a_line_that_crosses_itself_looks_at_its_own_middle() -> None:
    eight = [(0.0, 0.0, 5.0), (20.0, 20.0, 5.0), (20.0, 0.0, 5.0), (0.0, 20.0, 5.0)]

    assert structure_middle_m(STRUCTURE_KIND, [*eight, eight[0]]) == pytest.approx((10.0, 10.0))
