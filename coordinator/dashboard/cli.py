"""The command `swarm dashboard`."""

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
    from coordinator.dashboard.feed import PageSettings
    from swarm.bus.port import Bus


@with_options
def dashboard(
    mission: SomeMissionOption = None,
    host: HostOption = "127.0.0.1",
    port: PortOption = 8080,
    token_file: Annotated[
        Path | None,
        typer.Option(
            "--token-file",
            metavar="FILE",
            help="File that holds the token, readable by its owner alone; else "
            "SWARM_DASHBOARD_TOKEN. Default: none on loopback, elsewhere a new one, which is "
            "printed.",
            show_default=False,
        ),
    ] = None,
    allow_host: Annotated[
        list[str] | None,
        typer.Option(
            "--allow-host",
            metavar="NAME",
            help="Another name under which browsers ask for this server; may be repeated.",
            show_default=False,
        ),
    ] = None,
    tiles: Annotated[
        str,
        typer.Option(
            "--tiles",
            metavar="URL",
            help="Map tiles to draw under the mission, such as "
            "https://tile.example.org/{z}/{x}/{y}.png; browsers fetch them from there. Default: "
            "none, and nothing is fetched from elsewhere.",
            show_default=False,
        ),
    ] = "",
    tiles_credit: Annotated[
        str,
        typer.Option(
            "--tiles-credit",
            metavar="TEXT",
            help="Whom the map names as the tiles' author.",
            show_default=False,
        ),
    ] = "",
    seat: ConnectionOptions = DEFAULT_CONNECTION,
    speedup: SpeedupOption = 1.0,
    json: JsonOption = False,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Show a mission in a browser, and let an operator step in.

    Joins a mission as an observer, or waits for one, and serves a page with map, UAVs, tasks
    and decisions; tasks are added and withdrawn there, and UAVs stopped or brought home, with
    or without a coordinator. Nobody flies any differently while nobody asks for it. It needs
    no internet. With keys it takes orders only if they are an operator's. Ctrl-C ends it, and
    nothing else.

    Examples:
        swarm dashboard
        swarm dashboard --keys keys/operator --connect tls/192.168.1.2:7447
        swarm dashboard --host 0.0.0.0 --port 80 --token-file /etc/peckorder/token
        swarm dashboard --tiles https://tile.example.org/{z}/{x}/{y}.png
    """
    import asyncio
    import os
    from json import dumps

    from coordinator.dashboard.access import access_for, read_token, url_of
    from coordinator.dashboard.access import listen as take_port
    from coordinator.dashboard.app import Dashboard
    from coordinator.dashboard.live_mission import LiveMission
    from coordinator.dashboard.server import serving
    from coordinator.joining import check_mission
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.identity import Role
    from swarm.runtime.clock import ScaledClock
    from swarm.runtime.log import configure_logging, get_logger
    from swarm.runtime.process import SERVICE_NOTIFIER, run_until_stopped

    configure_logging(log_level, log_format)
    check_mission(mission)
    seat = seat.found(mission, operator=True)
    network = seat.network
    config = seat.config(mission=mission, roles=(Role.VIEWER, Role.OPERATOR, Role.COORDINATOR))
    token = read_token(token_file, os.environ)
    access, made = access_for(host, allow_host or (), token)
    display = _display(access.token is not None, tiles, tiles_credit)
    if check:
        return 0
    taken = take_port(host, port)
    url = url_of(host, taken.getsockname()[1])
    if json:
        print(dumps({"url": url, "token": access.token if made else None}), flush=True)
    else:
        print(f"dashboard: {url}", flush=True)
        if made:
            print(f"token: {access.token}", flush=True)
    clock = ScaledClock(speedup)

    async def open_bus() -> Bus:
        while True:
            try:
                return await open_zenoh_bus(config)
            except BusError as fault:
                get_logger("dashboard").warning("no bus yet", reason=str(fault))

    identity = config.identity
    source = LiveMission(
        mission or config.mission,
        open_bus,
        network,
        clock,
        speedup,
        may_order=identity is None or identity.role is Role.OPERATOR,
    )

    async def work() -> int:
        served = Dashboard(source, access, display)
        async with serving(served.app, taken):
            SERVICE_NOTIFIER.ready(f"shows {mission or 'any mission'} at {url}")
            try:
                await served.beside(source.run())
            finally:
                await served.end("it was stopped")
        return 0

    return asyncio.run(run_until_stopped(work(), lifeline=lifeline))


def _display(token: bool, tiles: str, tiles_credit: str) -> PageSettings:
    from urllib.parse import urlsplit

    from coordinator.dashboard.feed import PageSettings

    if not tiles:
        if tiles_credit:
            raise InputError(Fault("--tiles-credit", "", "there are no tiles", "give --tiles, too"))
        return PageSettings(token=token)
    try:
        parts = urlsplit(tiles)
        host = parts.hostname or ""
    except ValueError:
        host = ""
    strange = not tiles.isascii() or any(sign in tiles for sign in " ;,'\"")
    whole = all(mark in tiles for mark in ("{z}", "{x}", "{y}"))
    if strange or not host or not whole or parts.scheme not in ("http", "https"):
        remedy = "write https://HOST/{z}/{x}/{y}.png"
        raise InputError(Fault("--tiles", "", f"{tiles!r} is no URL of map tiles", remedy))
    return PageSettings(token, tiles, tiles_credit)
