"""How long after the end of a service others hear what its UAV does next.

The way of a decision from end to end: the agent is woken, decides, claims and publishes, and
it comes to the process of somebody on the bus. Where a UAV has to wait for its way, it says so in
that claim, and flies later: the wait is no part of the decision. Leaves out: who finds nothing to
do at first.
"""

from __future__ import annotations

import math

from swarm.protocol.messages import Message
from swarm.protocol.uav_messages import Claim, ClaimPhase, Outcome


class ClaimDelays:
    """Of all UAVs that an observer hears."""

    def __init__(self) -> None:
        self.told_ms: list[float] = []
        """Each, as the observer's clock of the mission has it [ms]."""
        self._free_since_s: dict[str, float] = {}
        """By UAV whose service is over, and of which nothing was heard since: when it was."""
        self._ended_s: dict[str, float] = {}
        """By UAV, when its last service was over: outcomes are said again and again."""

    def hear(self, message: Message, mission_s: float | None) -> None:
        """That came to the observer at a mission time [s], None: the mission has not begun."""
        match message.body:
            case Outcome(completed_s=ended_s):
                if ended_s > self._ended_s.get(message.writer, -math.inf):
                    self._free_since_s[message.writer] = self._ended_s[message.writer] = ended_s
            case Claim() as claim:
                free_s = self._free_since_s.get(message.writer)
                if free_s is None or claim.decided_s < free_s:
                    return  # said of the task that is over
                del self._free_since_s[message.writer]
                chosen = claim.phase is ClaimPhase.PROPOSED and claim.task is not None
                if chosen and mission_s is not None:
                    self.told_ms.append(1e3 * max(0.0, mission_s - free_s))
            case _:
                pass
