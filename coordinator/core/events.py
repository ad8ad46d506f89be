"""What the coordinator's core hears and what it wants done, beyond the common lot."""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.planner.online import EpochPolicy, ReplanResult, Situation
from swarm.model import Mission, Plan
from swarm.protocol.events import CommonAction, CommonEvent

__all__ = [
    "CoordinatorAction",
    "CoordinatorEvent",
    "MakePlan",
    "PlanFailed",
    "PlanMade",
    "Replan",
    "Replanned",
    "StopPlanning",
    "TakeSeat",
    "Withdraw",
]


@dataclass(frozen=True, slots=True)
class PlanMade:
    """The answer to a `MakePlan`."""

    request: int
    plan: Plan


@dataclass(frozen=True, slots=True)
class PlanFailed:
    """The answer to a `MakePlan` that could not be planned."""

    request: int
    reason: str


@dataclass(frozen=True, slots=True)
class MakePlan:
    """Plan this mission in the background; ends in `PlanMade` or `PlanFailed`."""

    request: int
    mission: Mission
    method: str
    seed: int


@dataclass(frozen=True, slots=True)
class Replan:
    """Plan the rest of a running mission in the background; ends in `Replanned`."""

    request: int
    situation: Situation
    course: EpochPolicy
    """Of the epoch in force."""
    method: str
    seed: int
    reason: str
    """What has changed since the epoch in force was made."""


@dataclass(frozen=True, slots=True)
class Replanned:
    """The answer to a `Replan`."""

    request: int
    plan: ReplanResult


@dataclass(frozen=True, slots=True)
class StopPlanning:
    """Nobody waits for what is being planned any more."""


@dataclass(frozen=True, slots=True)
class Withdraw:
    """Take a task off the board: nobody need visit it any more."""

    task: str


@dataclass(frozen=True, slots=True)
class TakeSeat:
    """Show that the coordinator is there, and answer for it."""


CoordinatorEvent = CommonEvent | PlanMade | PlanFailed | Replanned | Withdraw
CoordinatorAction = CommonAction | MakePlan | Replan | StopPlanning | TakeSeat
