"""Which tasks of a mission that is over should have been done, and were not.

Of schema 1 it is all of them. In schema 2 a task may be left out that has a due time, or that
nobody could have done.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from swarm.model import Mission, Task, TaskId

if TYPE_CHECKING:
    from coordinator.mission_view.results import MissionResult


def missed_tasks(mission: Mission, result: MissionResult) -> tuple[TaskId, ...]:
    """Tasks of ``mission`` that ``result`` should have done, in its order; added ones are last."""
    undone = (*result.failed, *result.open)
    if mission.schema == 1 or not undone:
        return undone
    required = [task for task in mission.tasks if task.id in undone and task.due_s is None]
    able = able_alone(mission, required)
    added = [task for task in undone if task in result.added]
    return (*(task.id for task in required if task.id in able), *added)


def able_alone(mission: Mission, tasks: Iterable[Task]) -> Collection[TaskId]:
    """Those of ``tasks`` that some UAV could have done as its only one.

    It sets off at mission time 0, over as many bases as it takes, with every slot free; what
    appears later is not begun before.
    """
    known = [replace(task, opens_s=max(task.opens_s, task.appears_s)) for task in tasks]
    if mission.is_flat:  # tables of legs may be large
        return {task.id for task in known if any(mission.success(u, task) for u in mission.uavs)}
    from swarm.allocation.field import FieldProblem, FieldState  # plain missions never load it
    from swarm.kernels.field_alone import earliest_alone

    problem = FieldProblem.from_mission(mission, tasks=known)
    can = np.isfinite(earliest_alone(problem.kernel, FieldState.at_start(problem)))
    return {known[column].id for column in np.flatnonzero(can.any(axis=0)).tolist()}
