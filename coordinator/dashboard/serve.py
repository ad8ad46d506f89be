"""Serve an application inside a running loop, on a port that is taken beforehand.

Leaves out: what is served (coordinator.dashboard.app) and who ends it (swarm.process).
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator

import uvicorn
from starlette.types import ASGIApp

from swarm.errors import Fault, InputError

__all__ = ["listen", "serving", "url_of"]

END_S = 1
"""Wall time that connections have to end in order."""


def listen(host: str, port: int, option: str = "--port") -> socket.socket:
    """A socket that accepts connections at ``host``; any free port for 0.

    Raises:
        InputError: there is no such host, or the port is taken or may not be had.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
    except (OSError, UnicodeError) as error:
        problem = f"no such host: {error}"
        raise InputError(
            Fault("--host", host, problem, "name an address of this machine")
        ) from None
    listening = socket.socket(family, kind, protocol)
    try:
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(100)
    except OSError as error:
        listening.close()
        problem = f"cannot listen at {host}: {error.strerror or error}"
        remedy = "choose another, or 0 for any that is free"
        raise InputError(Fault(option, str(port), problem, remedy)) from None
    return listening


def url_of(listening: socket.socket, host: str) -> str:
    """Where a browser finds what is served there."""
    port = listening.getsockname()[1]
    name = host.strip("[]")
    if name in ("0.0.0.0", "::"):  # noqa: S104 - compared, not bound
        name = socket.gethostname()
    return f"http://{f'[{name}]' if ':' in name else name}:{port}/"


@contextlib.asynccontextmanager
async def serving(app: ASGIApp, listening: socket.socket) -> AsyncIterator[None]:
    """Serve ``app`` while the context lasts; no connection outlives it by more than a moment."""
    server = _Server(
        uvicorn.Config(
            app,
            log_config=None,
            log_level="error",
            access_log=False,
            server_header=False,
            lifespan="on",
            http="h11",
            ws="websockets-sansio",
            ws_max_size=4096,
            # On one machine or a LAN, compressing every client's frames costs more than it saves.
            ws_per_message_deflate=False,
            timeout_keep_alive=10,
            timeout_graceful_shutdown=END_S,
        )
    )
    running = asyncio.get_running_loop().create_task(server.serve([listening]))
    try:
        yield
    finally:
        server.should_exit = True
        try:
            await running
        finally:
            listening.close()


class _Server(uvicorn.Server):
    """Leaves signals to whoever runs the loop."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield
