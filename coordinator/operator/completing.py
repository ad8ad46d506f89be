"""Names on the bus that complete what an operator types: quickly, or not at all.

A shell waits for it, so it looks for a moment only where a router accepts connections, and is
silent about everything that is wrong. Leaves out: every other completion (swarm.complete).
"""

from __future__ import annotations

import asyncio
import contextlib
import re
import socket
from typing import TYPE_CHECKING

import typer

from swarm.bus.config import DEFAULT_ROUTER, DEFAULT_SECURE_ROUTER

if TYPE_CHECKING:
    from swarm.bus.config import BusConfig

__all__ = ["complete_uav"]

_DIAL_S = 0.1
_OPEN_S = 0.5
_LOOK_S = 0.3
_TCP = re.compile(r"(?:tcp|tls)/(\[[^\]]+\]|[^:]+):(\d+)")


def complete_uav(ctx: typer.Context, incomplete: str) -> list[str]:
    """Ids of UAVs whose agents are there."""
    from swarm.model.ids import COORDINATOR

    mission = ctx.params.get("mission")
    found = {
        writer
        for name, writer in _writers(ctx)
        if mission in (None, name) and writer != COORDINATOR
    }
    return sorted(uav for uav in found if uav.startswith(incomplete))


def _writers(ctx: typer.Context) -> set[tuple[str, str]]:
    """Mission and name of whoever shows a token; nobody where no router is at hand."""
    keys, clear = ctx.params.get("keys"), bool(ctx.params.get("unencrypted"))
    default = DEFAULT_ROUTER if keys is None else DEFAULT_SECURE_ROUTER
    endpoints = list(ctx.params.get("connect") or ()) or [default]
    near = [endpoint for endpoint in endpoints if _accepts(endpoint)]
    if not near:
        return set()
    from swarm.bus.seat import Seat
    from swarm.errors import SwarmError

    with contextlib.suppress(SwarmError, OSError):
        return asyncio.run(_look(Seat(connect=near, keys=keys, unencrypted=clear).config()))
    return set()


def _accepts(endpoint: str) -> bool:
    match = _TCP.fullmatch(endpoint)
    if match is None:
        return False
    try:
        socket.create_connection((match[1].strip("[]"), int(match[2])), _DIAL_S).close()
    except OSError:
        return False
    return True


async def _look(config: BusConfig) -> set[tuple[str, str]]:
    from swarm.bus.port import TokenSeen
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.wire.keys import ANY_TOKEN, Keys, mission_of_token

    bus = await open_zenoh_bus(config, timeout_s=_OPEN_S)
    try:
        bus.watch_tokens(ANY_TOKEN if config.mission is None else Keys(config.mission).alive("*"))
        await asyncio.sleep(_LOOK_S)
        tokens = [event.key for event in bus.inbox.take() if isinstance(event, TokenSeen)]
    finally:
        bus.close()
    named = ((mission_of_token(token), token.rpartition("/")[2]) for token in tokens)
    return {(mission, writer) for mission, writer in named if mission is not None}
