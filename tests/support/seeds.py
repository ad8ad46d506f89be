"""Seeds of random cases: some for every run of the tests, more for those of the night."""

from __future__ import annotations

import pytest


def seeds(quick: int, thorough: int) -> list[object]:
    """The first ``thorough`` seeds, of which those after the first ``quick`` are marked as slow.

    A fault that only one seed in fifty shows is found by the tests of the night; what breaks
    often is found at once.
    """
    later = (pytest.param(seed, marks=pytest.mark.slow) for seed in range(quick, thorough))
    return [*range(quick), *later]


def sweeps(quick: int, thorough: int) -> list[object]:
    """The same for a test that goes through many seeds by itself: two ranges, the second slow."""
    night = pytest.param(range(quick, thorough), marks=pytest.mark.slow, id="night")
    return [pytest.param(range(quick), id="day"), night]
