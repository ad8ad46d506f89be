"""Who leads a mission, and from which state.

Two coordinators meet when one was started beside the other, or after a partition in which the one
standing by took over. Both apply one rule to what they know of each other, `LeadershipBid`, so one
gives way. Who leads asks before it decides (`StateQuery`), goes on from what those who fly the
mission answer or from its own memory (`Predecessors`), and later takes in what the other side of a
partition has done (`reunion`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from statistics import median_high

from swarm.model.ids import COORDINATOR
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch, Snapshot
from swarm.protocol.operator_commands import abort_command
from swarm.protocol.registers import Replica, snapshot_without, without_signers
from swarm.protocol.sync import MOST_OPEN, QuestionTimer
from swarm.protocol.timing import stretch_of


class LeadershipStage(IntEnum):
    """How far a coordinator has come with its mission."""

    LEARNING = 0
    """It has said nothing yet."""
    BRIEFED = 1
    STARTED = 2
    """It has announced that the mission runs, or has ended."""


@dataclass(frozen=True, slots=True)
class LeadershipBid:
    """What one coordinator has to say for leading the mission.

    The agents follow the highest stamp alone, so its incarnation is the term of a coordinator: who
    takes over speaks under a higher one than any it knows, and the last three digits stay those of
    its process, so no two lead in one term. A process that has just started has the highest term
    of all by its clock, though, and knows the least. So how far each has come goes first.
    """

    stage: LeadershipStage
    term: int

    @classmethod
    def of(cls, answer: Snapshot) -> LeadershipBid:
        """That of the coordinator which answers so, and therefore lives."""
        own = [m for m in answer.messages if m.writer == answer.writer]
        if answer.mission_s is not None or any(isinstance(m.body, PlanEpoch) for m in own):
            stage = LeadershipStage.STARTED
        else:
            stage = LeadershipStage.BRIEFED if own else LeadershipStage.LEARNING
        return cls(stage, answer.incarnation)

    def yields_to(self, other: LeadershipBid) -> bool:
        """Whether this one leaves its seat to the other.

        Who has started the mission keeps the seat, else who has briefed the fleet; among
        equals the higher term, which all the fleet listens to. As long as neither has said
        anything, the one that came first may.
        """
        if self.stage is other.stage is LeadershipStage.LEARNING:
            return other.term < self.term
        return (other.stage, other.term) > (self.stage, self.term)


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
        self._asking = QuestionTimer(gap_s, MOST_OPEN)
        self._every_s = every_s
        self._again_at_s = math.inf
        self._outdated = 0
        """Questions without an answer that were asked before the last doubt."""

    def want(self, now_s: float, *, before_deciding: bool = False) -> None:
        """There is a reason to ask; ``before_deciding`` if what is known may be old."""
        if before_deciding:
            self.unsure, self._outdated = True, self._asking.open
        self._asking.want(now_s)

    def due(self, now_s: float, present: int = 0) -> bool:
        """Whether to ask now, with so many ``present`` who all answer; True for each question."""
        self._asking.stretch = stretch_of(present)
        if self._again_at_s <= now_s:
            self._asking.want(now_s)
        due = self._asking.due(now_s)
        if due:
            self._again_at_s = now_s + self._every_s
        return due

    def answered(self) -> None:
        """A question has been answered by everyone who could."""
        self.ever = True
        if self._asking.open > self._outdated == 0:
            self.unsure = False
        self._asking.answered()
        self._outdated = max(0, self._outdated - 1)

    def next_deadline_s(self) -> float | None:
        """When `due` will next be true."""
        wanted_s = self._asking.next_deadline_s()
        if wanted_s is not None or self._asking.is_full:
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

    @property
    def has_ended(self) -> bool:
        """Whether the mission has ended."""
        epoch = self.replica.epoch
        return epoch is not None and epoch.phase is MissionPhase.ENDED


def inherited_state(
    snapshots: Sequence[Snapshot],
    heard: Iterable[Message] = (),
    memory: Snapshot | None = None,
    *,
    memory_is_young: bool = False,
) -> InheritedState:
    """All that is known of the mission which is being flown: ``heard``, answered and remembered.

    The living go first. The own memory, its mission time brought to now, adds to what they know of
    the same flight; where they know of none it counts only while it is young, and if it is of a
    mission that had ended of itself only while somebody still takes part. One that was aborted is
    not begun anew by a process that merely starts again.
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


def coordinator_messages(messages: Iterable[Message]) -> list[Message]:
    """Those of the coordinator's seat."""
    return [message for message in messages if message.writer == COORDINATOR]


