"""How late the event loop of a test is, so that real time can be judged on a busy machine."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Self

TURN_S = 0.005


class Lateness:
    """While it is entered, adds up by how much turns of the running loop come too late."""

    def __init__(self) -> None:
        self.s = 0.0
        """So far [wall s]: what is asked to happen in between may take that much longer."""
        self._watching: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        self._watching = asyncio.get_running_loop().create_task(self._watch())
        return self

    async def __aexit__(self, *_: object) -> None:
        assert self._watching is not None
        self._watching.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await self._watching

    async def _watch(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            due_s = loop.time() + TURN_S
            await asyncio.sleep(TURN_S)
            self.s += max(0.0, loop.time() - due_s)
