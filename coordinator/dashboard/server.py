"""Serve an application inside a running loop, on a port that was taken beforehand."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator, Iterator

import uvicorn
from starlette.types import ASGIApp

END_S = 1
"""Wall time that connections have to end in order."""


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
            proxy_headers=False,
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
    loop = asyncio.get_running_loop()
    running, up = loop.create_task(server.serve([listening])), loop.create_task(server.up.wait())
    try:
        await asyncio.wait((running, up), return_when=asyncio.FIRST_COMPLETED)
        yield
    finally:
        up.cancel()
        server.should_exit = True
        try:
            await running
        finally:
            listening.close()


class _Server(uvicorn.Server):
    """Leaves signals to whoever runs the loop, and tells when it serves."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.up = asyncio.Event()

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start to serve."""
        await super().startup(sockets)
        self.up.set()

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Capture none."""
        yield
