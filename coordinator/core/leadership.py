"""Who leads a mission, and from which state.

Two coordinators meet when one was started beside the other, or after a partition in which the one
standing by took over. Both apply one rule to what they know of each other, so one gives way. Who
leads asks before it decides, and goes on from what those who fly it answer, or from its own
memory. Leaves out: what it does then (coordinator.core.active).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from statistics import median_high

from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.operator_commands import abort_command
from swarm.protocol.registers import Replica
from swarm.protocol.sync import QuestionTimer

__all__ = [
    "InheritedState",
    "LeadershipStage",
    "StateQuery",
    "coordinator_messages",
    "inherited_state",
    "stage_of",
    "without_incarnation",
    "yields_to",
]


class StateQuery:
    """The questions of one process.

    Args:
        gap_s: shortest interval between two of them [s].
        every_s: longest interval; answers may get lost, and with them the only reason to ask.
    """

    def __init__(self, gap_s: float, every_s: float = math.inf) -> None:
        self.unsure = True
        """Whether something may have happened that nobody has told yet: decide nothing."""
        self.ever = False
        """Whether any question has been answered, be it by nobody."""
        self._asking = QuestionTimer(gap_s)
        self._every_s = every_s
        self._again_at_s = math.inf
        self._open = 0
        """Questions without an answer."""
        self._outdated = 0
        """Those of them that were asked before the last doubt."""

    def want(self, now_s: float, *, before_deciding: bool = False) -> None:
        """There is a reason to ask.

        Args:
            now_s: now.
            before_deciding: what is known may be old.
        """
        if before_deciding:
            self.unsure, self._outdated = True, self._open
        self._asking.want(now_s)

    def due(self, now_s: float) -> bool:
        """Whether to ask now; True once for each question."""
        if self._again_at_s <= now_s:
            self._asking.want(now_s)
        due = self._asking.due(now_s)
        if due:
            self._open += 1
            self._again_at_s = now_s + self._every_s
        return due

    def answered(self) -> None:
        """A question has been answered by everyone who could."""
        self.ever = True
        if self._open > self._outdated == 0:
            self.unsure = False
        self._open, self._outdated = max(0, self._open - 1), max(0, self._outdated - 1)

    def next_deadline_s(self) -> float | None:
        """When `due` will next be true."""
        wanted_s = self._asking.next_deadline_s()
        if wanted_s is not None:
            return wanted_s
        return None if math.isinf(self._again_at_s) else self._again_at_s


@dataclass(frozen=True, slots=True, eq=False)
class InheritedState:
    """The mission that an earlier life of the coordinator, or another one, has left."""

    replica: Replica
    mission_s: float | None
    """Mission time of now [s]; None when nobody knows."""

    @property
    def runs(self) -> bool:
        """Whether the mission has begun and has not ended."""
        epoch = self.replica.epoch
        return epoch is not None and epoch.phase is MissionPhase.RUNNING


def inherited_state(
    snapshots: Sequence[Snapshot],
    heard: Iterable[Message] = (),
    memory: Snapshot | None = None,
    *,
    memory_is_young: bool = False,
) -> InheritedState:
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
    return InheritedState(replica, mission_s)


def without_incarnation(snapshots: Iterable[Snapshot], incarnation: int) -> list[Snapshot]:
    """``snapshots`` without what the coordinator of that life has said."""

    def counts(message: Message) -> bool:
        return message.writer != COORDINATOR or message.stamp.incarnation != incarnation

    return [
        replace(snapshot, messages=tuple(filter(counts, snapshot.messages)))
        for snapshot in snapshots
    ]


def coordinator_messages(messages: Iterable[Message]) -> list[Message]:
    """Those of the coordinator's seat."""
    return [message for message in messages if message.writer == COORDINATOR]


def _counts(
    memory: Snapshot, living: Replica, snapshots: Sequence[Snapshot], *, is_young: bool
) -> bool:
    remembered = Replica()
    remembered.join_all(memory.messages)
    if living.brief is not None:
        return remembered.brief is not None and remembered.brief.run == living.brief.run
    over = remembered.epoch is not None and remembered.epoch.phase is MissionPhase.ENDED
    ended = over and abort_command(remembered) is None
    somebody_flies = any(snapshot.writer in living.claims for snapshot in snapshots)
    return living.epoch is None and is_young and (somebody_flies or not ended)


class LeadershipStage(IntEnum):
    """How far a coordinator has come with its mission."""

    LEARNING = 0
    """It has said nothing yet."""
    BRIEFED = 1
    STARTED = 2
    """It has announced that the mission runs, or has ended."""


def stage_of(answer: Snapshot) -> LeadershipStage:
    """How far the coordinator has come that answers so."""
    own = [m for m in answer.messages if m.writer == answer.writer]
    if answer.mission_s is not None or any(isinstance(m.body, PlanEpoch) for m in own):
        return LeadershipStage.STARTED
    return LeadershipStage.BRIEFED if own else LeadershipStage.LEARNING


def yields_to(standing: LeadershipStage, incarnation: int, answer: Snapshot) -> bool:
    """Whether the coordinator of that standing and incarnation leaves its seat to the other.

    Who has started the mission keeps the seat, else who has briefed the fleet; among
    equals the higher incarnation, which all the fleet listens to. As long as neither has
    said anything, the one that came first may.

    Args:
        standing: how far it has come itself.
        incarnation: its own.
        answer: the other one's answer to a question, so the other one lives.
    """
    theirs = stage_of(answer)
    if standing is theirs is LeadershipStage.LEARNING:
        return answer.incarnation < incarnation
    return (theirs, answer.incarnation) > (standing, incarnation)
