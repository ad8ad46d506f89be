"""What an earlier life of this agent kept, and whether it belongs to the flight that is on.

The others' word comes first: memory counts when they speak of the same run. If nobody
knows of any, the memory of one who was taking part is trusted while it is young, and
later so far as to bring home a vehicle that may hover since. Leaves out: what follows
from it (agent.core) and where it is kept (swarm.store).
"""

from __future__ import annotations

from collections.abc import Collection

from swarm.config import Timing
from swarm.state.registers import Replica, snapshot_without
from swarm.wire.messages import Brief, ClaimPhase, EpochPhase, Snapshot

__all__ = ["Recall"]


class Recall:
    """The memory of an earlier life of the agent of ``uav``, until it is taken or dropped.

    Args:
        uav: id of the UAV.
        memory: every register it knew, and the mission time of now as far as it knew; None
            if there was no earlier life.
        age_s: how long ago that was kept.
        timing: how old a memory is trusted, and how long the others get to contradict it.
    """

    def __init__(self, uav: str, memory: Snapshot | None, age_s: float, timing: Timing) -> None:
        self.forlorn = False
        """Whether it was taken because nobody came who knows better."""
        self._memory = memory
        self._known = Replica()
        self._known.join_all(() if memory is None else memory.messages)
        claim = self._known.claims.get(uav)
        self._took_part = claim is not None and claim.phase is not ClaimPhase.OUT
        epoch = self._known.epoch
        begun = epoch is not None and epoch.phase is not EpochPhase.PREPARING
        self._fresh = begun and age_s <= timing.recall_s
        self._patience_s = timing.abandon_s
        self._began_s = 0.0

    def begin(self, now_s: float) -> None:
        """The new life begins."""
        self._began_s = now_s

    def disown(self, signers: Collection[str]) -> None:
        """See `Replica.disown`."""
        if self._memory is not None:
            self._memory = snapshot_without(signers, self._memory)

    def fitting(self, brief: Brief | None, now_s: float, *, last_chance: bool) -> Snapshot | None:
        """The memory, once it is known to count; given once.

        Args:
            brief: what others have told; None as long as nobody has.
            now_s: now.
            last_chance: the agent is about to end.
        """
        if self._memory is None:
            return None
        if brief is not None:
            remembered = self._known.brief
            return self._take(remembered is not None and remembered.run == brief.run)
        self.forlorn = self._took_part and now_s >= self._began_s + self._patience_s
        if self.forlorn or (self._took_part and (self._fresh or last_chance)):
            return self._take(True)
        return None

    def next_deadline_s(self) -> float | None:
        """When an old memory will count for want of a better one."""
        waits = self._memory is not None and self._took_part
        return self._began_s + self._patience_s if waits else None

    def _take(self, counts: bool) -> Snapshot | None:
        memory, self._memory = self._memory, None
        return memory if counts else None
