"""What one life of an agent leaves to the next: what counts of it, and when it is worth keeping.

What an earlier life kept counts when the others speak of the same flight, or when nobody knows of
any.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from agent.core.interface import Action
from agent.core.mission_view import MissionView
from swarm.protocol.events import Publish
from swarm.protocol.messages import MissionConfig, MissionPhase, Snapshot
from swarm.protocol.registers import Replica, snapshot_without
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import ClaimPhase, News


class RecoveredState:
    """The memory of an earlier life of the agent of ``uav``, until it is taken or dropped.

    Args:
        memory: every register it knew, and the mission time of now as far as it knew; None
            if there was no earlier life.
        age_s: how long ago that was kept.
        timing: how old a memory is trusted, and how long the others get to contradict it.
    """

    def __init__(self, uav: str, memory: Snapshot | None, age_s: float, timing: Timing) -> None:
        self.unconfirmed = False
        """Whether it was taken because nobody came who knows better."""
        self.taken: Replica | None = None
        """What the earlier life knew, once it counts."""
        self.begun = False
        """Whether it had begun to take off, once that counts."""
        self._memory = memory
        self._known = Replica()
        self._known.join_all(() if memory is None else memory.messages)
        claim = self._known.claims.get(uav)
        self._took_part = claim is not None and claim.phase is not ClaimPhase.OUT
        epoch = self._known.epoch
        begun = epoch is not None and epoch.phase is not MissionPhase.PREPARING
        self._fresh = begun and age_s <= timing.recall_s
        self._patience_s = timing.abandon_s
        self._began_s = 0.0

    def begin(self, now_s: float) -> None:
        """The new life begins."""
        self._began_s = now_s

    def demote_revoked(self, signers: Collection[str]) -> None:
        """See `Replica.demote_revoked`."""
        if self._memory is not None:
            self._memory = snapshot_without(signers, self._memory)

    def fitting(
        self, brief: MissionConfig | None, now_s: float, *, last_chance: bool
    ) -> Snapshot | None:
        """The memory, once it is known to count; given once.

        The others' word on it is their ``brief``, None as long as nobody has told one; it is not
        waited for at the ``last_chance``, when the agent is about to end.
        """
        if self._memory is None:
            return None
        if brief is not None:
            remembered = self._known.brief
            return self._take(remembered is not None and remembered.run == brief.run)
        self.unconfirmed = self._took_part and now_s >= self._began_s + self._patience_s
        if self.unconfirmed or (self._took_part and (self._fresh or last_chance)):
            return self._take(True)
        return None

    def waits_for_time(self, mission_view: MissionView) -> bool:
        """Whether the mission runs, nobody has told at what time, and somebody may yet.

        Its answer may have been lost. Without the time no claim of an earlier life can be kept.
        """
        until_s = self._began_s + self._patience_s
        lacks = mission_view.said_to_run and not mission_view.clock.is_set
        return lacks and mission_view.now_s < until_s

    def next_deadline_s(self) -> float | None:
        """When an old memory will count for want of a better one."""
        waits = self._memory is not None and self._took_part
        return self._began_s + self._patience_s if waits else None

    def _take(self, counts: bool) -> Snapshot | None:
        memory, self._memory = self._memory, None
        self.taken = self._known if counts else None
        self.begun = counts and memory is not None and memory.begun
        return memory if counts else None


class SaveCondition:
    """When what the agent of ``uav`` knows is to be kept anew for a later life.

    Args:
        timing: how old a memory is trusted.
    """

    def __init__(self, uav: str, replica: Replica, timing: Timing) -> None:
        self._uav = uav
        self._replica = replica
        self._keep_again_s = timing.recall_s / 4.0
        self._kept: object = None
        self._kept_tasks = 0
        """Of the replica's task versions, the one that is kept."""
        self._kept_at_s = -math.inf

    def worth_keeping(self, actions: Iterable[Action], now_s: float, *, begun: bool) -> bool:
        """Whether this agent, coordinator or operator has said something new; told once.

        Or whether its vehicle has begun to take off, or has ended that.
        What others have done follows with its next announcement, and so does all when what is
        kept is about to grow old: each time is a write to a memory that wears out.
        """
        replica = self._replica
        plan = None if replica.epoch is None else (replica.epoch.number, replica.epoch.phase)
        commands, own = tuple(replica.commands.values()), replica.heads.get(self._uav)
        before, self._kept = self._kept, (plan, replica.board_version, commands, own, begun)
        worth = before != self._kept
        if not worth and any(_is_register(action) for action in actions):
            old = now_s - self._kept_at_s >= self._keep_again_s
            worth = old or replica.task_version != self._kept_tasks
        if worth:
            self._kept_at_s, self._kept_tasks = now_s, replica.task_version
        return worth


def _is_register(action: Action) -> bool:
    return isinstance(action, Publish) and not isinstance(action.message.body, News)
