"""Services by which ROS 2 gives orders: what each request asks for, and what is answered.

Pure: a request comes as its fields, an answer goes as its fields.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from coordinator.dashboard.source import CommandRow, CommandState
from coordinator.operator.commands import CommandRequest
from coordinator.operator.requests import OperatorRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal, Wgs84
from coordinator.ros2.message_types import PACKAGE, Fields
from swarm.model.ids import FLEET
from swarm.protocol.fields import Point
from swarm.protocol.messages import CommandKind

Asked = Mapping[str, Any]
"""The fields of a request, all of them."""


@dataclass(frozen=True, slots=True)
class RosService:
    """One service."""

    name: str
    """Below the node's own name."""
    type: str
    wish: Callable[[Asked], OperatorRequest]
    """What a request asks for.

    Raises:
        ValueError: it makes no sense; says what would.
    """
    names_task: bool = False
    """Whether its answer has the id of a task."""

    def answer(self, row: CommandRow) -> Fields:
        """What is told of an order whose result is known."""
        told = {"success": row.state is CommandState.OBEYED, "message": row.result}
        return told | ({"task": row.task or ""} if self.names_task else {})

    def refusal(self, text: str) -> Fields:
        """What is told of one that was not given, or of which nothing will be known."""
        return {"success": False, "message": text}


MOST_REASON: Final = 150
"""Of what is told as a reason: it has to have room in a status."""


def _reason(asked: Asked) -> str:
    reason: str = asked["reason"]
    if len(reason) > MOST_REASON:
        raise ValueError(f"a reason has at most {MOST_REASON} characters")
    return reason


def _new_task(asked: Asked) -> OperatorRequest:
    points, geo_points = asked["points"], asked["geo_points"]
    if bool(points) == bool(geo_points):
        raise ValueError("give either points or geo_points")
    places: list[Point | Wgs84] = [(point["x"], point["y"], point["z"]) for point in points] or [
        Wgs84(at["latitude"], at["longitude"], at["altitude"] if asked["use_altitude"] else None)
        for at in geo_points
    ]
    return NewTask(
        places[0] if len(places) == 1 else None,
        task=asked["task"] or None,
        value=asked["value"] or None,
        service_s=asked["service_s"],
        kind=asked["kind"] or None,
        reason=_reason(asked),
        due_s=asked["due_s"] or None,
        opens_s=asked["opens_s"],
        closes_s=asked["closes_s"] or None,
        path=tuple(places) if len(places) > 1 else (),
    )


def _withdrawal(asked: Asked) -> OperatorRequest:
    return TaskWithdrawal(asked["task"], _reason(asked))


def _command(kind: CommandKind) -> Callable[[Asked], OperatorRequest]:
    def wish(asked: Asked) -> OperatorRequest:
        if asked["uav"] in ("", FLEET):
            raise ValueError("name the one UAV that it is for")
        return CommandRequest(kind, asked["uav"], _reason(asked))

    return wish


SERVICES: Final = (
    RosService("add_task", f"{PACKAGE}/srv/AddTask", _new_task, names_task=True),
    RosService("withdraw_task", f"{PACKAGE}/srv/WithdrawTask", _withdrawal),
    *(
        RosService(kind.value, f"{PACKAGE}/srv/CommandUav", _command(kind))
        for kind in (CommandKind.HOLD, CommandKind.RESUME, CommandKind.RETURN)
    ),
)
