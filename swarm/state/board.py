"""What the registers say about each task, and the mission they describe.

Leaves out: claims (swarm.state.claims).
"""

from __future__ import annotations

from enum import StrEnum

from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.state.registers import Replica
from swarm.wire.messages import Board, Brief, Outcome, Result

__all__ = ["TaskState", "attempts", "first_done", "mission_of", "task_states"]


class TaskState(StrEnum):
    """What became of a task so far."""

    OPEN = "open"
    DONE = "done"
    FAILED = "failed"
    WITHDRAWN = "withdrawn"


def attempts(replica: Replica, task: str) -> list[tuple[str, Outcome]]:
    """(UAV id, outcome) of every ended attempt at ``task``, earliest first."""
    found = [(uav, outcome) for (uav, name), outcome in replica.outcomes.items() if name == task]
    return sorted(found, key=lambda item: (item[1].completed_s, item[0]))


def first_done(replica: Replica, task: str) -> tuple[str, Outcome] | None:
    """The visit that counts: the earliest that succeeded."""
    done = (item for item in attempts(replica, task) if item[1].result is Result.DONE)
    return next(done, None)


def task_states(replica: Replica) -> dict[str, TaskState]:
    """State of every task on the board, in board order."""
    done = {task for (_, task), o in replica.outcomes.items() if o.result is Result.DONE}
    tried = {task for (_, task), o in replica.outcomes.items() if o.result is Result.FAILED}
    reattempt = replica.brief is not None and replica.brief.reattempt_failed
    states = {}
    for entry in sorted(replica.board.values(), key=_order):
        if entry.task in done:
            states[entry.task] = TaskState.DONE
        elif entry.withdrawn:
            states[entry.task] = TaskState.WITHDRAWN
        elif entry.task in tried and not reattempt:
            states[entry.task] = TaskState.FAILED
        else:
            states[entry.task] = TaskState.OPEN
    return states


def mission_of(replica: Replica, name: str, brief: Brief) -> Mission:
    """The mission as the board shows it now: all posted tasks, in board order."""
    return Mission(
        name=name,
        horizon_s=brief.horizon_s,
        uavs=tuple(
            Uav(
                id=UavId(uav.id),
                position_enu_m=uav.position_enu_m,
                speed_m_s=uav.speed_m_s,
                success=uav.success,
                survival=uav.survival,
                kind=uav.kind,
            )
            for uav in brief.uavs
        ),
        tasks=tuple(
            Task(
                id=TaskId(entry.task),
                position_enu_m=entry.position_enu_m,
                value=entry.value,
                service_s=entry.service_s,
                kind=entry.kind,
            )
            for entry in sorted(replica.board.values(), key=_order)
        ),
        success_default=brief.success_default,
        survival_default=brief.survival_default,
        reattempt_failed=brief.reattempt_failed,
        origin=Origin(*brief.origin),
    )


def _order(entry: Board) -> tuple[int, str]:
    return entry.number, entry.task
