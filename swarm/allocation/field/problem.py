"""The field's problem as arrays: windows, due times, lines, energy, bases, and legs as tables.

What a plain `swarm.allocation.Problem` is for the paper's missions, this is for all others:
validated once, read by every rule, search and proof. Nodes are the starts of the UAVs, then the
bases, then the ends of the tasks. Rows are UAVs, columns are tasks, in the order of the ids.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from swarm.allocation.field.network import FieldNetwork
from swarm.kernels._kernels import KernelField
from swarm.kernels.arrays import converted
from swarm.model import BaseId, Mission, Task, TaskId, Uav, UavId
from swarm.model.mission import chances

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int32]
BoolArray = npt.NDArray[np.bool_]

_ARRAYS: Mapping[str, tuple[type[np.generic], int]] = {
    "kind": (np.int32, 1),
    "leg_s": (np.float64, 3),
    "line_s": (np.float64, 3),
    "enter": (np.int32, 2),
    "home_s": (np.float64, 2),
    "home": (np.int32, 2),
    "service_s": (np.float64, 1),
    "opens_s": (np.float64, 1),
    "closes_s": (np.float64, 1),
    "due_s": (np.float64, 1),
    "weight": (np.float64, 2),
    "survival": (np.float64, 2),
    "capable": (np.bool_, 2),
    "full_s": (np.float64, 1),
    "land_s": (np.float64, 1),
    "swap_s": (np.float64, 1),
    "slots": (np.int32, 1),
}
"""What the kernels read, with types and axes."""


@dataclass(frozen=True, slots=True, eq=False)
class FieldProblem:
    """Arrays of a mission with the field's constraints; infinity where there is no limit.

    Made by `from_mission`; the arrays are read-only. An item of a list is 2k for task k from its
    first point on, 2k + 1 from its last point on, and -1 - b for base b.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
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
    land_s: FloatArray
    """(n_uav,) of the times of legs to bases and starts, the landing: a slot is waited for before
    it [s]."""
    swap_s: FloatArray
    """(n_base,) from touch-down to ready [s]."""
    slots: IntArray
    """(n_base,) UAVs served at a time; 0: no limit."""
    network: FieldNetwork | None = field(default=None, repr=False)
    """Where the tables come from, for legs from elsewhere and for corners; None: not known."""
    until_s: FloatArray = field(init=False, repr=False)
    """(n_task,) what a task's end is subtracted from in eq. 1: due_s, else D [s]."""
    required: BoolArray = field(init=False, repr=False)
    """(n_task,) it has no due_s: leaving out fewer of these goes before J."""
    is_line: BoolArray = field(init=False, repr=False)
    """(n_task,) its direction matters."""
    kernel: KernelField = field(init=False, repr=False)
    """The same for the compiled kernels."""

    def __post_init__(self) -> None:
        for name in ("uav_ids", "base_ids", "task_ids"):
            ids = tuple(getattr(self, name))
            if len(set(ids)) != len(ids):
                raise ValueError(f"{name} must differ from each other: {list(ids)}")
            object.__setattr__(self, name, ids)
        for name, (dtype, n_axes) in (*_ARRAYS.items(), ("first_s", (np.float64, 1))):
            array: npt.NDArray[np.generic] = converted(name, getattr(self, name), dtype, n_axes)
            # Tables of legs are large, and nobody else has them.
            self._freeze(name, array.view() if name == "leg_s" else array.copy())
        for name, ids, n in (
            ("full_s", self.uav_ids, len(self.full_s)),
            ("first_s", self.uav_ids, len(self.first_s)),
            ("swap_s", self.base_ids, len(self.swap_s)),
            ("service_s", self.task_ids, len(self.service_s)),
        ):
            if n != len(ids):  # all other shapes are held against these
                raise ValueError(f"{name} must have shape {(len(ids),)}, not {(n,)}")
        if np.isnan(self.first_s).any():
            raise ValueError("first_s must be numbers, not NaN")
        object.__setattr__(self, "horizon_s", float(self.horizon_s))
        arrays = {name: getattr(self, name) for name in _ARRAYS}
        kernel = KernelField(**arrays, horizon_s=self.horizon_s)
        object.__setattr__(self, "kernel", kernel)
        for name in ("until_s", "required", "is_line"):
            object.__setattr__(self, name, getattr(kernel, name))

    def __reduce__(self) -> tuple[type[FieldProblem], tuple[object, ...]]:
        given = (getattr(self, item.name) for item in fields(self) if item.init)
        return type(self), tuple(given)

    @classmethod
    def from_mission(
        cls,
        mission: Mission,
        layers_m: Sequence[float] | None = None,
        uavs: Sequence[Uav] | None = None,
        tasks: Sequence[Task] | None = None,
    ) -> FieldProblem:
        """Arrays of ``mission``, or of some of its (or other) UAVs and tasks.

        Args:
            mission: gives all that is not named below. Who plans for mission time 0 passes
                `Mission.known_at_start`, without pop-ups.
            layers_m: (n_uav,) heights of the UAVs' layers [m]; when None, their own, or
                as a coordinator flies them by default, by the UAVs' places in the mission.
            uavs: rows in this order; the mission's own when None.
            tasks: columns in this order; the mission's own when None.
        """
        rows = tuple(mission.uavs if uavs is None else uavs)
        columns = tuple(mission.tasks if tasks is None else tasks)
        network = FieldNetwork(mission, rows, columns, layers_m)
        value = _floats(task.value for task in columns)
        success = _table((uav.success for uav in rows), columns, mission.success_default)
        return cls(
            uav_ids=tuple(uav.id for uav in rows),
            base_ids=tuple(base.id for base in mission.bases),
            task_ids=tuple(task.id for task in columns),
            horizon_s=mission.horizon_s,
            kind=network.kind,
            leg_s=network.leg_s,
            line_s=network.line_s,
            enter=network.enter,
            home_s=network.home_s,
            home=network.home,
            service_s=_floats(task.service_s for task in columns),
            opens_s=_floats(task.opens_s for task in columns),
            closes_s=_limits(task.closes_s for task in columns),
            due_s=_limits(task.due_s for task in columns),
            weight=success * value,
            survival=_table((uav.survival for uav in rows), columns, mission.survival_default),
            capable=success > 0.0,
            first_s=_floats(_airborne_s(uav, uav.charge_frac) for uav in rows),
            full_s=_floats(_airborne_s(uav, 1.0) for uav in rows),
            land_s=network.land_s,
            swap_s=_floats(base.swap_s for base in mission.bases),
            slots=np.array([base.slots or 0 for base in mission.bases], dtype=np.int32),
            network=network,
        )

    def calibrated(
        self,
        time_frac: Sequence[float],
        drain_frac: Sequence[float],
        land_s: Sequence[float] | None = None,
        climb_s: Sequence[float] | None = None,
        aloft_s: float = 0.0,
    ) -> FieldProblem:
        """The same for UAVs that fly otherwise than planned; itself if none does.

        Args:
            time_frac: (n_uav,) multiples of the times of legs and lines; > 0.
            drain_frac: (n_uav,) multiples of the charge that a second in the air takes; > 0.
            land_s: (n_uav,) of every leg to a base or a start, its landing [s]; when None, 0.
            climb_s: (n_uav,) of every leg from a base, what comes before it [s]; when None, 0.
            aloft_s: for how long UAVs have been in the air at mission time 0 [s].
        """
        upright_s = (*(land_s or ()), *(climb_s or ()))
        if all(frac == 1.0 for frac in (*time_frac, *drain_frac)) and not any(upright_s):
            return self
        network = self._known_network().calibrated(time_frac, land_s, climb_s)
        drain = np.asarray(drain_frac, dtype=np.float64)
        return replace(
            self,
            kind=network.kind,
            leg_s=network.leg_s,
            line_s=network.line_s,
            home_s=network.home_s,
            first_s=self.first_s / drain - aloft_s,
            full_s=self.full_s / drain,
            land_s=network.land_s,
            network=network,
        )

    def landing_s(self, uav: int, node: int) -> float:
        """Of the time of a leg to ``node``, its landing [s]."""
        return float(self.land_s[uav]) if node < self.n_uav + self.n_base else 0.0

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

    def legs_from_s(
        self, uav: int, place_enu_m: Sequence[float] | FloatArray, flown_m: float | None = None
    ) -> FloatArray:
        """(n_node,) times from anywhere to every node, see `FieldNetwork.legs_from_s` [s]."""
        return self._known_network().legs_from_s(uav, place_enu_m, flown_m)

    def corners_m(self, uav: int, begin: int, end: int) -> FloatArray | None:
        """(k, 3) places [m; ENU] of the leg between two nodes, both included; None: no way."""
        return self._known_network().corners_m(uav, begin, end)

    def corners_from_m(
        self,
        uav: int,
        place_enu_m: Sequence[float] | FloatArray,
        end: int,
        flown_m: float | None = None,
    ) -> FloatArray | None:
        """The same from anywhere, see `FieldNetwork.corners_from_m`."""
        return self._known_network().corners_from_m(uav, place_enu_m, end, flown_m)

    def flown_enu_m(
        self, uav: int, corners_enu_m: FloatArray, end: int, *, out_of_layer: bool = False
    ) -> FloatArray:
        """(k, 3) corners [m; ENU] to a node with the heights flown, see `FieldNetwork`."""
        network = self._known_network()
        return network.flown_enu_m(uav, corners_enu_m, end, out_of_layer=out_of_layer)

    def _known_network(self) -> FieldNetwork:
        if self.network is None:
            raise ValueError("a problem that was made of tables alone knows no places")
        return self.network

    def _freeze(self, name: str, array: npt.NDArray[np.generic]) -> None:
        array.setflags(write=False)
        object.__setattr__(self, name, array)


def _airborne_s(uav: Uav, charge_frac: float) -> float:
    """Time in the air that may be planned with [s]; infinite if it is endless."""
    if uav.endurance_s is None:
        return math.inf
    return charge_frac * uav.endurance_s - uav.reserve_frac * uav.endurance_s


def _floats(numbers: Iterable[float]) -> FloatArray:
    return np.array(list(numbers), dtype=np.float64)


def _limits(numbers: Iterable[float | None]) -> FloatArray:
    return _floats(math.inf if number is None else number for number in numbers)


def _table(
    by_uav: Iterable[Mapping[str, float]], tasks: Sequence[Task], default: float
) -> FloatArray:
    rows = [chances(given, tasks, default) for given in by_uav]
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(tasks))
