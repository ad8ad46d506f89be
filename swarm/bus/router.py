"""A Zenoh router inside this process, for clients that have no mesh.

With keys it lets in who is in the newest roster, and passes on what that lets each say; who
floods it is shut out. Zenoh cannot change this while a session is open, so the router opens
another one in its place. Leaves out: the command around it (swarm.bus.cli), and who may say what
(swarm.bus.access). A Python session in router mode serves clients, so nothing else need be
installed.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable

import zenoh
from zenoh.handlers import Callback

from swarm.bus.config import RouterConfig
from swarm.bus.rosters import Rosters
from swarm.bus.zenoh_session import (
    close_session,
    open_session,
    session_config,
    session_config_file,
)
from swarm.errors import BusError
from swarm.log import get_logger
from swarm.wire.keys import Keys

__all__ = ["Router", "open_router"]

OPEN_LIMIT_S = 10.0
CLOSE_LIMIT_S = 2.0
INFO_LIMIT_S = 2.0
AGAIN_S = 0.05
"""Between tries to listen where the session before has hardly left."""


class Router:
    """A router that serves until it is closed; made by `open_router`."""

    def __init__(
        self,
        config: RouterConfig,
        rosters: Rosters | None,
        session: zenoh.Session,
        endpoints: tuple[str, ...],
    ) -> None:
        self._config = config
        self._rosters = rosters
        self._session = session
        self._closed = False
        self.endpoints = endpoints
        """Where it really listens, one per address, ports filled in."""

    async def serve(self) -> None:
        """Serve until cancelled, by the newest roster there is.

        Raises:
            BusError: it was itself revoked, or cannot listen any more.
        """
        rosters = self._rosters
        if rosters is None:
            await asyncio.Event().wait()
            return
        while True:
            self._hear(rosters)
            await rosters.wait_for_change(self._tell)
            roster, own = rosters.roster, rosters.identity
            entry = roster.entry(own.name)
            if entry is None or entry.common_name != own.common_name:
                raise BusError(f"roster {roster.version} revokes the keys of this router")
            get_logger("router").info(f"opening anew, by roster {roster.version}")
            await self._reopen(rosters)

    def close(self) -> None:
        """Stop serving; returns within 2 s whatever the network."""
        if not self._closed:
            self._closed = True
            close_session(self._session, limit_s=CLOSE_LIMIT_S)

    def _hear(self, rosters: Rosters) -> None:
        """Listen for rosters, and for who floods; callbacks are Zenoh's threads'."""
        loop = asyncio.get_running_loop()
        root = Keys(rosters.identity.mission).root
        let_in = rosters.roster  # until it is opened anew, whoever else is in force by then

        def on_roster(sample: zenoh.Sample) -> None:
            key, data = str(sample.key_expr), sample.payload.to_bytes()
            with contextlib.suppress(RuntimeError):  # the loop has ended
                loop.call_soon_threadsafe(rosters.hear, key, data)

        def on_saying(sample: zenoh.Sample) -> None:
            _, _, _, *rest = str(sample.key_expr).split("/", 4)
            flooder = rosters.flooding(let_in.entry(rest[0]), loop.time()) if rest else None
            if flooder is not None:
                with contextlib.suppress(RuntimeError):
                    loop.call_soon_threadsafe(rosters.shut_out, flooder)

        def listen(key_expr: str, on_sample: Callable[[zenoh.Sample], None]) -> None:
            call = Callback(on_sample, indirect=False)
            remote = zenoh.Locality.REMOTE
            self._session.declare_subscriber(key_expr, call, allowed_origin=remote)

        listen(rosters.key, on_roster)
        listen(f"{root}/uav/**", on_saying)
        self._session.liveliness().declare_subscriber(
            f"{root}/alive/*", Callback(on_saying, indirect=False)
        )

    def _tell(self, key: str, data: bytes) -> None:
        with contextlib.suppress(zenoh.ZError):
            self._session.put(key, data, allowed_destination=zenoh.Locality.REMOTE)

    async def _reopen(self, rosters: Rosters) -> None:
        listen = _as_before(self._config.listen, self.endpoints)
        close_session(self._session, limit_s=CLOSE_LIMIT_S)
        async with asyncio.timeout(OPEN_LIMIT_S):
            while True:
                try:
                    self._session = await _open(self._config, rosters, listen)
                # A session that is still closing has the port; a full disk has no place for a door.
                except (BusError, OSError) as fault:
                    get_logger("router").debug("cannot open anew yet", problem=str(fault))
                    await asyncio.sleep(AGAIN_S)
                else:
                    return


async def open_router(config: RouterConfig) -> Router:
    """Start to serve.

    Other routers to link up with need not be there yet.

    Raises:
        BusError: an endpoint is taken, or no listening endpoint came to be.
        InputError: the user's configuration file is wrong, or its keys are no router's.
    """
    rosters = None if config.identity is None else Rosters(config.identity)
    session = await _open(config, rosters, config.listen)
    try:
        endpoints = _listening_endpoints(session)
        if not endpoints:
            raise BusError("the router listens nowhere; give it an endpoint with --listen")
    except BaseException:
        close_session(session, limit_s=CLOSE_LIMIT_S)
        raise
    return Router(config, rosters, session, endpoints)


async def _open(
    config: RouterConfig, rosters: Rosters | None, listen: tuple[str, ...]
) -> zenoh.Session:
    zenoh_config = _zenoh_config(config, listen)
    if rosters is None:
        return await open_session(zenoh_config, timeout_s=OPEN_LIMIT_S)
    from swarm.bus.secure import door_of, secure

    roster = rosters.let_in
    with door_of(rosters.identity, roster) as door:
        secure(zenoh_config, rosters.identity, "router", roster, door)
        return await open_session(zenoh_config, timeout_s=OPEN_LIMIT_S)


def _zenoh_config(config: RouterConfig, listen: tuple[str, ...]) -> zenoh.Config:
    if config.path is None:
        zenoh_config = session_config(
            "router", listen=listen, connect=config.connect, lease_s=config.lease_s
        )
    else:
        zenoh_config = session_config_file(config.path)
        zenoh_config.insert_json5("mode", '"router"')
        if listen:
            zenoh_config.insert_json5("listen/endpoints", json.dumps(listen))
        if config.connect:
            zenoh_config.insert_json5("connect/endpoints", json.dumps(config.connect))
    # Only there a router says which port it got when asked for any.
    zenoh_config.insert_json5("adminspace/enabled", "true")
    return zenoh_config


def _as_before(listen: tuple[str, ...], endpoints: tuple[str, ...]) -> tuple[str, ...]:
    """``listen`` with the port that was found where any was asked for."""
    ports = (endpoint.rpartition(":")[2] for endpoint in endpoints)
    return tuple(
        f"{each.removesuffix('0')}{next(ports)}" if each.endswith(":0") else each for each in listen
    )


def _listening_endpoints(session: zenoh.Session) -> tuple[str, ...]:
    """What the router says of itself in its own administration space."""
    for reply in session.get(f"@/{session.zid()}/router", timeout=INFO_LIMIT_S):
        if reply.ok is not None:
            said = json.loads(reply.ok.payload.to_bytes())
            return tuple(sorted(said["locators"]))
    return ()
