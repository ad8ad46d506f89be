"""Plans: ordered task lists per UAV and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from swarm.model.ids import TaskId, UavId

Routes = Mapping[UavId, tuple[TaskId, ...]]
"""Ordered, disjoint task lists u_j of eq. 1; every UAV of the mission has one, maybe empty."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a set of lists is worth by eq. 1."""

    objective: float
    """J [value·s]."""
    completion_s: Mapping[TaskId, float]
    """t_i: mission time of completion [s]."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The result of planning one mission."""

    scenario: str
    method: str
    routes: Routes
    objective: float
    completion_s: Mapping[TaskId, float]
    sequence: tuple[UavId, ...] | None
    """The pecking order; None where lists were optimised without one."""
    optimum: float | None
    """The proven optimum of J, where the problem is small enough to prove it."""
    evaluations: int
    """Lower-level runs spent."""
    elapsed_s: float
    seed: int
    bound: float | None = None
    """No lists whatever have a larger J; None where none was asked for or the optimum is known."""

    @property
    def basis(self) -> str:
        """What the plan's quality stands on, in words."""
        if self.optimum is not None:
            return "proven optimal" if self.gap == 0.0 else "gap to the proven optimum"
        return "best known" if self.bound is None else "gap to an upper bound"

    @property
    def gap(self) -> float | None:
        """(optimum - objective) / |optimum|; None without a proven optimum or with optimum 0."""
        if self.optimum is None or self.optimum == 0.0:
            return None
        return max(0.0, (self.optimum - self.objective) / abs(self.optimum))
