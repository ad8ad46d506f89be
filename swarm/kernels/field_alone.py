"""What each UAV can do as its only task, and when; see `swarm.kernels.field_alone.cpp`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels

FloatArray = npt.NDArray[np.float64]


def earliest_alone(problem: _kernels.KernelField, first_s: FloatArray) -> FloatArray:
    """(n_uav, n_task) earliest end of each task as its UAV's only one [s]; infinite: it can't.

    From its start at mission time 0 on, over as many bases as it takes, with every slot free.

    Args:
        problem: the field's problem.
        first_s: (n_uav,) airborne time of the sortie that begins at mission time 0 [s].
    """
    found: FloatArray = _kernels.earliest_alone(problem, first_s)
    return found
