"""Plans: ordered task lists per UAV, when they are flown, and what they are worth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from swarm.model.ids import BaseId, TaskId, UavId

Routes = Mapping[UavId, tuple[TaskId, ...]]
"""Ordered, disjoint task lists u_j of eq. 1; every UAV of the mission has one, maybe empty."""

START = "start"
"""Where a schedule goes that ends at the UAV's own start."""
_BASE = "base:"


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What a set of lists is worth by eq. 1."""

    objective: float
    """J [value·s]."""
    completion_s: Mapping[TaskId, float]
    """t_i: mission time of completion [s]."""


@dataclass(frozen=True, slots=True)
class ScheduleEntry:
    """One leg of a UAV and what is done at its end: a task, a swap of the battery, or nothing."""

    go: str
    """A task's id, `START`, or a base as `at_base` writes it."""
    from_enu_m: tuple[float, float]
    """Where it departs [m; east, north of the mission origin]."""
    via_enu_m: tuple[tuple[float, float], ...]
    """Corners of the way there, of which the last is where the work, the swap or nothing begins
    [m; east, north]; a line itself is not among them."""
    depart_s: float
    """Mission time [s], as are those that follow."""
    arrive_s: float
    begin_s: float
    """When the work begins, or at a base the swap; at the way home its arrival."""
    end_s: float
    """When that is done, and the UAV is ready."""
    is_reversed: bool = False
    """A line is flown from its last point to its first."""
    up_m: tuple[float, ...] = ()
    """Heights flown where it departs and at all corners [m above the mission origin]; empty where
    nobody looks at the ground."""

    @property
    def base(self) -> BaseId | None:
        """The base that it goes to, if it is one."""
        return BaseId(self.go.removeprefix(_BASE)) if self.go.startswith(_BASE) else None


def at_base(base: BaseId) -> str:
    """How a schedule says that it goes to ``base``; no task's id has a colon."""
    return f"{_BASE}{base}"


class LeftOut(Enum):
    """Why a task is in no list: the first of these that applies."""

    NOBODY_CAN = "nobody can"
    """No UAV, even as its only task."""
    DUE = "due"
    """It has a due time."""
    WINDOW = "window"
    """It has a time after which work does not begin."""
    ENERGY = "energy"


def by_reason(left_out: Mapping[TaskId, LeftOut]) -> dict[str, tuple[str, ...]]:
    """The tasks that are left out for each reason."""
    reasons: dict[str, list[str]] = {}
    for task, why in left_out.items():
        reasons.setdefault(why.value, []).append(task)
    return {why: tuple(tasks) for why, tasks in reasons.items()}


Schedule = Mapping[UavId, tuple[ScheduleEntry, ...]]
"""Per UAV in the order of flight."""


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
    schedule: Mapping[UavId, tuple[ScheduleEntry, ...]] | None = None
    """Per UAV in the order of flight, the last entry its way home; empty without tasks. None: the
    mission is one of schema 1, whose plans have none."""
    left_out: Mapping[TaskId, LeftOut] = field(default_factory=dict)
    """The known tasks that are in no list, in a mission of schema 2."""
    required_left_out: int = 0
    """How many of these have no due time: fewest of them goes before J."""
    fewest_left_out: int | None = None
    """As many the proven optimum leaves out; without one, no plan leaves out fewer. None: nobody
    asked."""

    @property
    def basis(self) -> str:
        """What the plan's quality stands on, in words."""
        more = "leaves out more tasks than " if self._leaves_out_more else ""
        if self.optimum is not None:
            if self.gap == 0.0:
                return "proven optimal"
            return f"{more}the proven optimum" if more else "gap to the proven optimum"
        if self.bound is None:
            return "best known"
        return f"{more}the bound" if more else "gap to an upper bound"

    @property
    def gap(self) -> float | None:
        """(optimum - objective) / |optimum|; None without a proven optimum or with optimum 0.

        None, too, where more tasks without due time are left out than need be: then J says nothing.
        """
        if self.optimum is None or self.optimum == 0.0 or self._leaves_out_more:
            return None
        return max(0.0, (self.optimum - self.objective) / abs(self.optimum))

    @property
    def _leaves_out_more(self) -> bool:
        return self.fewest_left_out is not None and self.required_left_out > self.fewest_left_out
