"""What a page may say, field by field; what does not fit is told in one sentence."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, ClassVar, Final

from annotated_types import Ge, Gt, Le, Len
from pydantic import Strict, ValidationError

from coordinator.operator.commands import CommandRequest, StartRequest
from coordinator.operator.readiness import ReadyRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal
from coordinator.operator.zone_edits import NewZone, ZoneRemoval
from swarm.model.ids import FLEET
from swarm.protocol.fields import Duration, Flag, FlatPoint, Id, Metres, Point, Value
from swarm.protocol.messages import CommandKind

Reason = Annotated[str, Strict(), Len(0, 150)]
"""What is told of a command has to have room in a status."""
Rate = Annotated[float, Strict(), Gt(0.0), Le(1000.0)]
Moment = Annotated[float, Strict(), Ge(0.0), Le(1e9)]


_CHECKED: Final = {"extra": "forbid", "allow_inf_nan": False}
"""A page is served by the process it speaks to, so it has no fields of a newer release."""


class CommandName(StrEnum):
    """What may be commanded: the kinds of commands, to start without a UAV, and that one on the
    ground may start again."""

    HOLD = "hold"
    RESUME = "resume"
    RETURN = "return"
    START = "start"
    READY = "ready"
    ABORT = "abort"


@dataclass(frozen=True, slots=True)
class CommandInput:
    """Body of ``/api/command``."""

    __pydantic_config__: ClassVar = _CHECKED

    command: CommandName
    uav: Id | None = None
    """None for abort alone."""
    reason: Reason = ""

    def __post_init__(self) -> None:
        if (self.command is CommandName.ABORT) != (self.uav is None):
            one = self.command is not CommandName.ABORT
            raise ValueError(f"{self.command} concerns {'one UAV: name it' if one else 'all UAVs'}")

    @property
    def wish(self) -> CommandRequest | StartRequest | ReadyRequest:
        """What the operator wants."""
        if self.command is CommandName.READY:
            return ReadyRequest(self.uav or "", self.reason)
        if self.command is CommandName.START:
            return StartRequest(self.uav or "", self.reason)
        return CommandRequest(CommandKind(self.command.value), self.uav or FLEET, self.reason)


@dataclass(frozen=True, slots=True)
class TaskInput:
    """Body of ``/api/task``."""

    __pydantic_config__: ClassVar = _CHECKED

    position: Point
    """East, north, up [m; mission origin]."""
    value: Value | None = None
    """None for the median of the board's."""
    id: Id | None = None
    service_s: Duration = 0.0
    kind: Id | None = None
    reason: Reason = ""

    @property
    def wish(self) -> NewTask:
        """What the operator wants."""
        return NewTask(self.position, self.id, self.value, self.service_s, self.kind, self.reason)


@dataclass(frozen=True, slots=True)
class WithdrawalInput:
    """Body of ``/api/task/withdraw``."""

    __pydantic_config__: ClassVar = _CHECKED

    id: Id
    reason: Reason = ""

    @property
    def wish(self) -> TaskWithdrawal:
        """What the operator wants."""
        return TaskWithdrawal(self.id, self.reason)


@dataclass(frozen=True, slots=True)
class ZoneInput:
    """Body of ``/api/zone``."""

    __pydantic_config__: ClassVar = _CHECKED

    id: Id
    polygon: Annotated[tuple[FlatPoint, ...], Len(3)]
    """Corners, east and north [m; mission origin]."""
    floor_m: Metres | None = None
    ceiling_m: Metres | None = None
    inclusive: Flag = False
    reason: Reason = ""

    def __post_init__(self) -> None:
        # What is wrong with the polygon is told like any other fault of the input.
        str(self.wish)

    @property
    def wish(self) -> NewZone:
        """What the operator wants."""
        return NewZone(
            self.id,
            self.polygon,
            floor_m=self.floor_m,
            ceiling_m=self.ceiling_m,
            inclusive=self.inclusive,
            reason=self.reason,
        )


@dataclass(frozen=True, slots=True)
class ZoneRemovalInput:
    """Body of ``/api/zone/remove``."""

    __pydantic_config__: ClassVar = _CHECKED

    id: Id
    reason: Reason = ""

    @property
    def wish(self) -> ZoneRemoval:
        """What the operator wants."""
        return ZoneRemoval(self.id, self.reason)


@dataclass(frozen=True, slots=True)
class PlaybackInput:
    """Body of ``/api/recording``."""

    __pydantic_config__: ClassVar = _CHECKED

    playing: Flag | None = None
    speed: Rate | None = None
    t_s: Moment | None = None


def fault_of(error: ValidationError) -> str:
    """The first thing that is wrong, in one sentence."""
    first = error.errors(include_url=False, include_context=False, include_input=False)[0]
    place = ".".join(map(str, first["loc"]))
    problem = first["msg"].removeprefix("Value error, ")
    problem = problem[:1].lower() + problem[1:]
    return f"{place}: {problem}" if place else problem
