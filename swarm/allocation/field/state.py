"""Where each UAV of a team stands between two decisions, with the field's constraints.

Leaves out: what is on its list, and when it does it (swarm.kernels.field).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from swarm.allocation.field.problem import FieldProblem
from swarm.kernels.arrays import converted

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
RankArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_ARRAYS: tuple[tuple[str, type[np.generic], int], ...] = (
    ("free_s", np.float64, 1),
    ("sortie_end_s", np.float64, 1),
    ("first_s", np.float64, 2),
    ("survived", np.float64, 1),
    ("active", np.bool_, 1),
    ("open", np.bool_, 1),
    ("landed_at", np.int32, 1),
    ("rank", np.int64, 1),
    ("arrives_s", np.float64, 1),
    ("leaving", np.int32, 1),
    ("leaves_s", np.float64, 1),
)


def _unknown() -> npt.NDArray[Any]:
    return np.empty(0)


@dataclass(frozen=True, slots=True, eq=False)
class FieldState:
    """A team as the kernels are told of it; a row for each UAV.

    Raises:
        ValueError: names the array that is not one of numbers of its kind. Shapes and numbers are
            checked where it is used, against the problem.
    """

    free_s: FloatArray
    """(n_uav,) when it is free to depart [s]; infinite: it takes no decision."""
    sortie_end_s: FloatArray
    """(n_uav,) when it has landed at the latest [s]; of no matter while it stands at a base."""
    first_s: FloatArray
    """(n_uav, n_node) times of legs from where it is then to every node [s]."""
    survived: FloatArray
    """(n_uav,) S of eq. 1 of its next task."""
    active: BoolArray
    """(n_uav,) whether it takes part."""
    open: BoolArray
    """(n_task,) whether somebody may take the task."""
    landed_at: IntArray
    """(n_uav,) base at which it stands ready with a full battery from ``free_s`` on, and holds a
    slot until it departs; -1: it is in the air."""
    rank: RankArray
    """(n_uav,) place in the sequence: of two at one instant the smaller goes first."""
    arrives_s: FloatArray = field(default_factory=_unknown)
    """(n_uav,) of who has yet to find a slot at that base, when it arrives above it [s]; then
    ``free_s`` is a prediction. -infinity: it holds one, as all do by default; infinity: it stands
    beside them."""
    leaving: IntArray = field(default_factory=_unknown)
    """(n_uav,) base on a slot of which it waits for its departure to what it does before it is
    free; -1, as by default: none."""
    leaves_s: FloatArray = field(default_factory=_unknown)
    """(n_uav,) when it departs there [s]."""

    def __post_init__(self) -> None:
        n_uav = len(self.free_s)
        for name, array in (
            ("arrives_s", np.full(n_uav, -np.inf)),
            ("leaving", np.full(n_uav, -1, dtype=np.int32)),
            ("leaves_s", np.zeros(n_uav)),
        ):
            if getattr(self, name).size == 0:
                object.__setattr__(self, name, array)
        for name, dtype, n_axes in _ARRAYS:
            array = converted(name, getattr(self, name), dtype, n_axes)
            object.__setattr__(self, name, array)

    @classmethod
    def at_start(cls, problem: FieldProblem, sequence: Sequence[int] | None = None) -> FieldState:
        """Mission time 0: all are airborne at their starts, and all tasks are open.

        Args:
            problem: what it is about.
            sequence: (n_uav,) UAVs by priority, each once; in the problem's order when None.
        """
        n_uav = problem.n_uav
        rows = rank = np.arange(n_uav)
        if sequence is not None:
            order = np.asarray(sequence)
            if not np.array_equal(np.sort(order), rows):
                raise ValueError(f"sequence must have each of {n_uav} UAVs once, not {sequence}")
            rank = np.empty(n_uav, dtype=np.int64)
            rank[order] = rows
        return cls(
            free_s=np.zeros(n_uav),
            sortie_end_s=problem.first_s.copy(),
            first_s=problem.leg_s[problem.kind, rows].reshape(n_uav, problem.n_node),
            survived=np.ones(n_uav),
            active=np.ones(n_uav, dtype=np.bool_),
            open=np.ones(problem.n_task, dtype=np.bool_),
            landed_at=np.full(n_uav, -1, dtype=np.int32),
            rank=rank,
        )
