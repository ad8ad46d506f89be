"""Submit one request from a terminal: reach the mission, say it, and wait for what comes of it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass

from coordinator.joining import joined, observer_shell
from coordinator.operator.commands import (
    CommandRequest,
    RequestResult,
    RequestVerdict,
    StartRequest,
)
from coordinator.operator.readiness import ReadyRequest
from coordinator.operator.requests import OperatorClient, OperatorRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal
from coordinator.operator.zone_edits import NewZone, ZoneRemoval
from swarm.bus.connection import ConnectionOptions
from swarm.identity import Role
from swarm.model.ids import ID_RULE, OPERATOR, valid_id
from swarm.runtime.clock import ScaledClock, incarnation
from swarm.runtime.errors import Fault, InputError, SwarmError
from swarm.runtime.log import LogLevel, configure_logging
from swarm.runtime.process import run_until_stopped

LONGEST_REASON = 150
"""What is told of a command has to have room in a status."""


@dataclass(frozen=True, slots=True)
class MissionConnection:
    """How to reach a mission, as the common options have it."""

    mission: str | None
    """Its name; None for the only one there is."""
    timeout_s: float
    """How long to wait for it, and then for the effect [wall s]."""
    seat: ConnectionOptions
    speedup: float


def check_reason_and_ids(reason: str, *ids: tuple[str, str | None]) -> None:
    """Refuse what no message can carry; ``ids`` are what was given, and where.

    Raises:
        InputError: one line for each fault.
    """
    faults = [
        Fault(where, "", f"{text!r} is no id", f"give {ID_RULE}")
        for where, text in ids
        if text is not None and not valid_id(text)
    ]
    if len(reason) > LONGEST_REASON:
        problem = f"it has {len(reason)} characters"
        faults.append(Fault("--reason", "", problem, f"give at most {LONGEST_REASON}"))
    if faults:
        raise InputError(*faults)


def submit_request(
    wish: OperatorRequest,
    reach: MissionConnection,
    *,
    source: str,
    tell: Callable[[str, OperatorClient, RequestVerdict], None],
) -> int:
    """Say what is wanted, wait for what comes of it, and tell; the exit status.

    Args:
        wish: what is wanted.
        reach: how to reach the mission.
        source: argument that what does not fit the mission came from.
        tell: told the mission's name, the seat and what came of it, unless nothing was said
            for wrong input.

    Raises:
        InputError: what is wanted does not fit the mission.
        SwarmError: there is no mission, or it was not seen to take effect.
    """
    configure_logging(LogLevel.ERROR)

    async def work() -> int:
        mission, seat = await _submit(wish, reach)
        verdict = seat.verdict
        if verdict is None:
            raise SwarmError("nothing was said")
        if verdict.result.is_wrong_input:
            name = _named(wish)
            taken = verdict.result is RequestResult.TAKEN_ID
            problem = f"{name!r} is {'taken' if taken else 'not'} in mission {mission}"
            raise InputError(Fault(source, "", problem, verdict.text))
        tell(mission, seat, verdict)
        if verdict.result is not RequestResult.OBEYED:
            raise SwarmError(verdict.text)
        return 0

    return asyncio.run(run_until_stopped(work()))


def _named(wish: OperatorRequest) -> str | None:
    """What it is about, by its id."""
    match wish:
        case CommandRequest() | StartRequest() | ReadyRequest():
            return wish.target
        case NewZone() | ZoneRemoval():
            return wish.zone
        case NewTask() | TaskWithdrawal():
            return wish.task


async def _submit(wish: OperatorRequest, reach: MissionConnection) -> tuple[str, OperatorClient]:
    """Take a seat on the bus and say what is wanted; the mission's name, and the seat."""
    place = reach.seat.found(reach.mission, operator=True)
    settings = place.network
    config = place.config(mission=reach.mission, roles=(Role.OPERATOR,))
    clock = ScaledClock(reach.speedup)
    async with joined(reach.mission, config, reach.timeout_s) as (mission, bus):
        seat = OperatorClient(
            mission,
            wish,
            incarnation=incarnation(),
            timing=settings.timing.scaled(reach.speedup),
            patience_s=reach.timeout_s * reach.speedup,
        )
        await observer_shell(seat, bus, clock, mission, OPERATOR).run()
        return mission, seat
