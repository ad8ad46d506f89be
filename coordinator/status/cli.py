"""The command `swarm status`.

Leaves out: looking (coordinator.status.onlooker) and showing (coordinator.status.table).
"""

from __future__ import annotations

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
    from coordinator.status.table import MissionStatus
    from swarm.bus.config import BusConfig
    from swarm.clock import ScaledClock
    from swarm.config import Timing

__all__ = ["status"]


def status(
    mission: SomeMissionOption = None,
    timeout_s: Annotated[
        float,
        typer.Option(
            "--timeout-s",
            min=0.1,
            max=600.0,
            metavar="S",
            help="How long to wait for the bus, and for what is still unknown; wall seconds.",
        ),
    ] = 4.0,
    bus: BusOption = "router",
    listen: ListenOption = "",
    connect: ConnectOption = None,
    link: LinkOption = Link.NORMAL,
    lease_s: LeaseOption = None,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
) -> int:
    """Show how a running mission stands: phase, tasks, and what each UAV does.

    Joins the mission as an onlooker, learns, prints and leaves; nobody flies any
    differently for it. Exit status 1: nobody flies the mission.

    Examples:
        swarm status
        swarm status --mission table-1 --json
        swarm status --connect tcp/192.168.1.2:7447
    """
    import asyncio
    from json import dumps

    from rich.console import Console

    from coordinator.status.table import status_as_json, status_table
    from coordinator.view.signs import signs_for
    from swarm.bus.config import bus_config
    from swarm.clock import ScaledClock
    from swarm.config import preset
    from swarm.log import LogLevel, configure_logging
    from swarm.model.ids import ID_RULE, valid_id
    from swarm.process import run_until_stopped

    configure_logging(LogLevel.ERROR)
    settings = preset(link, lease_s)
    config = bus_config(bus, listen, connect or (), settings.lease_s)
    timing = settings.timing.scaled(speedup)
    if mission is not None and not valid_id(mission):
        raise InputError(Fault("--mission", "", f"{mission!r} is no id", f"give {ID_RULE}"))

    async def work() -> int:
        found = await _look(mission, config, timing, ScaledClock(speedup), timeout_s)
        if json:
            print(dumps(status_as_json(found), allow_nan=False))
        else:
            console = Console(highlight=False)
            signs = signs_for(console.options.ascii_only)
            console.print(status_table(found, console.width, signs))
        return 0

    return asyncio.run(run_until_stopped(work()))


async def _look(
    name: str | None, config: BusConfig, timing: Timing, clock: ScaledClock, patience_s: float
) -> MissionStatus:
    """Learn how a mission stands."""
    from coordinator.status.onlooker import Onlooker, only_mission
    from coordinator.status.table import mission_status
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.events import BusFact, Wish
    from swarm.shell import Shell, take_seat

    seat = await open_zenoh_bus(config, timeout_s=patience_s)
    try:
        mission = name or await only_mission(seat, patience_s)
        onlooker = Onlooker(mission, timing, patience_s * clock.speedup)
        shell: Shell[BusFact, Wish] = Shell(
            onlooker,
            seat,
            clock,
            mission=mission,
            name="status",
            from_bus=lambda fact: fact,
            execute=lambda _: None,
            snapshot=None,
        )
        take_seat(seat, mission, None, status=True)
        if await shell.run() != 0:
            raise SwarmError(onlooker.lack)
        return mission_status(onlooker.observer, clock.now_s())
    finally:
        seat.close()
