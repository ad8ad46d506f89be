"""One moment of a mission, in the words and numbers that a picture needs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import deserted
from coordinator.mission_view.predicted_conflicts import PredictedConflict
from coordinator.mission_view.results import lists_objective
from coordinator.mission_view.uav_state import FleetStates, UavState, UavView
from coordinator.mission_view.wording import short_names
from swarm.model import Mission, TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.field_messages import ZoneEdit
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand
from swarm.protocol.operator_commands import in_force, zone_edits

TAKEN = "taken"
"""How an open task stands that a UAV is on its way to, or serves."""
LEFT_OUT = "left_out"
"""How an open task stands that the plan leaves out and nobody has taken."""


def task_stands(state: TaskState, *, taken: bool, left_out: bool) -> str:
    """How a task stands: its `TaskState`, taken or left out."""
    if state is not TaskState.OPEN:
        return state.value
    return TAKEN if taken else LEFT_OUT if left_out else state.value


@dataclass(frozen=True, slots=True)
class TaskView:
    """One task on the board."""

    id: TaskId
    position_enu_m: tuple[float, float, float]
    state: TaskState
    taken: bool
    """Whether a UAV is on its way to it or serves it."""
    uav: int | None
    """Number of the UAV that has taken or done it."""
    path_enu_m: tuple[tuple[float, float, float], ...] = ()
    """Of a line, its points [m; mission origin]."""
    left_out: str | None = None
    """Why the plan leaves it out, if it does and nobody has taken it."""

    @property
    def stands(self) -> str:
        """Its `TaskState`, taken or left out."""
        return task_stands(self.state, taken=self.taken, left_out=self.left_out is not None)


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything a picture shows, but the story."""

    mission: Mission
    phase: MissionPhase
    mission_s: float | None
    epoch: int | None
    reason: str
    """Why that epoch."""
    rule: str | None
    sequence: tuple[str, ...]
    uavs: tuple[UavView, ...]
    tasks: tuple[TaskView, ...]
    objective: float
    """J so far [value·s]."""
    planned_objective: float | None
    """J of the offline plan; for who has none, of the lists in force, flown without delay."""
    optimum: float | None
    """The largest J there can be, where it is proven."""
    cut_s: float | None
    """For how long the own link to the bus has been down [s of the observer's clock]; that the
    bus ends when everybody has left is no loss."""
    coordinator: bool
    others: tuple[str, ...]
    """Who else is there under a name that is no UAV's."""
    commands: tuple[OperatorCommand, ...]
    """The operator's newest word to each whom there was any, in this flight."""
    dropped: int
    """Messages that all agents together have dropped."""
    zone_edits: tuple[ZoneEdit, ...] = ()
    """The operator's newest word about each zone, in this flight."""
    nearest_now: Approach | None = None
    """The two UAVs in flight that are nearest to each other."""
    nearest: Approach | None = None
    """The nearest that two have come to each other so far."""
    conflicts: tuple[PredictedConflict, ...] = ()
    """Who would soon come too near to whom, the soonest first."""

    @property
    def about_to_meet(self) -> frozenset[str]:
        """UAVs that would soon come too near to another one."""
        return frozenset(uav for conflict in self.conflicts for uav in conflict.uavs)

    @property
    def aborted(self) -> bool:
        """Whether the operator has ended the mission."""
        return any(command.kind is CommandKind.ABORT for command in self.commands)

    @property
    def has_sorties(self) -> bool:
        """Whether some battery ends, so that UAVs land for another."""
        return any(uav.endurance_s is not None for uav in self.mission.uavs)

    @property
    def left_out(self) -> dict[str, str]:
        """Open tasks that the plan leaves out and nobody has taken, each with why."""
        return {task.id: task.left_out for task in self.tasks if task.left_out is not None}

    @property
    def dropped_by_reason(self) -> dict[str, int]:
        """Messages that the fleet's agents together have dropped, most first."""
        total = sum((Counter(uav.dropped) for uav in self.uavs), Counter[str]())
        return dict(total.most_common())

    @property
    def counts(self) -> Counter[str]:
        """Tasks by how they stand."""
        return Counter(task.stands for task in self.tasks)


