"""One UAV of a mission."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from swarm.model.ids import RESERVED, UavId, require_id

__all__ = ["Uav", "require_point", "require_probabilities"]


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
