"""Lets what can wait happen one after the other, between looks at what has come meanwhile.

Dozens of shells in one loop all have something to do when their vehicles report at one moment. What
follows from a word at once must not stand behind what dozens of others may do a little later.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from swarm.protocol.shared_messages import SharedMessages


class Turns:
    """Of one loop; call from its thread."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()

    def put_off(self, act: Callable[[], None]) -> None:
        """Do it after all that was put off before; it must not raise."""
        self._waiting.append(act)
        if len(self._waiting) == 1:
            asyncio.get_running_loop().call_soon(self._take_one)

    async def mine(self) -> None:
        """Return once all that was put off before has been done."""
        come = asyncio.Event()
        self.put_off(come.set)
        await come.wait()

    def _take_one(self) -> None:
        """The oldest; the loop reads what has come before the next."""
        act = self._waiting[0]
        try:
            act()
        finally:
            self._waiting.popleft()
            if self._waiting:
                asyncio.get_running_loop().call_soon(self._take_one)


@dataclass(frozen=True, slots=True)
class SharedProcess:
    """What several shells of one process have in common."""

    messages: SharedMessages = field(default_factory=SharedMessages)
    """What any of them has heard."""
    turns: Turns = field(default_factory=Turns)
