"""The commands `swarm hold`, `resume`, `return` and `abort`.

Leaves out: giving a command on the bus and seeing what comes of it (coordinator.operator.seat).
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.config import Link
from swarm.errors import Fault, InputError, SwarmError
from swarm.options import (
    BusOption,
    ConnectOption,
    JsonOption,
    LeaseOption,
    LinkOption,
    ListenOption,
    SomeMissionOption,
    SpeedupOption,
)

if TYPE_CHECKING:
    from coordinator.operator.errands import OperatorWish
    from coordinator.operator.seat import OperatorSeat
    from swarm.bus.config import BusConfig
    from swarm.clock import ScaledClock
    from swarm.config import Timing

__all__ = ["abort", "hold", "resume", "return_home"]

UavArgument = Annotated[str, typer.Argument(metavar="UAV", help="Id of the UAV.")]
ReasonOption = Annotated[
    str,
    typer.Option(
        "--reason", metavar="TEXT", help="Why; told in status, logs and story.", show_default=False
    ),
]
TimeoutOption = Annotated[
    float,
    typer.Option(
        "--timeout-s",
        min=0.1,
        max=600.0,
        metavar="S",
        help="How long to wait for the mission, and then for the command to take effect; "
        "wall seconds.",
    ),
]
LONGEST_REASON = 150
"""What is told of a command has to have room in a status."""


def _of_one_uav(kind: str, help_text: str) -> Callable[..., int]:
    """The command that says ``kind`` to one UAV."""

    def command(
        uav: UavArgument,
        reason: ReasonOption = "",
        mission: SomeMissionOption = None,
        timeout_s: TimeoutOption = 10.0,
        bus: BusOption = "router",
        listen: ListenOption = "",
        connect: ConnectOption = None,
        link: LinkOption = Link.NORMAL,
        lease_s: LeaseOption = None,
        speedup: SpeedupOption = 1.0,
        json: JsonOption = False,
    ) -> int:
        return _give(
            kind,
            uav,
            reason,
            mission,
            timeout_s,
            _bus_config(bus, listen, connect, link, lease_s),
            link,
            speedup,
            json=json,
        )

    command.__doc__ = help_text
    return command


hold = _of_one_uav(
    "hold",
    """Stop one UAV where it is: it gives its task up, takes no other and hovers.

    Before take-off it stays on the ground. The others go on, and take over what it leaves.
    It goes on after `swarm resume`, and comes home after `swarm return`; its battery's
    reserve or the end of its own process bring it home in any case. Works without a
    coordinator. Exit status 1: it was not seen to obey, and the line says why.

    Examples:
        swarm hold uav2
        swarm hold uav2 --reason "helicopter in sight" --connect tcp/192.168.1.2:7447
    """,
)

resume = _of_one_uav(
    "resume",
    """Let a UAV go on that was stopped by `swarm hold`: it takes part in the mission again.

    One that was stopped on its way home goes on home.

    Examples:
        swarm resume uav2
    """,
)

return_home = _of_one_uav(
    "return",
    """Send one UAV home: it gives its task up, lands, and its agent ends with 0.

    The others take over what it leaves. It takes no further part in this flight of the
    mission, unless its agent is started anew with --rejoin.

    Examples:
        swarm return uav2 --reason "camera failed"
    """,
)


def abort(
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask on a terminal.")] = False,
    reason: ReasonOption = "",
    mission: SomeMissionOption = None,
    timeout_s: TimeoutOption = 10.0,
    bus: BusOption = "router",
    listen: ListenOption = "",
    connect: ConnectOption = None,
    link: LinkOption = Link.NORMAL,
    lease_s: LeaseOption = None,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Bring every UAV home at once and end the mission.

    Works without a coordinator; one that is started later ends the mission, too. Nothing
    takes an abort back. Exit status 1: somebody was not seen to obey, and the line says who.

    Examples:
        swarm abort
        swarm abort --yes --reason "thunderstorm" --mission valley-survey
    """
    from swarm.model.ids import FLEET

    config = _bus_config(bus, listen, connect, link, lease_s)
    asks = not yes and sys.stdin is not None and sys.stdin.isatty()
    what = "the mission" if mission is None else f"mission {mission}"
    if asks and not typer.confirm(f"Bring every UAV home and end {what}?", err=True):
        raise SwarmError("nothing was aborted")
    return _give("abort", FLEET, reason, mission, timeout_s, config, link, speedup, json=json)


def _bus_config(
    bus: str, listen: str, connect: list[str] | None, link: Link, lease_s: float | None
) -> BusConfig:
    from swarm.bus.config import bus_config
    from swarm.config import preset

    return bus_config(bus, listen, connect or (), preset(link, lease_s).lease_s)


def _give(
    name: str,
    target: str,
    reason: str,
    mission: str | None,
    timeout_s: float,
    config: BusConfig,
    link: Link,
    speedup: float,
    *,
    json: bool,
) -> int:
    """Give the command of that name, and say what came of it."""
    import asyncio
    from json import dumps

    from coordinator.operator.commanding import CommandWish
    from coordinator.operator.verdict import Result
    from swarm.clock import ScaledClock
    from swarm.config import preset
    from swarm.log import LogLevel, configure_logging
    from swarm.model.ids import ID_RULE, valid_id
    from swarm.process import run_until_stopped
    from swarm.wire.messages import CommandKind

    configure_logging(LogLevel.ERROR)
    timing = preset(link).timing.scaled(speedup)
    given = (("--mission", mission), ("UAV", target))
    faults = [
        Fault(where, "", f"{text!r} is no id", f"give {ID_RULE}")
        for where, text in given
        if text is not None and not valid_id(text)
    ]
    if len(reason) > LONGEST_REASON:
        problem = f"it has {len(reason)} characters"
        faults.append(Fault("--reason", "", problem, f"give at most {LONGEST_REASON}"))
    if faults:
        raise InputError(*faults)
    wish = CommandWish(CommandKind(name), target, reason)

    async def work() -> int:
        clock = ScaledClock(speedup)
        of, seat = await sit(mission, wish, config, timing, clock, timeout_s)
        verdict = seat.verdict
        if verdict is None:
            raise SwarmError("the command was not given")
        if verdict.result is Result.UNKNOWN_UAV:
            problem = f"{target!r} is not in mission {of}"
            raise InputError(Fault("UAV", "", problem, verdict.text))
        obeyed = verdict.result is Result.OBEYED
        if json:
            told = {
                "mission": of,
                "command": name,
                "target": target,
                "reason": reason,
                "obeyed": obeyed,
                "text": verdict.text,
                "uavs": seat.does,
            }
            print(dumps(told))
        elif obeyed:
            print(verdict.text)
        if not obeyed:
            raise SwarmError(verdict.text)
        return 0

    return asyncio.run(run_until_stopped(work()))


async def sit(
    name: str | None,
    wish: OperatorWish,
    config: BusConfig,
    timing: Timing,
    clock: ScaledClock,
    patience_s: float,
) -> tuple[str, OperatorSeat]:
    """Take a seat on the bus and say what is wanted; the mission's name, and the seat."""
    from coordinator.joining import joined, onlooking
    from coordinator.operator.seat import OperatorSeat
    from swarm.clock import incarnation
    from swarm.model.ids import OPERATOR

    async with joined(name, config, patience_s) as (mission, bus):
        seat = OperatorSeat(
            mission,
            wish,
            incarnation=incarnation(),
            timing=timing,
            patience_s=patience_s * clock.speedup,
        )
        await onlooking(seat, bus, clock, mission, OPERATOR).run()
        return mission, seat
