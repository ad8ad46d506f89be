"""What each UAV can do as its only task, and when; see `swarm.kernels.field_alone.cpp`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.field import FieldTeamArrays


def earliest_alone(problem: _kernels.KernelField, team: FieldTeamArrays) -> npt.NDArray[np.float64]:
    """(n_uav, n_task) earliest end of each task as its UAV's only one [s]; infinite: it can't.

    From where the team stands on, over as many bases as it takes, with every slot free. Who takes
    no part can do nothing; which tasks are open is not asked.

    Args:
        problem: the field's problem.
        team: where it stands.
    """
    return _kernels.earliest_alone(
        problem,
        team.free_s,
        team.sortie_end_s,
        team.first_s,
        team.survived,
        team.active,
        team.open,
        team.landed_at,
        team.rank,
    )
