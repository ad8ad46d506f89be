"""A Zenoh router inside this process, for clients that have no mesh.

Leaves out: the command around it (swarm.bus.cli). A Python session in router mode
serves clients, so nothing else need be installed.
"""

from __future__ import annotations

import json

import zenoh

from swarm.bus.config import RouterConfig
from swarm.bus.zenoh_session import (
    close_session,
    open_session,
    session_config,
    session_config_file,
)
from swarm.errors import BusError

__all__ = ["Router", "open_router"]

OPEN_LIMIT_S = 10.0
CLOSE_LIMIT_S = 2.0
INFO_LIMIT_S = 2.0


class Router:
    """A router that serves until it is closed; made by `open_router`."""

    def __init__(self, session: zenoh.Session, endpoints: tuple[str, ...]) -> None:
        self._session = session
        self._closed = False
        self.endpoints = endpoints
        """Where it really listens, one per address, ports filled in."""

    def close(self) -> None:
        """Stop serving; returns within 2 s whatever the network."""
        if not self._closed:
            self._closed = True
            close_session(self._session, limit_s=CLOSE_LIMIT_S)


async def open_router(config: RouterConfig) -> Router:
    """Start to serve.

    Other routers to link up with need not be there yet.

    Raises:
        BusError: an endpoint is taken, or no listening endpoint came to be.
        InputError: the user's configuration file is wrong.
    """
    session = await open_session(_zenoh_config(config), timeout_s=OPEN_LIMIT_S)
    try:
        endpoints = _listening_endpoints(session)
        if not endpoints:
            raise BusError("the router listens nowhere; give it an endpoint with --listen")
    except BaseException:
        close_session(session, limit_s=CLOSE_LIMIT_S)
        raise
    return Router(session, endpoints)


def _zenoh_config(config: RouterConfig) -> zenoh.Config:
    if config.path is None:
        zenoh_config = session_config(
            "router", listen=config.listen, connect=config.connect, lease_s=config.lease_s
        )
    else:
        zenoh_config = session_config_file(config.path)
        zenoh_config.insert_json5("mode", '"router"')
        if config.listen:
            zenoh_config.insert_json5("listen/endpoints", json.dumps(config.listen))
        if config.connect:
            zenoh_config.insert_json5("connect/endpoints", json.dumps(config.connect))
    # Only there a router says which port it got when asked for any.
    zenoh_config.insert_json5("adminspace/enabled", "true")
    return zenoh_config


def _listening_endpoints(session: zenoh.Session) -> tuple[str, ...]:
    """What the router says of itself in its own administration space."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=INFO_LIMIT_S):
        if reply.ok is not None:
            said = json.loads(reply.ok.payload.to_bytes())
            return tuple(sorted(said["locators"]))
    return ()
