"""Names on the bus that complete what an operator types: quickly, or not at all.

A shell waits for it, so it looks for a moment only where a run is on or a router accepts
connections, and is silent about everything that is wrong.
"""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import replace
from typing import TYPE_CHECKING

import typer

from swarm.bus.config import DEFAULT_ROUTER, DEFAULT_SECURE_ROUTER
from swarm.bus.connection import ConnectionOptions, accepts
from swarm.runtime.errors import SwarmError

if TYPE_CHECKING:
    from swarm.bus.config import BusConfig

_OPEN_S = 0.5
_LOOK_S = 0.3


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
    named = list(ctx.params.get("connect") or ())
    seat = ConnectionOptions(connect=named, keys=keys, unencrypted=clear)
    with contextlib.suppress(SwarmError, OSError):
        place = seat.found(ctx.params.get("mission"))
        if place is seat:
            default = DEFAULT_ROUTER if keys is None else DEFAULT_SECURE_ROUTER
            near = [endpoint for endpoint in named or [default] if accepts(endpoint)]
            if not near:
                return set()
            place = replace(seat, connect=near)
        return asyncio.run(_look(place.config()))
    return set()


async def _look(config: BusConfig) -> set[tuple[str, str]]:
    from swarm.bus.port import TokenSeen
    from swarm.bus.zenoh_bus import open_zenoh_bus
    from swarm.protocol.key_space import ANY_TOKEN, KeySpace, mission_of_token

    bus = await open_zenoh_bus(config, timeout_s=_OPEN_S)
    try:
        bus.watch_tokens(
            ANY_TOKEN if config.mission is None else KeySpace(config.mission).alive("*")
        )
        await asyncio.sleep(_LOOK_S)
        tokens = [event.key for event in bus.inbox.take() if isinstance(event, TokenSeen)]
    finally:
        bus.close()
    named = ((mission_of_token(token), token.rpartition("/")[2]) for token in tokens)
    return {(mission, writer) for mission, writer in named if mission is not None}
