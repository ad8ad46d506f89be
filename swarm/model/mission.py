"""A whole mission: fleet, tasks, horizon and defaults."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from swarm.model.frames import Origin
from swarm.model.ids import require_id
from swarm.model.task import Task
from swarm.model.uav import Uav

__all__ = ["Mission", "chances"]


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

    Args:
        table: its probabilities by task id or kind; the id wins.
        tasks: which.
        default: where the table says nothing.
    """
    if not table:
        return [default for _ in tasks]
    return [
        table.get(task.id, default if task.kind is None else table.get(task.kind, default))
        for task in tasks
    ]
