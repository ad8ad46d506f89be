"""The command `swarm foxglove`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.bus.connection import DEFAULT_CONNECTION, ConnectionOptions
from swarm.runtime.errors import BusError, Fault, InputError
from swarm.runtime.log import LogFormat, LogLevel
from swarm.runtime.option_groups import with_options
from swarm.runtime.options import (
    CheckOption,
    HostOption,
    JsonOption,
    LifelineOption,
    LogFormatOption,
    LogLevelOption,
    PortOption,
    SomeMissionOption,
    SpeedupOption,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from coordinator.dashboard.operator_session import OperatorSession
    from coordinator.foxglove.live_core import LiveCore
    from swarm.bus.config import BusConfig
    from swarm.bus.port import Bus

LOOK_S = 0.1
"""Wall time between two looks for whether a picture is due."""


@with_options
def foxglove(
    mission: SomeMissionOption = None,
    host: HostOption = "127.0.0.1",
    port: PortOption = 8765,
    token_file: Annotated[
        Path | None,
        typer.Option(
            "--token-file",
            metavar="FILE",
            help="File that holds the token, readable by its owner alone; else "
            "SWARM_DASHBOARD_TOKEN. The URL ends in ?token=TOKEN then. Default: none on "
            "loopback, elsewhere a new one, which is printed.",
            show_default=False,
        ),
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-host",
            metavar="NAME",
            help="Another name under which viewers ask for this server; may be repeated.",
            show_default=False,
        ),
    ] = None,
    allow_origin: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-origin",
            metavar="URL",
            help="Another page that may look on, such as https://lichtblick.example.org; may be "
            "repeated. Without: programs, app.foxglove.dev, and pages of this machine.",
            show_default=False,
        ),
    ] = None,
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Show a mission live in Foxglove, or in Lichtblick.

    Joins a mission as an observer, or waits for one, and serves the messages of a recording as
    they come. In the viewer choose Open connection, Foxglove WebSocket, and give the URL that is
    printed. Nobody flies any differently for it, and a viewer that is too slow misses messages,
    which are counted. Ctrl-C ends it, and nothing else.

    Examples:
        swarm foxglove
        swarm foxglove --keys keys/viewer --connect tls/192.168.1.2:7447
        swarm foxglove --host 0.0.0.0 --token-file token
        swarm foxglove --allow-origin https://lichtblick.example.org
    """
    import asyncio
    import os
    from json import dumps

    from coordinator.dashboard.access import access_for, listen, read_token, url_of
    from coordinator.dashboard.live_mission import LiveMission
    from coordinator.foxglove.channels import LiveChannels
    from coordinator.foxglove.live_core import LiveCore
    from coordinator.foxglove.server import ViewerRules, serving_live
    from coordinator.joining import check_mission
    from coordinator.recording.flight_recorder import wall_ns
    from coordinator.recording.recorder import RecordingInfo
    from swarm import __version__
    from swarm.identity import Role
    from swarm.runtime.clock import ScaledClock
    from swarm.runtime.log import configure_logging
    from swarm.runtime.process import SERVICE_NOTIFIER, run_until_stopped

    configure_logging(log_level, log_format)
    check_mission(mission)
    network = seat.found(mission).network

    def found() -> BusConfig:
        # Looked for again and again: a run of this machine may begin later than this.
        roles = (Role.VIEWER, Role.OPERATOR, Role.COORDINATOR)
        return seat.found(mission).config(mission=mission, roles=roles)

    config = found()
    access, made = access_for(host, allow_host or (), read_token(token_file, os.environ))
    rules = ViewerRules(access, _origins(allow_origin or ()))
    if check:
        return 0
    taken = listen(host, port)
    url = "ws" + url_of(host, taken.getsockname()[1]).removeprefix("http")
    if made:
        url += f"?token={access.token}"
    print(dumps({"url": url}) if json else f"foxglove: {url}", flush=True)

    clock, channels, time_ns = ScaledClock(speedup), LiveChannels(f"swarm {__version__}"), wall_ns()
    core: LiveCore | None = None

    def around(name: str, session: OperatorSession) -> LiveCore:
        nonlocal core
        about = RecordingInfo(name, network.timing.scaled(speedup), speedup)
        core = LiveCore(session, about, channels, time_ns)
        return core

    source = LiveMission(
        mission or config.mission,
        lambda: _open_bus(found),
        network,
        clock,
        speedup,
        may_order=False,
        around=around,
        name="foxglove",
    )

    async def work() -> int:
        async with serving_live(channels, rules, taken):
            looking_on = asyncio.get_running_loop().create_task(source.run())
            SERVICE_NOTIFIER.ready(f"shows {mission or 'any mission'} at port {port}")
            try:
                while not looking_on.done():
                    if core is not None:
                        core.look(clock.now_s())
                    await asyncio.wait((looking_on,), timeout=LOOK_S)
                looking_on.result()
            finally:
                looking_on.cancel()
                await asyncio.gather(looking_on, return_exceptions=True)
        return 0

    return asyncio.run(run_until_stopped(work(), lifeline=lifeline))


async def _open_bus(place: Callable[[], BusConfig]) -> Bus:
    """A seat on the bus, however long that takes."""
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.runtime.log import get_logger

    while True:
        try:
            return await open_zenoh_bus(place())
        except BusError as fault:
            get_logger("foxglove").warning("no bus yet", reason=str(fault))


def _origins(told: Sequence[str]) -> frozenset[str]:
    from urllib.parse import urlsplit

    for origin in told:
        parts = urlsplit(origin)
        if not parts.scheme or not parts.netloc or origin != f"{parts.scheme}://{parts.netloc}":
            remedy = "write SCHEME://HOST[:PORT], and nothing behind it"
            raise InputError(Fault("--allow-origin", "", f"{origin!r} is no origin", remedy))
    return frozenset(told)
