"""Arguments of kernels: converted where nothing is lost, and refused by name otherwise."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import numpy.typing as npt

_Scalar = TypeVar("_Scalar", bound=np.generic)


def converted(name: str, value: object, dtype: type[_Scalar], n_axes: int) -> npt.NDArray[_Scalar]:
    """``value`` as a contiguous array of ``dtype``.

    Raises:
        ValueError: it is not such an array, or would lose something in becoming one: numbers their
            fractions, or truth values their meaning.
    """
    if type(value) is np.ndarray and value.dtype == dtype and value.ndim == n_axes:
        return np.ascontiguousarray(value)  # as nearly all are
    try:
        array = np.asarray(value)
        lossless = array.size == 0 or np.can_cast(array.dtype, dtype, "same_kind")
        result = np.ascontiguousarray(array, dtype) if lossless else None
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be an array of {np.dtype(dtype)}: {error}") from error
    if result is None:
        raise ValueError(f"{name} must be an array of {np.dtype(dtype)}, not of {array.dtype}")
    if array.ndim != n_axes:  # ascontiguousarray turns a scalar into a row
        raise ValueError(f"{name} must have {n_axes} axes, not {array.ndim}")
    return result
