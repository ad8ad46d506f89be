"""Paths are apart for the kernel exactly where they are by its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm.kernels.paths import paths_apart
from swarm.separation.slabs import Path, Slabs, apart
from tests.support import paths_reference as reference

LEVEL = Slabs.between(6.0, (30.0, 38.0, 46.0, 54.0))
HILLY = Slabs.over(6.0, (30.0, 38.0, 46.0), (-20.0, 90.0))

# Round numbers, so that places, heights and distances are often just the same, or just as asked.
rounded = st.integers(-6, 6).map(lambda step: 8.0 * step)
flat = st.one_of(rounded, st.floats(-50.0, 50.0))
heights = st.one_of(st.sampled_from([30.0, 34.0, 37.5, 38.0, 46.0, 54.0]), st.floats(-10.0, 150.0))
paths = st.lists(st.tuples(flat, flat, heights), min_size=0, max_size=5).map(
    lambda corners: np.array(corners, dtype=np.float64).reshape(-1, 3)
)
withins = st.one_of(st.none(), st.frozensets(st.integers(0, 8)))


@pytest.mark.parametrize("slabs", [LEVEL, HILLY], ids=["level", "hilly"])
@given(one=paths, other=paths, within=withins)
def test_they_are_apart_where_they_are_by_definition(
    slabs: Slabs, one: Path, other: Path, within: frozenset[int] | None
) -> None:
    expected = not (len(one) and len(other)) or reference.apart(slabs, one, other, within)

    assert apart(slabs, one, other, within) == expected
    assert apart(slabs, other, one, within) == expected


def test_in_slabs_that_do_not_matter_they_may_meet() -> None:
    one = np.array([[0.0, 0.0, 38.0], [50.0, 0.0, 38.0]])
    other = np.array([[25.0, 5.0, 38.0]])

    assert not apart(LEVEL, one, other)
    assert not apart(LEVEL, one, other, frozenset({0, 1}))
    assert apart(LEVEL, one, other, frozenset({0, 2}))


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_no_path_is_refused(bad: float) -> None:
    path = np.zeros((2, 3))
    with pytest.raises(ValueError, match=r"other_m must have shape"):
        paths_apart(LEVEL.cut_array_m, 3.0, 8.0, path, np.zeros((2, 2)))
    with pytest.raises(ValueError, match=r"one_m must be finite"):
        paths_apart(LEVEL.cut_array_m, 3.0, 8.0, path + bad, path)