class Predecessors:
    """What is known of other coordinators of the mission, until one's own words are above theirs.

    Args:
        memory: of an earlier life, its mission time brought to ``now_s`` of `begin`; None if there
            is none.
    """

    def __init__(self, memory: Snapshot | None, *, memory_is_young: bool) -> None:
        self.overheard: list[Message] = []
        """Words from this seat that are not its own."""
        self._memory = memory
        self._memory_is_young = memory_is_young
        self._began_s = 0.0
        self._answers: list[Snapshot] = []

    def begin(self, now_s: float) -> None:
        """The process starts, and what it remembers grows older from now on."""
        self._began_s = now_s

    def answered(self, snapshots: Sequence[Snapshot]) -> None:
        """What others know, before this one is in charge."""
        self._answers += snapshots

    def disown(self, names: Collection[str]) -> None:
        """Of what was signed by those, whose keys are replaced, any later word is worth more."""
        self.overheard = without_signers(names, self.overheard)
        self._answers = [snapshot_without(names, answer) for answer in self._answers]
        if self._memory is not None:
            self._memory = snapshot_without(names, self._memory)

    def memory(self, now_s: float) -> Snapshot | None:
        """Of the earlier life, with the mission time of now; None once it has been `succeeded`."""
        memory = self._memory
        if memory is None or memory.mission_s is None:
            return memory
        return replace(memory, mission_s=memory.mission_s + (now_s - self._began_s))

    def inherited(self, heard: Iterable[Message], now_s: float) -> InheritedState:
        """The mission to go on with, by all that is known; ``heard`` besides."""
        memory = self.memory(now_s)
        said = [*heard, *self.overheard]
        return inherited_state(self._answers, said, memory, memory_is_young=self._memory_is_young)

    def succeeded(self) -> None:
        """Whoever came before is followed; their words are outdone."""
        self.overheard, self._answers, self._memory = [], [], None


@dataclass(frozen=True, slots=True, eq=False)
class Reunion:
    """What who leads makes of what others answer."""

    inherited: InheritedState
    """All that they know."""
    is_open: bool
    """Whether one that has come as far may live, and has said newer things: it is not outdone, or
    the two would outbid each other for ever instead of one giving way. Ask again."""
    is_followed: bool
    """Whether the newer words are of a coordinator that is gone and hold."""
    theirs: list[Message]
    """What others have said from this seat."""
    posts: list[Message]
    """What of it may be on the board, or withdrawn, without being so here."""


def reunion(
    snapshots: Sequence[Snapshot], overheard: Sequence[Message], bid: LeadershipBid, *, runs: bool
) -> Reunion:
    """What has become known to who leads, of others that lead or have led.

    Newer statements from this seat than the own ones are of a coordinator that is gone: they
    hold, unless it had only begun a mission that runs already. No coordinator to whom this one
    yields is among ``snapshots``; ``overheard`` is what was heard from this seat besides.
    """
    # Who has only begun a flight takes the brief of the one that runs for its own.
    inherited = inherited_state(snapshots if runs else _without_incarnation(snapshots, bid.term))
    theirs = coordinator_messages(inherited.replica.messages())
    newer = [m for m in theirs if m.stamp.incarnation > bid.term]
    newer_heard = newer or any(m.stamp.incarnation > bid.term for m in overheard)
    others = [answer for answer in snapshots if answer.writer == COORDINATOR]
    equals = [other for other in others if LeadershipBid.of(other).stage is bid.stage]
    newer_hold = any(isinstance(message.body, PlanEpoch) for message in newer)
    posts: list[Message] = []
    if runs:
        posts = [m for m in theirs if m.stamp.incarnation < bid.term]
        same = [s for s in others if LeadershipBid.of(s).stage is LeadershipStage.STARTED]
        posts += [m for s in same for m in coordinator_messages(s.messages)]
    return Reunion(
        inherited=inherited,
        is_open=bool(equals and newer_heard),
        is_followed=newer_hold if runs else inherited.runs,
        theirs=theirs,
        posts=posts,
    )


def _without_incarnation(snapshots: Iterable[Snapshot], incarnation: int) -> list[Snapshot]:
    """``snapshots`` without what the coordinator of that life has said."""

    def counts(message: Message) -> bool:
        return message.writer != COORDINATOR or message.stamp.incarnation != incarnation

    return [
        replace(snapshot, messages=tuple(filter(counts, snapshot.messages)))
        for snapshot in snapshots
    ]


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
