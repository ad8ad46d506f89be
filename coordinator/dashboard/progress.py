"""What a mission has come to, after each task that was done.

Leaves out: what the observer makes of the end (coordinator.observer).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from swarm.allocation.problem import Problem
from swarm.wire.messages import Outcome, Result

__all__ = ["Progress", "progress_of"]


@dataclass(frozen=True, slots=True)
class Progress:
    """What has been done so far."""

    flown: dict[str, list[str]]
    """UAV id -> tasks whose visits ended done, in order."""
    completed: dict[str, tuple[str, float]]
    """Task id -> UAV that did it first, and when [s mission time]."""
    curve: list[tuple[float, float]]
    """Mission time [s] and J so far [value·s] after each first successful visit."""

    @property
    def objective(self) -> float:
        """Eq. 1 over the tasks done [value·s]."""
        return self.curve[-1][1] if self.curve else 0.0


def progress_of(problem: Problem, outcomes: Mapping[tuple[str, str], Outcome]) -> Progress:
    """Eq. 1 along the visits, in the order in which they ended.

    Args:
        problem: the mission, with every task that may have been done.
        outcomes: newest of each UAV at each task.

    Returns:
        The same lists, times and J as `coordinator.observer.Observer.result`.
    """
    columns = {str(task): number for number, task in enumerate(problem.task_ids)}
    rows = {str(uav): number for number, uav in enumerate(problem.uav_ids)}
    visits = [
        (outcome.completed_s, uav, task)
        for (uav, task), outcome in outcomes.items()
        if outcome.result is Result.DONE and task in columns and uav in rows
    ]
    # Tasks at one place may end at one instant: those stay in the order they were told in.
    visits.sort(key=lambda visit: visit[:2])
    flown: dict[str, list[str]] = {uav: [] for uav in rows}
    survived = dict.fromkeys(rows, 1.0)
    completed: dict[str, tuple[str, float]] = {}
    curve: list[tuple[float, float]] = []
    objective = 0.0
    for completed_s, uav, task in visits:
        at = rows[uav], columns[task]
        flown[uav].append(task)
        if task not in completed:
            completed[task] = uav, completed_s
            left_s = problem.horizon_s - completed_s
            objective += survived[uav] * float(problem.weight[at]) * left_s
            curve.append((completed_s, objective))
        survived[uav] *= float(problem.survival[at])
    return Progress(flown, completed, curve)
