"""Lets what can wait happen one after the other, between looks at what has come meanwhile.

Dozens of shells in one loop all have something to do when their vehicles report at one moment. What
follows from a word at once must not stand behind what dozens of others may do a little later.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from swarm.protocol.shared_messages import SharedMessages
from swarm.runtime.clock import Clock

_STOP_S = 0.5
"""A process of dozens in which nobody does anything for so long has stood still [wall s]."""


class Turns:
    """Of one loop; call from its thread."""

    def __init__(self) -> None:
        self._waiting: deque[Callable[[], None]] = deque()
        self._ran_at_s = self._runs_since_s = -math.inf

    def runs_since_s(self, clock: Clock) -> float:
        """Since when this process has run without a stop [s of ``clock``, which all share].

        To be asked by each of them at each step: that shows that it runs.
        """
        now_s = clock.now_s()
        if clock.wall_delay_s(now_s - self._ran_at_s) > _STOP_S:
            self._runs_since_s = now_s
        self._ran_at_s = now_s
        return self._runs_since_s

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


class Alarm:
    """Has one of several shells look at what is due: at once if that presses, else in its turn.

    Args:
        clock: gives the times below.
        turns: of all in this process; None: it is alone there, and never waits.
        pressing_s: when something is due next that can't wait until others have had their turn;
            None: nothing is, as far as is known.
        look: is called from the loop; must not raise.
    """

    def __init__(
        self,
        clock: Clock,
        turns: Turns | None,
        pressing_s: Callable[[], float | None],
        look: Callable[[], None],
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._clock = clock
        self._turns = turns
        self._pressing_s = pressing_s
        self._look = look
        self._timer: asyncio.TimerHandle | None = None
        self._waits = False

    def ring_at(self, due_s: float | None) -> None:
        """Something is due by then, and nothing before; None: nothing."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if due_s is not None:
            delay_s = self._clock.wall_delay_s(due_s - self._clock.now_s())
            self._timer = self._loop.call_later(max(0.0, delay_s), self.ring)

    def ring(self) -> None:
        """Something is due, or there is something that may be looked at along with it."""
        pressing_s = self._pressing_s()
        if self._turns is None or (pressing_s is not None and pressing_s <= self._clock.now_s()):
            self._look()
            return
        if not self._waits:
            self._waits = True
            self._turns.put_off(self._take_turn)
        self.ring_at(pressing_s)

    def _take_turn(self) -> None:
        self._waits = False
        self._look()


@dataclass(frozen=True, slots=True)
class SharedProcess:
    """What several shells of one process have in common."""

    messages: SharedMessages = field(default_factory=SharedMessages)
    """What any of them has heard."""
    turns: Turns = field(default_factory=Turns)
