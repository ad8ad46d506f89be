"""What a coordinator that starts finds of its mission: from those who fly it, or its own memory.

Leaves out: what it makes of that (coordinator.core).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from statistics import median_high

from swarm.model.ids import COORDINATOR
from swarm.state.commands import aborted
from swarm.state.registers import Replica
from swarm.wire.messages import EpochPhase, Message, Snapshot

__all__ = ["Heritage", "inherit", "statements", "without_life"]


@dataclass(frozen=True, slots=True, eq=False)
class Heritage:
    """The mission that an earlier life of the coordinator, or another one, has left."""

    replica: Replica
    mission_s: float | None
    """Mission time of now [s]; None when nobody knows."""

    @property
    def runs(self) -> bool:
        """Whether the mission has begun and has not ended."""
        epoch = self.replica.epoch
        return epoch is not None and epoch.phase is EpochPhase.RUNNING


def inherit(
    snapshots: Sequence[Snapshot],
    heard: Iterable[Message] = (),
    memory: Snapshot | None = None,
    *,
    memory_is_young: bool = False,
) -> Heritage:
    """All that is known of the mission which is being flown.

    The living go first. The own memory adds to what they know of the same flight; where
    they know of none it counts only while it is young, and if it is of a mission that
    had ended of itself only while somebody still takes part. One that was aborted is not
    begun anew by a process that merely starts again.

    Args:
        snapshots: what the others answered.
        heard: what was heard besides.
        memory: of the coordinator's earlier life, its mission time brought to now.
        memory_is_young: whether the mission it tells of may still be on.
    """
    replica = Replica()
    replica.join_all(heard)
    for snapshot in snapshots:
        replica.join_all(snapshot.messages)
    # One odd clock among many must not set the time.
    times_s = [s.mission_s for s in snapshots if s.mission_s is not None]
    mission_s = median_high(times_s) if times_s else None
    if memory is not None and _counts(memory, replica, snapshots, is_young=memory_is_young):
        replica.join_all(memory.messages)
        mission_s = memory.mission_s if mission_s is None else mission_s
    return Heritage(replica, mission_s)


def without_life(snapshots: Iterable[Snapshot], incarnation: int) -> list[Snapshot]:
    """``snapshots`` without what the coordinator of that life has said."""

    def counts(message: Message) -> bool:
        return message.writer != COORDINATOR or message.stamp.incarnation != incarnation

    return [
        replace(snapshot, messages=tuple(filter(counts, snapshot.messages)))
        for snapshot in snapshots
    ]


def statements(messages: Iterable[Message]) -> list[Message]:
    """Those of the coordinator's seat."""
    return [message for message in messages if message.writer == COORDINATOR]


def _counts(
    memory: Snapshot, living: Replica, snapshots: Sequence[Snapshot], *, is_young: bool
) -> bool:
    remembered = Replica()
    remembered.join_all(memory.messages)
    if living.brief is not None:
        return remembered.brief is not None and remembered.brief.run == living.brief.run
    over = remembered.epoch is not None and remembered.epoch.phase is EpochPhase.ENDED
    ended = over and aborted(remembered) is None
    somebody_flies = any(snapshot.writer in living.claims for snapshot in snapshots)
    return living.epoch is None and is_young and (somebody_flies or not ended)
