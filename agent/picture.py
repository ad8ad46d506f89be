"""The mission as one agent sees it: its UAV's entry and place, the clock, what is open.

Leaves out: what follows from a change (agent.core), and whose claims count
(agent.peers).
"""

from __future__ import annotations

from enum import Enum

from agent.vehicle import Telemetry
from swarm.state.board import TaskBoard, TaskState
from swarm.state.mission_clock import MissionClock
from swarm.state.registers import Replica
from swarm.wire.bounds import Point
from swarm.wire.messages import (
    Board,
    Brief,
    Claim,
    Epoch,
    EpochPhase,
    Fleet,
    Message,
    Outcome,
    Result,
    TaskOrder,
)

__all__ = ["News", "Picture"]


class News(Enum):
    """What a statement changes for an agent that is free to take a task."""

    APPEARANCE = "a task that nobody knew of"
    OPENING = "a task may have opened"
    CLAIM = "somebody's claim, which opens nothing"
    OTHER = "anything else"


class Picture:
    """The mission in the eyes of the agent of ``uav``.

    Args:
        mission: mission name.
        uav: id of the UAV.
        replica: the shared registers.
    """

    def __init__(self, mission: str, uav: str, replica: Replica) -> None:
        self.board = TaskBoard(replica, mission)
        self.telemetry: Telemetry | None = None
        """The newest of the own vehicle."""
        self.place_enu_m: Point | None = None
        """Where the UAV is [m; mission origin], without its height layer."""
        self._uav = uav
        self._replica = replica
        self._clock = MissionClock()
        self._brief: Brief | None = None
        self._me: Fleet | None = None
        """The UAV's entry in that brief."""

    # -- the registers --------------------------------------------------------------

    def take_in(self, message: Message) -> News | None:
        """Join another's statement; gives what it changes, None if it was known."""
        if self.running and self._replica.is_premature(message):
            return None
        before, epoch = self._replica.claims.get(message.writer), self._replica.epoch
        brief = self._replica.brief
        body, board = message.body, self._replica.board
        entry = board.get(body.task) if isinstance(body, Board | TaskOrder) else None
        if not self._replica.join(message):
            return None
        self._clock.heed(body, brief, epoch)
        match body:
            case Board(task=task) | TaskOrder(task=task) if entry is None and task in board:
                return News.APPEARANCE
            case TaskOrder(task=task):
                return News.OTHER if board.get(task) == entry else News.OPENING
            case Brief() | Board() | Outcome(result=Result.FAILED):
                return News.OPENING
            case Claim(task=task):
                left = before is not None and before.task != task and self.is_open(before.task)
                return News.OPENING if left else News.CLAIM
            case Epoch(number=number) if epoch is None or number != epoch.number:
                return News.OPENING
            case _:
                return News.OTHER

    def is_open(self, task: str | None) -> bool:
        """Whether that is a task which is still to be done."""
        return task is not None and self.board.states.get(task) is TaskState.OPEN

    @property
    def unfinished(self) -> bool:
        """Whether any task is open."""
        return self.board.unfinished

    @property
    def running(self) -> bool:
        """Whether the mission has begun, at a known time, and has not ended."""
        epoch = self._replica.epoch
        over = epoch is None or epoch.phase is EpochPhase.ENDED
        return self._clock.is_set and not over

    # -- the mission clock ------------------------------------------------------------

    def hear_time(self, mission_s: float, now_s: float) -> float | None:
        """Somebody says that it is ``mission_s``; see `MissionClock`.

        Returns:
            By how much the clock was put forward [s], negative if back; None if that set it.
        """
        known = self._clock.is_set
        change_s = self._clock.hear(mission_s, now_s)
        return change_s if known else None

    @property
    def knows_time(self) -> bool:
        """Whether mission time is known."""
        return self._clock.is_set

    def known_mission_s(self, now_s: float) -> float | None:
        """Mission time [s]; None while it is not known."""
        return self._clock.mission_s(now_s)

    def mission_s(self, now_s: float) -> float:
        """Mission time [s]; 0 as long as the mission is not known to have begun."""
        return self._clock.mission_s(now_s) or 0.0

    # -- the UAV ----------------------------------------------------------------------

    @property
    def me(self) -> Fleet | None:
        """The UAV's entry in the brief."""
        brief = self._replica.brief
        if brief is not self._brief:
            self._brief = brief
            fleet = () if brief is None else brief.uavs
            self._me = next((uav for uav in fleet if uav.id == self._uav), None)
        return self._me

    def move(self, telemetry: Telemetry) -> None:
        """The vehicle has told where it is."""
        east_m, north_m, up_m = telemetry.position_enu_m
        self.telemetry = telemetry
        self.place_enu_m = east_m, north_m, up_m - self._layer_m

    def in_layer(self, point: Point) -> Point:
        """That point in the UAV's own height layer, where it flies."""
        return point[0], point[1], point[2] + self._layer_m

    @property
    def _layer_m(self) -> float:
        me = self.me
        return 0.0 if me is None else me.layer_m
