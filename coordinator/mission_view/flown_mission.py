"""The mission that is flown: as it was given, with the operator's tasks, and what came of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from coordinator.mission_view.results import MissionResult, dues_of, progress_of
from swarm.allocation.objective import executed_objective
from swarm.allocation.problem import Problem
from swarm.model import Mission, TaskId, UavId
from swarm.protocol.board import TaskBoard, TaskState
from swarm.protocol.board_arrays import task_of
from swarm.protocol.messages import TaskEdit
from swarm.protocol.operator_commands import zone_edits, zones_in_force


class FlownMission:
    """One mission as it is flown."""

    def __init__(self, given: Mission, board: TaskBoard) -> None:
        self._given = given
        self._mission = given
        """With what the operator has added to it."""
        self._scenario = {task.id for task in given.tasks}
        self._board = board
        self._replica = board.replica
        self._revision: Callable[[], Mission] | None = None
        """Gives the mission anew, as soon as somebody wants to know it."""
        self._added_s: dict[str, float] = {}
        """By task that the operator has added: when that was heard [s mission time]."""
        self._problem: Problem | None = None

    @property
    def mission(self) -> Mission:
        """What is being flown, as far as it is known."""
        if self._revision is not None:
            self._given, self._revision = self._revision(), None
            self.complete()
        return self._mission

    def revise(self, mission: Callable[[], Mission]) -> None:
        """Take what ``mission`` gives as soon as somebody wants to know."""
        self._revision = mission

    def edit(self, edit: TaskEdit, mission_s: float) -> None:
        """Take in what the operator has said of a task; what is of an earlier flight is nothing."""
        if self._replica.ordered(edit.task) is edit:
            self._added_s.setdefault(edit.task, mission_s)
        self.complete()

    def complete(self) -> None:
        """Put the operator's tasks and zones into the mission as it was given."""
        tasks = {task.id: task for task in self._given.tasks}
        for order in self._replica.task_orders.values():
            if self._replica.ordered(order.task) is not order:
                continue
            known = tasks.get(TaskId(order.task))
            if known is None or not order.withdrawn:
                added_s = self._added_s.get(order.task, 0.0)
                appears_s = added_s if known is None else known.appears_s
                tasks[TaskId(order.task)] = replace(task_of(order), appears_s=appears_s)
        zones = self._given.zones
        if zone_edits(self._replica):
            zones = tuple(spec.zone() for spec in zones_in_force(self._replica))
        self._mission = replace(self._given, tasks=tuple(tasks.values()), zones=zones)
        self._problem = None

    def result(self, *, repeated_visits: int, lost: Sequence[UavId], epochs: int) -> MissionResult:
        """What has been executed so far.

        ``repeated_visits`` are by UAVs to tasks that they had done themselves.
        """
        mission = self.mission
        if self._problem is None:
            self._problem = Problem.from_mission(mission)
        problem = self._problem
        due_s = dues_of(mission)
        progress = progress_of(problem, self._replica.outcomes, due_s)
        index = {str(task): number for number, task in enumerate(problem.task_ids)}
        rows = {str(uav): number for number, uav in enumerate(problem.uav_ids)}
        nobody = "", float("nan")
        first = [progress.completed.get(task, nobody) for task in problem.task_ids]
        objective = executed_objective(
            problem,
            [[index[task] for task in route] for route in progress.flown.values()],
            [completed_s for _, completed_s in first],
            [rows.get(uav, -1) for uav, _ in first],
            [due_s.get(task, problem.horizon_s) for task in problem.task_ids],
        )
        done = {
            task: (UavId(uav), completed_s)
            for task, (uav, completed_s) in zip(problem.task_ids, first, strict=True)
            if uav
        }
        states = self._board.states
        visits = sum(map(len, progress.flown.values()))
        return MissionResult(
            executed_routes={
                UavId(uav): tuple(map(TaskId, route)) for uav, route in progress.flown.items()
            },
            executed_completion_s={task: completed_s for task, (_, completed_s) in done.items()},
            executed_objective=objective,
            done=tuple(done),
            failed=tuple(t for t in problem.task_ids if states.get(t) is TaskState.FAILED),
            open=tuple(
                t
                for t in problem.task_ids
                if states.get(t, TaskState.OPEN) is TaskState.OPEN and t not in done
            ),
            duplicate_visits=visits - len(done) + repeated_visits,
            makespan_s=max((completed_s for _, completed_s in done.values()), default=0.0),
            lost_uavs=tuple(lost),
            epochs=epochs,
            added=tuple(
                task.id
                for task in mission.tasks
                if task.id not in self._scenario and task.id not in self._replica.posted
            ),
            done_by={task: uav for task, (uav, _) in done.items()},
        )
