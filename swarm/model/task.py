"""One task of a mission."""

from __future__ import annotations

import math
from dataclasses import dataclass

from swarm.model.ids import TaskId, require_id
from swarm.model.uav import require_point

__all__ = ["Task"]


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