def scene_of(mission_state: MissionState, now_s: float) -> Scene:
    """What ``mission_state`` knows at ``now_s``, in its own clock's seconds."""
    result = mission_state.result()
    mission, plan, epoch = mission_state.mission, mission_state.plan, mission_state.replica.epoch
    mission_s, cut_since_s = mission_state.mission_s(now_s), mission_state.cut_since_s
    numbers = {uav.id: number for number, uav in enumerate(mission.uavs)}
    by: dict[str, int] = {task: numbers[uav] for task, uav in result.done_by.items()}
    over = {t for t, state in mission_state.board.states.items() if state is not TaskState.OPEN}
    shorts = short_names([uav.id for uav in mission.uavs])
    sequence = () if epoch is None else epoch.sequence
    if not sequence and plan is not None and plan.sequence is not None:
        sequence = plan.sequence
    lists: Mapping[str, Sequence[str]] | Mapping[UavId, Sequence[TaskId]] = {}
    if epoch is not None and any(epoch.routes.values()):
        lists = epoch.routes
    elif plan is not None:
        lists = plan.routes
    problem = mission_state.board.problem
    if plan is not None:
        planned_objective: float | None = plan.objective
    elif mission_state.board.field_problem is not None:
        planned_objective = None  # its lists tell neither waiting nor visits to bases
    elif problem is not None and epoch is not None and any(epoch.routes.values()):
        planned_objective = lists_objective(problem, epoch.routes)
    else:
        planned_objective = None
    states = FleetStates(mission_state, now_s)
    standing = [states.of(uav.id) for uav in mission.uavs]
    ways = mission_state.ways(now_s)
    taken = {state.task: state.id for state in reversed(standing) if state.task is not None}
    return Scene(
        mission=mission,
        phase=mission_state.phase,
        mission_s=mission_s,
        epoch=None if epoch is None else epoch.number,
        reason="" if epoch is None else epoch.reason,
        rule=epoch.rule if epoch is not None else None if plan is None else plan.method,
        sequence=tuple(sequence),
        uavs=tuple(
            UavView(
                **_fields(state),
                short=short,
                number=numbers[uav.id],
                flown=result.executed_routes[uav.id],
                planned=tuple(
                    TaskId(task)
                    for task in lists.get(uav.id, ())
                    if task not in over and taken.get(TaskId(task), uav.id) == uav.id
                ),
                start_enu_m=uav.position_enu_m,
                ways=ways.get(str(uav.id)),
            )
            for uav, state, short in zip(mission.uavs, standing, shorts, strict=True)
        ),
        tasks=_task_views(mission_state, by, numbers),
        objective=result.executed_objective,
        planned_objective=planned_objective,
        optimum=None if plan is None else plan.optimum,
        cut_s=None if cut_since_s is None or deserted(mission_state) else now_s - cut_since_s,
        coordinator=COORDINATOR in mission_state.present,
        others=tuple(sorted(mission_state.present - {COORDINATOR, *numbers})),
        commands=tuple(in_force(mission_state.replica).values()),
        dropped=sum(count.total() for count in mission_state.dropped.values()),
        zone_edits=tuple(zone_edits(mission_state.replica).values()),
        nearest_now=mission_state.nearest_now(now_s),
        nearest=mission_state.nearest,
        conflicts=mission_state.conflicts(now_s),
    )


def _fields(state: UavState) -> dict[str, Any]:
    return {each.name: getattr(state, each.name) for each in fields(state)}


def _task_views(
    mission_state: MissionState, by: dict[str, int], numbers: dict[UavId, int]
) -> tuple[TaskView, ...]:
    """The board; before there is one, what the scenario tells at the start."""
    holders, states = mission_state.holders, mission_state.board.states
    left_out = mission_state.left_out
    if not states:
        known = mission_state.mission.known_at_start().tasks
        return tuple(
            TaskView(
                task.id,
                task.position_enu_m,
                TaskState.OPEN,
                taken=False,
                uav=None,
                path_enu_m=task.path_enu_m,
                left_out=left_out.get(task.id),
            )
            for task in known
        )
    views = []
    for task_id, state in states.items():
        holder = holders.get(task_id)
        uav = by.get(task_id) if holder is None else numbers.get(UavId(holder))
        entry = mission_state.replica.board[task_id]
        place, path = entry.position_enu_m, entry.path_enu_m
        why, taken = left_out.get(task_id), holder is not None
        views.append(TaskView(TaskId(task_id), place, state, taken, uav, path, why))
    return tuple(views)
