"""A mission as arrays: what allocation computes with, validated once.

Rows are UAVs, columns are tasks, in the order of the ids. Leaves out: what has
happened so far (`swarm.allocation.lower_level.TeamState`) and every decision.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from swarm.kernels._kernels import KernelProblem
from swarm.kernels.problem import prepare
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.mission import chances

__all__ = ["BoolArray", "FloatArray", "IntArray", "Problem"]


FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, weakref_slot=True)
class Problem:
    """Arrays of eq. 1; read-only copies of what is passed in.

    A UAV whose success probability at a task is 0 is *incapable* of it and never takes it.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
    """

    uav_ids: tuple[UavId, ...]
    task_ids: tuple[TaskId, ...]
    start_enu_m: FloatArray
    """(n_uav, 3) starts [m; east, north, up from the mission origin]."""
    task_enu_m: FloatArray
    """(n_task, 3) task places [m; same frame]."""
    speed_m_s: FloatArray
    """(n_uav,) cruise speeds [m/s]; > 0."""
    value: FloatArray
    """(n_task,) m_i; >= 0."""
    service_s: FloatArray
    """(n_task,) time on the spot [s]; >= 0."""
    success: FloatArray
    """(n_uav, n_task) p within 0..1."""
    survival: FloatArray
    """(n_uav, n_task) probability of surviving the task, within 0..1."""
    horizon_s: float
    """D [s]; > 0."""
    capable: BoolArray = field(init=False, repr=False)
    """(n_uav, n_task) success > 0."""
    weight: FloatArray = field(init=False, repr=False)
    """(n_uav, n_task) p · m."""
    kernel: KernelProblem = field(init=False, repr=False)
    """The same, prepared for the compiled kernels."""
    _task_columns_m: FloatArray = field(init=False, repr=False)
    """(3, n_task) the places again, one contiguous row per axis."""

    def __post_init__(self) -> None:
        n_uav, n_task = len(self.uav_ids), len(self.task_ids)
        _require_distinct("uav_ids", self.uav_ids)
        _require_distinct("task_ids", self.task_ids)
        shapes: dict[str, tuple[int, ...]] = {
            "start_enu_m": (n_uav, 3),
            "task_enu_m": (n_task, 3),
            "speed_m_s": (n_uav,),
            "value": (n_task,),
            "service_s": (n_task,),
            "success": (n_uav, n_task),
            "survival": (n_uav, n_task),
        }
        for name, shape in shapes.items():
            self._freeze(name, _checked(name, getattr(self, name), shape))
        object.__setattr__(self, "uav_ids", tuple(self.uav_ids))
        object.__setattr__(self, "task_ids", tuple(self.task_ids))
        object.__setattr__(self, "horizon_s", float(self.horizon_s))
        if not 0.0 < self.horizon_s < float("inf"):
            raise ValueError(f"horizon_s must be > 0 and finite, not {self.horizon_s}")
        if (self.speed_m_s <= 0.0).any():
            raise ValueError(f"speed_m_s must be > 0, not {self.speed_m_s.min()}")
        for name in ("value", "service_s"):
            if (getattr(self, name) < 0.0).any():
                raise ValueError(f"{name} must be >= 0, not {getattr(self, name).min()}")
        for name in ("success", "survival"):
            array = getattr(self, name)
            if ((array < 0.0) | (array > 1.0)).any():
                raise ValueError(f"{name} must be within 0..1")
        self._freeze("capable", self.success > 0.0)
        self._freeze("weight", self.success * self.value)
        self._freeze("_task_columns_m", np.ascontiguousarray(self.task_enu_m.T))
        kernel = prepare(
            start_enu_m=self.start_enu_m,
            task_enu_m=self.task_enu_m,
            speed_m_s=self.speed_m_s,
            service_s=self.service_s,
            weight=self.weight,
            capable=self.capable,
            survival=self.survival,
            horizon_s=self.horizon_s,
        )
        object.__setattr__(self, "kernel", kernel)

    def __reduce__(self) -> tuple[type[Problem], tuple[object, ...]]:
        given = (getattr(self, item.name) for item in fields(self) if item.init)
        return type(self), tuple(given)

    @classmethod
    def from_mission(
        cls,
        mission: Mission,
        uavs: Sequence[Uav] | None = None,
        tasks: Sequence[Task] | None = None,
    ) -> Problem:
        """Arrays of ``mission``, or of some of its (or other) UAVs and tasks.

        Args:
            mission: gives horizon and default probabilities, and all that is not named below.
            uavs: rows in this order; the mission's own when None.
            tasks: columns in this order; the mission's own, pop-ups included, when None.
        """
        rows = tuple(mission.uavs if uavs is None else uavs)
        columns = _columns(mission, rows, mission.tasks if tasks is None else tasks)
        return cls(
            uav_ids=tuple(uav.id for uav in rows),
            task_ids=columns.ids,
            start_enu_m=np.array([u.position_enu_m for u in rows], float).reshape(-1, 3),
            task_enu_m=columns.place_enu_m,
            speed_m_s=np.array([u.speed_m_s for u in rows], float),
            value=columns.value,
            service_s=columns.service_s,
            success=columns.success,
            survival=columns.survival,
            horizon_s=mission.horizon_s,
        )

    def with_tasks(self, mission: Mission, tasks: Sequence[Task], known: Sequence[int]) -> Problem:
        """The same UAVs and other tasks, exactly as `from_mission` has them.

        Args:
            mission: this problem's, whose own tasks play no part.
            tasks: columns in this order.
            known: (n_task,) of each the index of its column here; -1 of a new one.
        """
        fresh = [task for task, index in zip(tasks, known, strict=True) if index < 0]
        new = _columns(mission, mission.uavs, fresh)
        index = np.array(known, dtype=np.int64)
        index[index < 0] = np.arange(self.n_task, self.n_task + len(fresh))
        return replace(
            self,
            task_ids=tuple(task.id for task in tasks),
            task_enu_m=np.concatenate([self.task_enu_m, new.place_enu_m])[index],
            value=np.concatenate([self.value, new.value])[index],
            service_s=np.concatenate([self.service_s, new.service_s])[index],
            success=np.concatenate([self.success, new.success], axis=1)[:, index],
            survival=np.concatenate([self.survival, new.survival], axis=1)[:, index],
        )

    @property
    def n_uav(self) -> int:
        """Number of UAVs."""
        return len(self.uav_ids)

    @property
    def n_task(self) -> int:
        """Number of tasks."""
        return len(self.task_ids)

    def travel_s(self, uav: int, place_enu_m: FloatArray) -> FloatArray:
        """(n_task,) straight-line flight times of ``uav`` from a (3,) place [m; ENU] [s].

        Computed as sqrt(dx² + dy² + dz²) / speed with each operation rounded by itself, so that
        every implementation of the same formula finds the same floats.
        """
        d = self._task_columns_m - place_enu_m[:, None]
        d *= d
        square = d[0] + d[1]
        square += d[2]
        travel: FloatArray = np.sqrt(square)
        travel /= self.speed_m_s[uav]
        return travel

    def _freeze(self, name: str, array: npt.NDArray[np.generic]) -> None:
        array.setflags(write=False)
        object.__setattr__(self, name, array)


@dataclass(frozen=True, slots=True, eq=False)
class _Columns:
    """What a problem says of its tasks; shapes as there."""

    ids: tuple[TaskId, ...]
    place_enu_m: FloatArray
    value: FloatArray
    service_s: FloatArray
    success: FloatArray
    survival: FloatArray


def _columns(mission: Mission, uavs: Sequence[Uav], tasks: Sequence[Task]) -> _Columns:
    shape = (len(uavs), len(tasks))

    def table(by_uav: Iterable[Mapping[str, float]], default: float) -> FloatArray:
        found = [chances(given, tasks, default) for given in by_uav]
        return np.array(found, float).reshape(shape)

    return _Columns(
        ids=tuple(task.id for task in tasks),
        place_enu_m=np.array([t.position_enu_m for t in tasks], float).reshape(-1, 3),
        value=np.array([t.value for t in tasks], float),
        service_s=np.array([t.service_s for t in tasks], float),
        success=table((uav.success for uav in uavs), mission.success_default),
        survival=table((uav.survival for uav in uavs), mission.survival_default),
    )


def _require_distinct(name: str, ids: Sequence[str]) -> None:
    if len(set(ids)) != len(ids):
        raise ValueError(f"{name} must differ from each other: {list(ids)}")


def _checked(name: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, not NaN or infinite")
    return array
