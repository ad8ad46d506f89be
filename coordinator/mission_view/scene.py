"""One moment of a mission, in the words and numbers that a picture needs.

Leaves out: where and how they are shown (coordinator.terminal.live_view).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import deserted
from coordinator.mission_view.presentation import short_names
from swarm.allocation.objective import evaluate
from swarm.model import Mission, TaskId, Uav, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import TaskState
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, PlanEpoch
from swarm.protocol.operator_commands import in_force
from swarm.protocol.uav_messages import ClaimPhase, StatusPhase

__all__ = ["LOST", "Scene", "TaskView", "UavView", "scene_of", "uav_activity", "uav_position"]


LOST = "lost"
STARTING = "starting"
_UNREADY = (STARTING, StatusPhase.LEARNING, StatusPhase.PREPARING)
_BUSY = (StatusPhase.FLYING, StatusPhase.SERVING)
_PHASES = {ClaimPhase.OUT: StatusPhase.OUT, ClaimPhase.PAUSED: StatusPhase.HOLDING}
"""What a UAV does that claims nothing, where it is not idle."""


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


@dataclass(frozen=True, slots=True)
class UavView:
    """One UAV."""

    id: UavId
    short: str
    """What tells its id from the others."""
    number: int
    """Place in the fleet, from 0."""
    does: str
    """`StatusPhase`, or lost, or starting."""
    task: TaskId | None
    eta_s: float | None
    """Predicted completion of its task, from now [s]."""
    flown: tuple[TaskId, ...]
    """Tasks it has done, in order."""
    planned: tuple[TaskId, ...]
    """Tasks its list has for it that are not over yet."""
    battery_frac: float | None
    note: str
    there: bool
    """Whether it is believed to be there."""
    silent_s: float | None
    """How long it has said nothing, where that is long [s of the observer's clock]."""
    start_enu_m: tuple[float, float, float]
    position_enu_m: tuple[float, float, float]

    @property
    def troubled(self) -> bool:
        """Whether it is gone or takes no part."""
        return self.does in (LOST, StatusPhase.OUT)

    @property
    def unready(self) -> bool:
        """Whether it is not at its start yet."""
        return self.does in _UNREADY

    @property
    def busy(self) -> bool:
        """Whether it is on its way to a task or serves it."""
        return self.does in _BUSY


@dataclass(frozen=True, slots=True)
class Scene:
    """Everything a picture shows, but the story."""

    mission: Mission
    phase: MissionPhase
    mission_s: float | None
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
    """Whether it is there."""
    commands: tuple[OperatorCommand, ...]
    """The operator's newest word to each whom there was any, in this flight."""
    dropped: int
    """Messages that all agents together have dropped."""

    @property
    def aborted(self) -> bool:
        """Whether the operator has ended the mission."""
        return any(command.kind is CommandKind.ABORT for command in self.commands)

    def count(self, state: TaskState, *, taken: bool = False) -> int:
        """Tasks in ``state``."""
        return sum(task.state is state and task.taken is taken for task in self.tasks)


def scene_of(mission_state: MissionState, now_s: float) -> Scene:
    """What ``mission_state`` knows at ``now_s``, in its own clock's seconds."""
    result = mission_state.result()
    mission, plan, epoch = mission_state.mission, mission_state.plan, mission_state.replica.epoch
    mission_s, cut_since_s = mission_state.mission_s(now_s), mission_state.cut_since_s
    numbers = {uav.id: number for number, uav in enumerate(mission.uavs)}
    by: dict[str, int] = {}
    for uav_id, route in result.executed_routes.items():
        for task_id in route:
            by.setdefault(task_id, numbers[uav_id])
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
    planned_objective = _worth_of(mission_state, epoch) if plan is None else plan.objective
    return Scene(
        mission=mission,
        phase=mission_state.phase,
        mission_s=mission_s,
        rule=epoch.rule if epoch is not None else None if plan is None else plan.method,
        sequence=tuple(sequence),
        uavs=tuple(
            _uav_view(
                mission_state,
                uav,
                short,
                mission_s,
                flown=result.executed_routes[uav.id],
                planned=tuple(TaskId(t) for t in lists.get(uav.id, ()) if t not in over),
                number=numbers[uav.id],
                now_s=now_s,
            )
            for uav, short in zip(mission.uavs, shorts, strict=True)
        ),
        tasks=_task_views(mission_state, by, numbers),
        objective=result.executed_objective,
        planned_objective=planned_objective,
        optimum=None if plan is None else plan.optimum,
        cut_s=None if cut_since_s is None or deserted(mission_state) else now_s - cut_since_s,
        coordinator=COORDINATOR in mission_state.present,
        commands=tuple(in_force(mission_state.replica).values()),
        dropped=sum(count.total() for count in mission_state.dropped.values()),
    )


def uav_activity(mission_state: MissionState, uav: str) -> tuple[str, TaskId | None]:
    """What ``uav`` does, as `UavView.does` has it, and the task it has taken."""
    status = mission_state.statuses.get(uav)
    claim = mission_state.replica.claims.get(uav)
    does: str = STARTING if status is None else status.phase
    task = None if claim is None or claim.task is None else TaskId(claim.task)
    if uav in mission_state.lost and uav not in mission_state.present:
        return LOST, None
    if task is not None and does not in _BUSY:
        does = StatusPhase.FLYING  # claims never lag, status may
    elif claim is not None and does == STARTING:
        does = _PHASES.get(claim.phase, StatusPhase.IDLE)
    elif task is None and does in _BUSY:
        does = StatusPhase.IDLE
    return does, task


def uav_position(mission_state: MissionState, uav: str) -> tuple[float, float, float] | None:
    """Where ``uav`` is, in its height layer [m; mission origin]; None as long as it has not told.

    Agents tell it without the layer, as if all flew at the height of their tasks.
    """
    status, brief = mission_state.statuses.get(uav), mission_state.replica.brief
    if status is None or status.position_enu_m is None:
        return None
    layers_m = {} if brief is None else {each.id: each.layer_m for each in brief.uavs}
    east_m, north_m, up_m = status.position_enu_m
    return east_m, north_m, up_m + layers_m.get(uav, 0.0)


def _worth_of(mission_state: MissionState, epoch: PlanEpoch | None) -> float | None:
    """J of the lists in force, flown from the start as planned; None where there are none."""
    problem = mission_state.board.problem
    if problem is None or epoch is None or not any(epoch.routes.values()):
        return None
    index = {task: number for number, task in enumerate(problem.task_ids)}
    lists = [
        [index[TaskId(task)] for task in epoch.routes.get(uav, ()) if task in index]
        for uav in problem.uav_ids
    ]
    tasks = [task for route in lists for task in route]
    # What two have visited stands on two lists: such lists are no plan any more.
    return evaluate(problem, lists)[0] if len(set(tasks)) == len(tasks) else None


def _uav_view(
    mission_state: MissionState,
    uav: Uav,
    short: str,
    mission_s: float | None,
    *,
    flown: tuple[TaskId, ...],
    planned: tuple[TaskId, ...],
    number: int,
    now_s: float,
) -> UavView:
    status = mission_state.statuses.get(uav.id)
    claim = mission_state.replica.claims.get(uav.id)
    does, task = uav_activity(mission_state, uav.id)
    eta_s = None
    if claim is not None and task is not None and mission_s is not None:
        eta_s = claim.completion_s - mission_s
    place = None if status is None else status.position_enu_m
    return UavView(
        id=uav.id,
        short=short,
        number=number,
        does=does,
        task=task,
        eta_s=eta_s,
        flown=flown,
        planned=planned,
        battery_frac=None if status is None else status.battery_frac,
        note="" if status is None else status.note,
        there=uav.id in mission_state.present,
        silent_s=mission_state.silent_s(uav.id, now_s),
        start_enu_m=uav.position_enu_m,
        position_enu_m=uav.position_enu_m if place is None else place,
    )


def _task_views(
    mission_state: MissionState, by: dict[str, int], numbers: dict[UavId, int]
) -> tuple[TaskView, ...]:
    """The board; before there is one, what the scenario tells at the start."""
    holders, states = mission_state.holders, mission_state.board.states
    if not states:
        known = mission_state.mission.known_at_start().tasks
        return tuple(
            TaskView(task.id, task.position_enu_m, TaskState.OPEN, taken=False, uav=None)
            for task in known
        )
    views = []
    for task_id, state in states.items():
        holder = holders.get(task_id)
        uav = by.get(task_id) if holder is None else numbers.get(UavId(holder))
        place = mission_state.replica.board[task_id].position_enu_m
        views.append(TaskView(TaskId(task_id), place, state, holder is not None, uav))
    return tuple(views)
