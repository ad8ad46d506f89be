"""A mission as arrays: what allocation computes with, validated once.

Rows are UAVs, columns are tasks, in the order of the ids.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from swarm.kernels._kernels import KernelProblem
from swarm.kernels.arrays import converted
from swarm.model import Mission, Task, TaskId, Uav, UavId
from swarm.model.mission import chances

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

_COLUMNS: Mapping[str, int] = {
    "start_enu_m": 2,
    "task_enu_m": 2,
    "speed_m_s": 1,
    "value": 1,
    "service_s": 1,
    "success": 2,
    "survival": 2,
}
"""Arrays that a problem is made of, with their axes."""
_TASK_AXIS: Mapping[str, int] = {
    "task_enu_m": 0,
    "value": 0,
    "service_s": 0,
    "success": 1,
    "survival": 1,
}
"""Those that say something of tasks, and along which axis."""


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
    acceleration_m_s2: FloatArray | None = None
    """(n_uav,) to and from cruise speed [m/s²]; > 0; infinite where speed changes at once. None: of
    all."""
    kernel: KernelProblem = field(init=False, repr=False)
    """The same, prepared for the compiled kernels, which check all numbers."""
    capable: BoolArray = field(init=False, repr=False)
    """(n_uav, n_task) success > 0."""
    weight: FloatArray = field(init=False, repr=False)
    """(n_uav, n_task) p · m."""
    row_of: Mapping[str, int] = field(init=False, repr=False)
    """Row of each UAV by its id."""
    column_of: Mapping[str, int] = field(init=False, repr=False)
    """Column of each task by its id."""
    _task_columns_m: FloatArray = field(init=False, repr=False)
    """(3, n_task) the places again, one contiguous row per axis."""

    def __post_init__(self) -> None:
        for name in ("uav_ids", "task_ids"):
            ids = tuple(getattr(self, name))
            if len(set(ids)) != len(ids):
                raise ValueError(f"{name} must differ from each other: {list(ids)}")
            object.__setattr__(self, name, ids)
        for name, n_axes in _COLUMNS.items():
            self._freeze(name, converted(name, getattr(self, name), np.float64, n_axes).copy())
        for name, n in (("speed_m_s", self.n_uav), ("value", self.n_task)):
            if len(getattr(self, name)) != n:  # all other shapes are held against these two
                raise ValueError(f"{name} must have shape {(n,)}, not {getattr(self, name).shape}")
        object.__setattr__(self, "horizon_s", float(self.horizon_s))
        if (given := self.acceleration_m_s2) is not None:
            numbers = converted("acceleration_m_s2", given, np.float64, 1).copy()
            self._freeze("acceleration_m_s2", numbers)
        arrays = {name: getattr(self, name) for name in _COLUMNS}
        kernel = KernelProblem(
            **arrays, horizon_s=self.horizon_s, acceleration_m_s2=self.acceleration_m_s2
        )
        if self.acceleration_m_s2 is not None and np.isinf(self.acceleration_m_s2).all():
            object.__setattr__(self, "acceleration_m_s2", None)  # told apart once, not at each leg
        object.__setattr__(self, "kernel", kernel)
        object.__setattr__(self, "capable", kernel.capable)
        object.__setattr__(self, "weight", kernel.weight)
        object.__setattr__(self, "row_of", {uav: row for row, uav in enumerate(self.uav_ids)})
        columns = {task: column for column, task in enumerate(self.task_ids)}
        object.__setattr__(self, "column_of", columns)
        self._freeze("_task_columns_m", np.ascontiguousarray(self.task_enu_m.T))

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
        columns = tuple(mission.tasks if tasks is None else tasks)
        return cls(
            uav_ids=tuple(uav.id for uav in rows),
            task_ids=tuple(task.id for task in columns),
            start_enu_m=np.array([u.position_enu_m for u in rows], float).reshape(-1, 3),
            speed_m_s=np.array([u.speed_m_s for u in rows], float),
            horizon_s=mission.horizon_s,
            acceleration_m_s2=_accelerations_m_s2(rows),
            **_of_tasks(mission, rows, columns),
        )

    def with_tasks(self, mission: Mission, tasks: Sequence[Task], known: Sequence[int]) -> Problem:
        """The same UAVs and other tasks, exactly as `from_mission` has them.

        ``known`` has of each the index of its column here, -1 of a new one; the tasks of
        ``mission``, which is this problem's, play no part.
        """
        fresh = [task for task, index in zip(tasks, known, strict=True) if index < 0]
        new = _of_tasks(mission, mission.uavs, fresh)
        index = np.array(known, dtype=np.int64)
        index[index < 0] = np.arange(self.n_task, self.n_task + len(fresh))
        arrays: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), new[name]], axis).take(index, axis)
            for name, axis in _TASK_AXIS.items()
        }
        return replace(self, task_ids=tuple(task.id for task in tasks), **arrays)

    @property
    def n_uav(self) -> int:
        """Number of UAVs."""
        return len(self.uav_ids)

    @property
    def n_task(self) -> int:
        """Number of tasks."""
        return len(self.task_ids)

    # Nothing else in allocation, planner and studies knows how long a UAV takes to fly somewhere.

    def travel_s(self, uav: int, place_enu_m: FloatArray) -> FloatArray:
        """(n_task,) flight times of ``uav`` from a (3,) place [m; ENU] to every task [s].

        Straight: `rest_to_rest_s` over `straight_m`, rounded as written there, so that every
        implementation of the same formulas finds the same floats.
        """
        return self._flown_s(uav, self._task_columns_m - place_enu_m[:, None])

    def travel_between_s(self, uav: int) -> FloatArray:
        """(n_task, n_task) the same from every task to every other [s]."""
        columns_m = self._task_columns_m
        return self._flown_s(uav, columns_m[:, None, :] - columns_m[:, :, None])

    def travel_along_s(
        self, uav: int, place_enu_m: FloatArray, route: Sequence[int] | IntArray
    ) -> FloatArray:
        """(k,) the same from a (3,) place to a list's first task, and from each to the next [s]."""
        tasks = np.asarray(route, dtype=np.int64)
        places_m = np.concatenate([place_enu_m[None], self.task_enu_m[tasks]])
        return self._flown_s(uav, (places_m[1:] - places_m[:-1]).T)

    def travel_by_lists_s(
        self, routes: Sequence[Sequence[int]], first_enu_m: FloatArray
    ) -> FloatArray:
        """(k,) the same of all UAVs, list after list, each from its row of (n_uav, 3) [s]."""
        lengths = np.array([len(route) for route in routes], dtype=np.int64)
        tasks = np.array([task for route in routes for task in route], dtype=np.int64)
        uavs = np.repeat(np.arange(len(lengths)), lengths)
        places_m = self.task_enu_m[tasks]
        from_m = np.roll(places_m, 1, axis=0)
        begins = (np.cumsum(lengths) - lengths)[lengths > 0]
        from_m[begins] = first_enu_m[uavs[begins]]
        return self._flown_s(uavs, (places_m - from_m).T)

    def _flown_s(self, uav: int | IntArray, offset_m: FloatArray) -> FloatArray:
        """Times over offsets, which are used up."""
        length_m, speed_m_s = straight_m(offset_m, spoilt=offset_m), self.speed_m_s[uav]
        if self.acceleration_m_s2 is None:
            length_m /= speed_m_s
            return length_m
        return rest_to_rest_s(length_m, speed_m_s, self.acceleration_m_s2[uav])

    def _freeze(self, name: str, array: npt.NDArray[np.generic]) -> None:
        array.setflags(write=False)
        object.__setattr__(self, name, array)


