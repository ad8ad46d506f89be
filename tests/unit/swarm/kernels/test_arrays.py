from __future__ import annotations

import numpy as np
import pytest

from swarm.kernels.arrays import converted


def test_an_array_that_is_as_wanted_is_taken_as_it_is() -> None:
    array = np.arange(3.0)

    assert converted("x", array, np.float64, 1) is array


def test_rows_that_lie_apart_are_brought_together() -> None:
    columns = np.arange(6.0).reshape(3, 2)[:, 0]

    assert converted("x", columns, np.float64, 1).flags.c_contiguous


def test_a_scalar_is_no_row() -> None:
    with pytest.raises(ValueError, match="x must have 1 axes, not 0"):
        converted("x", np.array(1.0), np.float64, 1)


def test_fractions_are_not_lost() -> None:
    with pytest.raises(ValueError, match="x must be an array of int64, not of float64"):
        converted("x", np.array([1.5]), np.int64, 1)
