"""What each task would add to one UAV's list, for auctions; see `field_insertion.cpp`.

Where batteries are swapped and which way lines are flown follows from the order of the tasks, as in
`swarm.kernels.field_search`. Who stands at a base now holds its slot until it is free; what
others will do later is not known.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.field import FieldTeamArrays, team_arrays


def best_insertions(
    problem: _kernels.KernelField,
    team: FieldTeamArrays,
    uav: int,
    order: Sequence[int],
    wanted: npt.NDArray[np.bool_],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int32]]:
    """The best insertion of each task into the list of ``uav``.

    Args:
        problem: the field's problem.
        team: where it stands.
        uav: whose list it is.
        order: its tasks, none of them wanted.
        wanted: (n_task,) those that are asked about.

    Returns:
        (n_task,) what J gains by each task at its best place [value·s]; -infinity where it can't
        be done, or was not asked about, or the list itself can't. And (n_task,) those places: 0 is
        before the first task.
    """
    tasks = np.array(order, dtype=np.int32)
    return _kernels.field_best_insertions(problem, *team_arrays(team), uav, tasks, wanted)