def straight_m(offset_m: FloatArray, spoilt: FloatArray | None = None) -> FloatArray:
    """(...) lengths of (3, ...) offsets, east, north and up [m].

    sqrt((dx² + dy²) + dz²), with each operation rounded by itself and in this order. Squares are
    written into ``spoilt``: offsets that nobody needs any more spare a large table of new memory.
    """
    squares_m2 = np.multiply(offset_m, offset_m, out=spoilt)
    square_m2 = squares_m2[0] + squares_m2[1]
    square_m2 += squares_m2[2]
    length_m: FloatArray = np.sqrt(square_m2)
    return length_m


def rest_to_rest_s(
    length_m: FloatArray, speed_m_s: FloatArray | float, acceleration_m_s2: FloatArray | float
) -> FloatArray:
    """(...) times over (...) lengths [m], from rest to rest [s].

    d/v + v/a if d >= v²/a, which is long enough to reach v, else 2·√(d/a); d/v at infinite a. Each
    operation is rounded by itself. Concave in d and 0 at 0, so a way round is never quicker.

    Args:
        length_m: d.
        speed_m_s: v, one each or of all [m/s]; 0: it can't be flown, unless the length is 0.
        acceleration_m_s2: a, one each or of all [m/s²].
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        at_speed_s = np.where(length_m == 0.0, 0.0, length_m / speed_m_s)
        cruising_s = at_speed_s + speed_m_s / acceleration_m_s2
        never_at_speed_s = 2.0 * np.sqrt(length_m / acceleration_m_s2)
        both_m = (speed_m_s * speed_m_s) / acceleration_m_s2
    return np.where(length_m >= both_m, cruising_s, never_at_speed_s)


def _accelerations_m_s2(uavs: Sequence[Uav]) -> FloatArray | None:
    given = [uav.acceleration_m_s2 for uav in uavs]
    if all(number is None for number in given):
        return None
    return np.array([np.inf if number is None else number for number in given])


def _of_tasks(
    mission: Mission, uavs: Sequence[Uav], tasks: Sequence[Task]
) -> dict[str, FloatArray]:
    """The arrays of `_TASK_AXIS`."""
    shape = (len(uavs), len(tasks))

    def table(by_uav: Iterable[Mapping[str, float]], default: float) -> FloatArray:
        found = [chances(given, tasks, default) for given in by_uav]
        return np.array(found, float).reshape(shape)

    return {
        "task_enu_m": np.array([t.position_enu_m for t in tasks], float).reshape(-1, 3),
        "value": np.array([t.value for t in tasks], float),
        "service_s": np.array([t.service_s for t in tasks], float),
        "success": table((uav.success for uav in uavs), mission.success_default),
        "survival": table((uav.survival for uav in uavs), mission.survival_default),
    }
