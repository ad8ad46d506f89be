"""The websocket of a live mission: who comes is checked, then told what its channels have.

Viewers are programs, or pages that come from elsewhere. A page of anybody else that a person has
open may ask here, too; a browser tells its ``Origin``.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Collection
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final
from urllib.parse import parse_qs, urlsplit

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from coordinator.dashboard.access import AccessRules, is_loopback
from coordinator.foxglove.channels import LiveChannels
from swarm.runtime.log import get_logger

SUBPROTOCOLS: Final = (Subprotocol("foxglove.sdk.v1"), Subprotocol("foxglove.websocket.v1"))
"""Two names of one protocol: that of Foxglove's own programs, and that of earlier and open ones."""
KNOWN_ORIGINS: Final = frozenset({"file://", "https://app.foxglove.dev"})
"""Of viewers that are programs on a desktop, and of Foxglove's own page."""
MAX_VIEWERS: Final = 16
MAX_SAID_BYTES: Final = 1 << 20
"""Of one word of a viewer, which may subscribe to some 20 000 channels at once."""
SEND_S: Final = 20.0
"""Wall time a viewer may take to read one message; then it is given up."""


@dataclass(frozen=True, slots=True)
class ViewerRules:
    """Who may look on.

    Args:
        access: names of this server, and the token if one is needed.
        origins: of further pages that may ask.
    """

    access: AccessRules
    origins: Collection[str] = ()

    def fault(self, host: str | None, origin: str | None, token: str | None) -> str | None:
        """Why a request is refused; None when it is not."""
        if not self.access.knows_host(host):
            return "this server has another name; see --allow-host"
        if not self.access.admits(token):
            return "the token is missing or wrong: end the URL in ?token=TOKEN"
        # Who shows the token was given it.
        if self.access.token is None and not self._knows_origin(origin):
            return f"a page of {origin} may not look on; see --allow-origin"
        return None

    def _knows_origin(self, origin: str | None) -> bool:
        if origin is None or origin in KNOWN_ORIGINS or origin in self.origins:
            return True
        try:
            return is_loopback(urlsplit(origin).hostname or "")
        except ValueError:
            return False


@contextlib.asynccontextmanager
async def serving_live(
    channels: LiveChannels, rules: ViewerRules, listening: socket.socket
) -> AsyncIterator[Server]:
    """Serve viewers while the context lasts."""
    log = get_logger("foxglove")

    def check(connection: ServerConnection, request: Request) -> Response | None:
        hosts, origins = (request.headers.get_all(name) for name in ("Host", "Origin"))
        try:
            asked = parse_qs(urlsplit(request.path).query, max_num_fields=8)
        except ValueError:
            asked = {}
        told = hosts[0] if len(hosts) == 1 else None
        origin = origins[0] if len(origins) == 1 else (",".join(origins) or None)
        fault = rules.fault(told, origin, asked.get("token", [None])[0])
        if fault is None and len(channels.viewers) < MAX_VIEWERS:
            return None
        log.warning("viewer refused", reason=fault or "too many look on")
        if fault is None:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "too many look on\n")
        return connection.respond(HTTPStatus.FORBIDDEN, f"{fault}\n")

    async def show(connection: ServerConnection) -> None:
        await _show(connection, channels)

    async with serve(
        show,
        sock=listening,
        subprotocols=SUBPROTOCOLS,
        process_request=check,
        compression=None,
        max_size=MAX_SAID_BYTES,
        server_header=None,
    ) as server:
        yield server


async def _show(connection: ServerConnection, channels: LiveChannels) -> None:
    """Tell one viewer all that it asks for, until it leaves or reads nothing any more."""
    log, news = get_logger("foxglove"), asyncio.Event()
    viewer = channels.join(news.set)
    log.info("viewer joined", viewers=len(channels.viewers))

    async def tell() -> None:
        while True:
            for word in viewer.take():
                async with asyncio.timeout(SEND_S):
                    await connection.send(word)
            news.clear()
            await news.wait()

    async def listen() -> None:
        async for said in connection:
            viewer.says(said)

    telling = asyncio.get_running_loop().create_task(tell())
    listening = asyncio.get_running_loop().create_task(listen())
    try:
        await asyncio.wait((telling, listening), return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in (telling, listening):
            task.cancel()
        with contextlib.suppress(ConnectionClosed, TimeoutError, asyncio.CancelledError):
            await asyncio.gather(telling, listening)
        channels.leave(viewer)
        log.info("viewer left", dropped=viewer.dropped, viewers=len(channels.viewers))
