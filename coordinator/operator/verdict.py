"""What has come of an operator's word.

Leaves out: finding it out (coordinator.operator.commanding, coordinator.operator.task_orders).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

__all__ = ["Result", "Verdict"]


class Result(Enum):
    """What has come of a command or an order."""

    OBEYED = "obeyed"
    NOT_OBEYED = "not obeyed"
    UNKNOWN_UAV = "no such UAV"
    UNKNOWN_TASK = "no such task"
    TAKEN_ID = "that id is taken"
    UNKNOWN_MISSION = "nothing known of the mission"

    @property
    def is_wrong_input(self) -> bool:
        """Whether it was never said, as what was asked for does not fit the mission."""
        return self in (Result.UNKNOWN_UAV, Result.UNKNOWN_TASK, Result.TAKEN_ID)


@dataclass(frozen=True, slots=True)
class Verdict:
    """What has come of it, in words as well."""

    result: Result
    text: str
    """One line; of wrong input what would be right."""
