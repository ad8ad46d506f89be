"""A mission: its UAVs, its tasks, its horizon and its defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from swarm.model.frames import Origin
from swarm.model.ids import RESERVED, TaskId, UavId, require_id


@dataclass(frozen=True, slots=True)
class Uav:
    """Where a UAV starts, how fast it cruises and how well it does what.

    Raises:
        ValueError: an id, position, speed or probability is out of range.
    """

    id: UavId
    position_enu_m: tuple[float, float, float]
    """Start [m; east, north, up from the mission origin]."""
    speed_m_s: float
    """Cruise ground speed [m/s]; > 0."""
    success: Mapping[str, float] = field(default_factory=dict)
    """Probability p of success, by task id or task kind; the id wins."""
    survival: Mapping[str, float] = field(default_factory=dict)
    """Probability of surviving the task, by task id or task kind; the id wins."""
    kind: str | None = None

    def __post_init__(self) -> None:
        require_id(self.id, "UAV id")
        if self.id in RESERVED:
            raise ValueError(
                f"UAV id {self.id!r} is taken: it names {RESERVED[self.id]} on the bus"
            )
        require_point(self.position_enu_m, f"position of UAV {self.id}")
        if not (math.isfinite(self.speed_m_s) and self.speed_m_s > 0.0):
            raise ValueError(f"speed of UAV {self.id} must be > 0 m/s, not {self.speed_m_s}")
        require_probabilities(self.success, f"success of UAV {self.id}")
        require_probabilities(self.survival, f"survival of UAV {self.id}")


def require_point(point_enu_m: tuple[float, ...], what: str) -> None:
    """Raise ``ValueError`` unless ``point_enu_m`` is three finite numbers."""
    if len(point_enu_m) != 3 or not all(math.isfinite(c) for c in point_enu_m):
        raise ValueError(f"{what} must be three finite numbers [m], not {point_enu_m}")


def require_probabilities(table: Mapping[str, float], what: str) -> None:
    """Raise ``ValueError`` unless every value of ``table`` is within 0..1."""
    for name, value in table.items():
        if not 0.0 <= value <= 1.0:
            raise ValueError(f"{what} at {name} must be within 0..1, not {value}")


@dataclass(frozen=True, slots=True)
class Task:
    """A place to visit and what the visit is worth.

    Raises:
        ValueError: an id, position, value or duration is out of range.
    """

    id: TaskId
    position_enu_m: tuple[float, float, float]
    """Place [m; east, north, up from the mission origin]."""
    value: float
    """m_i of eq. 1; >= 0."""
    service_s: float = 0.0
    """Time on the spot [s]; >= 0."""
    kind: str | None = None
    appears_s: float = 0.0
    """Mission time before which nobody knows the task [s]; > 0 marks a pop-up."""

    def __post_init__(self) -> None:
        require_id(self.id, "task id")
        require_point(self.position_enu_m, f"position of task {self.id}")
        for name in ("value", "service_s", "appears_s"):
            number = getattr(self, name)
            if not (math.isfinite(number) and number >= 0.0):
                raise ValueError(f"{name} of task {self.id} must be >= 0, not {number}")


@dataclass(frozen=True, slots=True)
class Mission:
    """What a scenario file describes.

    Raises:
        ValueError: an id is doubled or invalid, or a number is out of range.
    """

    name: str
    horizon_s: float
    """D of eq. 1 [s]; > 0."""
    uavs: tuple[Uav, ...]
    tasks: tuple[Task, ...]
    success_default: float = 1.0
    survival_default: float = 1.0
    reattempt_failed: bool = False
    origin: Origin | None = None

    def __post_init__(self) -> None:
        require_id(self.name, "mission name")
        if not (math.isfinite(self.horizon_s) and self.horizon_s > 0.0):
            raise ValueError(f"horizon_s must be > 0, not {self.horizon_s}")
        for name in ("success_default", "survival_default"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} must be within 0..1, not {getattr(self, name)}")
        for what, ids in (
            ("UAV", [uav.id for uav in self.uavs]),
            ("task", [task.id for task in self.tasks]),
        ):
            if len(set(ids)) != len(ids):
                raise ValueError(f"{what} ids must differ: {ids}")

    def success(self, uav: Uav, task: Task) -> float:
        """p: probability that ``uav`` succeeds at ``task``; 0 means it never tries."""
        return chances(uav.success, [task], self.success_default)[0]

    def survival(self, uav: Uav, task: Task) -> float:
        """Probability that ``uav`` survives ``task``, a factor of S for all that follow."""
        return chances(uav.survival, [task], self.survival_default)[0]

    def known_at_start(self) -> Mission:
        """The same mission without its pop-ups (tasks with ``appears_s > 0``)."""
        return replace(self, tasks=tuple(task for task in self.tasks if task.appears_s == 0.0))


def chances(table: Mapping[str, float], tasks: Iterable[Task], default: float) -> list[float]:
    """One UAV's probability at each of ``tasks``.

    By its ``table`` of task ids and kinds, of which the id wins; else the ``default``.
    """
    if not table:
        return [default for _ in tasks]
    return [
        table.get(task.id, default if task.kind is None else table.get(task.kind, default))
        for task in tasks
    ]
