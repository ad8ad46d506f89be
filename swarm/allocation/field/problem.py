"""The field's problem as arrays: windows, due times, lines, energy, bases, and legs as tables.

What a plain `swarm.allocation.Problem` is for the paper's missions, this is for all others: validated
once, read by every rule, search and proof. Nodes are the starts of the UAVs, then the bases, then the
ends of the tasks. Rows are UAVs, columns are tasks, in the order of the ids.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from swarm.kernels._kernels import KernelField
from swarm.model import BaseId, TaskId, UavId

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class FieldProblem:
    """Arrays of a mission with the field's constraints; infinity where there is no limit.

    Made by `from_mission` (swarm.allocation.field.network); the arrays are read-only.
    """

    uav_ids: tuple[UavId, ...]
    base_ids: tuple[BaseId, ...]
    task_ids: tuple[TaskId, ...]
    horizon_s: float
    """D [s]; > 0."""
    kind: IntArray
    """(n_uav,) row of the tables of legs: UAVs that fly alike share one."""
    leg_s: FloatArray
    """(n_kind, n_node, n_node) times of legs [s]; infinite where there is no way."""
    line_s: FloatArray
    """(n_kind, n_task, 2) times along the tasks' lines, forwards and backwards [s]; 0 of places,
    infinite of what can't be flown."""
    enter: IntArray
    """(n_task, 2) nodes where a task begins, forwards and backwards; it ends at the other one."""
    home_s: FloatArray
    """(n_uav, n_node) times to the nearest of the bases and the UAV's own start [s]."""
    home: IntArray
    """(n_uav, n_node) which that is: a base, or -1 for the start."""
    service_s: FloatArray
    """(n_task,) time on the spot [s]; >= 0."""
    opens_s: FloatArray
    """(n_task,) work begins not before [s]."""
    closes_s: FloatArray
    """(n_task,) nor after [s]."""
    due_s: FloatArray
    """(n_task,) and ends not after [s]."""
    weight: FloatArray
    """(n_uav, n_task) p · m."""
    survival: FloatArray
    """(n_uav, n_task) probability of surviving the task."""
    capable: BoolArray
    """(n_uav, n_task) p > 0."""
    first_s: FloatArray
    """(n_uav,) airborne time of the sortie that begins at mission time 0 [s]; may be below 0."""
    full_s: FloatArray
    """(n_uav,) the same after a swap [s]."""
    swap_s: FloatArray
    """(n_base,) from touch-down to ready [s]."""
    slots: IntArray
    """(n_base,) UAVs served at a time; 0: no limit."""
    until_s: FloatArray = field(init=False, repr=False)
    """(n_task,) what a task's end is subtracted from in eq. 1: due_s, else D [s]."""
    required: BoolArray = field(init=False, repr=False)
    """(n_task,) it has no due_s: leaving out fewer of these goes before J."""
    is_line: BoolArray = field(init=False, repr=False)
    """(n_task,) its direction matters."""
    kernel: KernelField = field(init=False, repr=False)
    """The same for the compiled kernels."""

    @property
    def n_uav(self) -> int:
        """Number of UAVs."""
        return len(self.uav_ids)

    @property
    def n_base(self) -> int:
        """Number of bases."""
        return len(self.base_ids)

    @property
    def n_task(self) -> int:
        """Number of tasks."""
        return len(self.task_ids)

    @property
    def n_node(self) -> int:
        """Number of nodes."""
        return int(self.leg_s.shape[1])
