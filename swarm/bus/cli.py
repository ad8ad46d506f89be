"""The command ``swarm router``."""

from __future__ import annotations

import asyncio
import json as json_format
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm.bus.config import DEFAULT_ROUTER, DEFAULT_SECURE_ROUTER
from swarm.protocol.timing import LinkKind, preset
from swarm.runtime.log import LogFormat, LogLevel
from swarm.runtime.options import (
    CheckOption,
    JsonOption,
    KeysOption,
    LeaseOption,
    LifelineOption,
    LinkOption,
    LogFormatOption,
    LogLevelOption,
    UnencryptedOption,
)

if TYPE_CHECKING:
    from swarm.bus.config import RouterConfig


def router(
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            help="Where clients reach it; may be repeated; port 0 means any free one. "
            f"Default: {DEFAULT_ROUTER}, with --keys {DEFAULT_SECURE_ROUTER}.",
            show_default=False,
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            help="Another router to link up with; may be repeated.",
            show_default=False,
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Zenoh configuration file.",
            show_default=False,
        ),
    ] = None,
    keys: KeysOption = None,
    unencrypted: UnencryptedOption = False,
    link: LinkOption = LinkKind.NORMAL,
    lease_s: LeaseOption = None,
    json: JsonOption = False,
    check: CheckOption = False,
    lifeline: LifelineOption = False,
    log_level: LogLevelOption = LogLevel.INFO,
    log_format: LogFormatOption = LogFormat.AUTO,
) -> int:
    """Be the place that a fleet's processes reach each other by.

    Agents and coordinator are clients of it. Prints one JSON line with the endpoints it really
    listens on, then serves until SIGTERM (exit status 0) or Ctrl-C (130).

    Examples:
        swarm router
        swarm router --keys keys/router --listen tls/0.0.0.0:7447
        swarm router --keys keys/router-2 --listen tls/0.0.0.0:7447 --connect tls/192.168.1.2:7447
    """
    from swarm.bus.config import RouterConfig
    from swarm.runtime.errors import Fault, InputError
    from swarm.runtime.log import configure_logging
    from swarm.runtime.process import run_until_stopped

    configure_logging(log_level, log_format)
    identity = None
    if keys is not None:
        from swarm.identity import Role, load_identity

        identity = load_identity(keys, roles=(Role.ROUTER,))
    default = DEFAULT_ROUTER if identity is None else DEFAULT_SECURE_ROUTER
    listens = tuple(listen or (() if config else (default,)))
    try:
        lease_s = preset(link, lease_s).lease_s
        settings = RouterConfig(
            listens, tuple(connect or ()), config, lease_s, identity, unencrypted
        )
    except ValueError as fault:
        problem, _, remedy = str(fault).partition("; ")
        raise InputError(
            Fault("swarm router", "", problem, remedy or "see 'swarm router --help'")
        ) from None
    if check:
        return 0
    return asyncio.run(run_until_stopped(_serve(settings, quiet=json), lifeline=lifeline))


async def _serve(settings: RouterConfig, *, quiet: bool) -> int:
    from swarm import __version__
    from swarm.bus.router import open_router
    from swarm.runtime.log import get_logger
    from swarm.runtime.process import SERVICE_NOTIFIER

    serving = await open_router(settings)
    try:
        print(json_format.dumps({"endpoints": serving.endpoints}), flush=True)
        SERVICE_NOTIFIER.ready(f"serves at {', '.join(serving.endpoints)}")
        if not quiet:
            ready = f"router ready at {', '.join(serving.endpoints)}"
            get_logger("router").info(ready, release=__version__)
        await serving.serve()
        return 0
    finally:
        serving.close()
