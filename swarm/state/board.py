"""What the registers say about each task, and the mission they describe.

Leaves out: claims (swarm.state.claims).
"""

from __future__ import annotations

from collections.abc import Collection
from enum import StrEnum

import numpy as np

from swarm.allocation.problem import BoolArray, Problem
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.state.registers import Replica
from swarm.wire.messages import Board, Brief, ClaimPhase, Result

__all__ = ["TaskBoard", "TaskState", "doable", "mission_of"]


class TaskState(StrEnum):
    """What became of a task so far."""

    OPEN = "open"
    DONE = "done"
    FAILED = "failed"
    WITHDRAWN = "withdrawn"


def doable(board: TaskBoard, present: Collection[str]) -> list[str]:
    """Open tasks that some UAV taking part in the mission is capable of, in board order.

    Args:
        board: of the mission.
        present: writers believed alive; the lost take no part.
    """
    problem = board.problem
    if problem is None:
        return []
    claims = board.replica.claims
    able = [
        index
        for index, uav in enumerate(problem.uav_ids)
        if uav in present and uav in claims and claims[uav].phase is not ClaimPhase.OUT
    ]
    can: BoolArray = np.any(problem.capable[able, :], axis=0)
    states = board.states  # in board order, as the problem's tasks are
    return [
        task
        for (task, state), somebody_can in zip(states.items(), can, strict=True)
        if state is TaskState.OPEN and somebody_can
    ]


class TaskBoard:
    """What the registers of one replica say about tasks, worked out once per change."""

    def __init__(self, replica: Replica, mission: str) -> None:
        self.replica = replica
        self._mission = mission
        self._states: dict[str, TaskState] = {}
        self._states_version = -1
        self._problem: Problem | None = None
        self._problem_version = -1

    @property
    def states(self) -> dict[str, TaskState]:
        """State of every task on the board, in board order."""
        if self._states_version != self.replica.task_version:
            self._states = _task_states(self.replica)
            self._states_version = self.replica.task_version
        return self._states

    @property
    def problem(self) -> Problem | None:
        """Every UAV of the brief and every task posted so far; None before the brief."""
        if self._problem_version != self.replica.board_version:
            brief = self.replica.brief
            mission = None if brief is None else mission_of(self.replica, self._mission, brief)
            self._problem = None if mission is None else Problem.from_mission(mission)
            self._problem_version = self.replica.board_version
        return self._problem


def _task_states(replica: Replica) -> dict[str, TaskState]:
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
