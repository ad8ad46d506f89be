"""Single-writer registers and their join.

A `Replica` keeps of every register the statement with the highest stamp. Joining is
commutative, associative and idempotent, so loss, duplication and reordering delay agreement
and never break it. Claims and outcomes count of UAVs that the mission's configuration names.
Of tasks and zones the operator's word comes before the coordinator's. Who is alive is for
swarm.protocol.membership to say.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from typing import Final

from swarm.model.ids import FLEET
from swarm.protocol.encoding import FIELDS, encode
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.messages import (
    Message,
    MissionConfig,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    Snapshot,
    Stamp,
    StartWithout,
    TaskEdit,
    TaskEntry,
    demoted,
)
from swarm.protocol.seal import open_envelope
from swarm.protocol.sync import fingerprint
from swarm.protocol.uav_messages import Calibration, Claim, News, Outcome

# A bus without keys lets anybody make names up: they must not cost memory without end.
MOST_UNPOSTED: Final = 1000
"""Tasks that nobody has posted of which one writer may tell the outcome."""
MOST_STRANGE: Final = 1000
"""Claims, outcomes and commands of all UAVs together that the brief does not name."""
MOST_UNBRIEFED: Final = 20_000
"""The same as long as there is no brief, which may name any of them."""
MOST_TASKS: Final = 20_000
"""Tasks of the coordinator and of the operator."""
MOST_ZONES: Final = 1000
"""Zones of the operator."""
NO_ROOM: Final = "no room"
"""Reason under which is counted what these leave out."""


class Replica:
    """One process's picture of all registers of a mission."""

    def __init__(self) -> None:
        self._registers: dict[str, Message] = {}
        self._keys_of: dict[str, set[str]] = {}
        """By writer, of its registers."""
        self._several_lives: set[str] = set()
        """Writers of whom statements of more than one life have been heard."""
        self._digest: dict[str, int] = {}
        self._in_digest: dict[str, int] = {}
        """Fingerprint of each register, as far as the digest has been asked for."""
        self._changed: set[str] = set()
        """Keys of registers that have changed since."""
        self._changes = 0
        """How often registers have changed."""
        self._asked: tuple[int, str, frozenset[str]] | None = None
        """When, and what for, it was last asked for `answers`..."""
        self._answered: tuple[Message, ...] = ()
        """...and those."""
        self.heads: dict[str, Stamp] = {}
        """By writer, of its newest statement that is known."""
        self.brief: MissionConfig | None = None
        self.epoch: PlanEpoch | None = None
        self.epoch_stamp: Stamp | None = None
        self.board: dict[str, TaskEntry] = {}
        """By task id, the entry that counts: of the operator's order about the flight that the
        brief tells of, where there is one, else the coordinator's."""
        self.posted: dict[str, TaskEntry] = {}
        """By task id, what the coordinator says, whether it counts or not."""
        self.task_orders: dict[str, TaskEdit] = {}
        """By task id, what the operator says, orders for other flights among it."""
        self.claims: dict[str, Claim] = {}
        """By UAV id, of those in the brief; of all as long as there is none."""
        self.claimants: dict[str, dict[str, Claim]] = {}
        """By task id, those of these claims that are on it; none of it is empty."""
        self.outcomes: dict[tuple[str, str], Outcome] = {}
        """By UAV id and task id, of those in the brief likewise; as long as neither `board_version`
        nor `reattempts` grows, further ones come at the end."""
        self.calibrations: dict[str, Calibration] = {}
        """By UAV id, how those in the brief fly, likewise."""
        self._fleet: set[str] | None = None
        self.commands: dict[str, tuple[Stamp, OperatorCommand]] = {}
        """By target, those for other flights of the mission among them.

        All have one writer, so their stamps tell which is the newest of several."""
        self.starts: dict[str, StartWithout] = {}
        """By UAV id, for whom the operator does not wait; see swarm.protocol.operator_commands."""
        self.zone_edits: dict[str, ZoneEdit] = {}
        """By zone id, what the operator says, words for other flights among it; see there, too."""
        self.readies: dict[str, tuple[Stamp, UavReady]] = {}
        """By UAV id, what a person has seen to, words for other flights among it likewise."""
        self.stale = 0
        """Statements that were older than what was known."""
        self.overfull = 0
        """Statements left out because there were too many of their kind, see `MOST_STRANGE`."""
        self._unposted: Counter[str] = Counter()
        """By writer, outcomes that were taken in when their task was not on the board."""
        self._strange = 0
        """Registers about UAVs that the brief does not name."""
        self.board_version = 0
        """Grows with every change of brief or board."""
        self.task_version = 0
        """Grows with every change of brief, board or outcomes."""
        self.claim_version = 0
        """Grows with every change of claims that count."""
        self.calibration_version = 0
        """Grows with every change of how UAVs of the brief fly."""
        self.reattempts = 0
        """Outcomes that have taken the place of others, of those that count."""
        self._ordered: dict[str, tuple[TaskEdit, TaskEntry]] = {}
        """By task id, the order that counts and the entry of the board made from it."""

    def join(self, message: Message) -> bool:
        """Take ``message`` in; whether it was news. News is no register."""
        key = message.key
        known = self._registers.get(key)
        if known is message or isinstance(message.body, News):
            return False
        if known is not None and not _beats(message, known):
            self.stale += message.stamp < known.stamp
            if _says_more(message, known):
                self._registers[key] = message
                self._changed.add(key)
                self._changes += 1
            return False
        if known is None and not self._has_room(message):
            self.overfull += 1
            return False
        self._registers[key] = message
        self._keys_of.setdefault(message.writer, set()).add(key)
        self._changed.add(key)
        self._changes += 1
        head = self.heads.get(message.writer)
        if head is not None and head.incarnation != message.stamp.incarnation:
            self._several_lives.add(message.writer)
        if head is None or message.stamp > head:
            self.heads[message.writer] = message.stamp
        self.task_version += isinstance(message.body, Outcome)
        match message.body:
            case MissionConfig() as brief:
                self._take_brief(brief)
            case PlanEpoch() as epoch:
                self.epoch, self.epoch_stamp = epoch, message.stamp
            case TaskEntry(task=task) as entry:
                self.posted[task] = entry
                self._settle(task)
            case TaskEdit(task=task) as order:
                self.task_orders[task] = order
                self._settle(task)
            case Claim() | Outcome() | Calibration() if self._takes_part(message.writer):
                self._note(message)
            case OperatorCommand(target=target) as command:
                self.commands[target] = message.stamp, command
            case StartWithout(uav=uav) as start:
                self.starts[uav] = start
            case ZoneEdit() as edit:
                self._take_zone(edit)
            case UavReady(uav=uav) as ready:
                self.readies[uav] = message.stamp, ready
        return True

    def _has_room(self, message: Message) -> bool:
        """Whether one more register may be kept; takes its room then.

        Of the fleet everything has, but outcomes of ever more tasks that there are not: an honest
        UAV may tell of some before the board is known here. What is left out comes again, as
        everything that is not known.
        """
        body, writer = message.body, message.writer
        if isinstance(body, TaskEntry | TaskEdit):
            return len(self.posted) + len(self.task_orders) < MOST_TASKS
        if isinstance(body, ZoneEdit):
            return len(self.zone_edits) < MOST_ZONES
        strange = self._is_strange(message)
        if strange and self._strange >= (MOST_UNBRIEFED if self._fleet is None else MOST_STRANGE):
            return False
        if isinstance(body, Outcome) and body.task not in self.board:
            if self._unposted[writer] >= MOST_UNPOSTED:
                return False
            self._unposted[writer] += 1
        self._strange += strange
        return True

    def _is_strange(self, message: Message) -> bool:
        """Whether it is about a UAV that is not known to take part."""
        match message.body:
            case Claim() | Outcome() | Calibration():
                name = message.writer
            case OperatorCommand(target=target) if target != FLEET:
                name = target
            case UavReady(uav=uav):
                name = uav
            case _:
                return False
        return self._fleet is None or name not in self._fleet

    def _forget_strangers(self) -> None:
        """The brief has told who takes part: of all others no more is kept than there is room."""
        strange = sorted(key for key, said in self._registers.items() if self._is_strange(said))
        fleet = self._fleet or ()
        self._unposted = Counter({uav: n for uav, n in self._unposted.items() if uav in fleet})
        self._strange = min(len(strange), MOST_STRANGE)
        self.overfull += len(strange) - self._strange
        writers = set[str]()
        for key in strange[MOST_STRANGE:]:
            message = self._registers.pop(key)
            self._keys_of[message.writer].discard(key)
            self._changes += 1
            writers.add(message.writer)
            self._changed.discard(key)
            number = self._in_digest.pop(key, 0)
            self._digest[message.writer] = self._digest.get(message.writer, 0) ^ number
            if isinstance(message.body, OperatorCommand):
                del self.commands[message.body.target]
            elif isinstance(message.body, UavReady):
                del self.readies[message.body.uav]
        for writer in writers:
            stamps = [self._registers[key].stamp for key in self._keys_of[writer]]
            if stamps:
                self.heads[writer] = max(stamps)
            else:
                del self.heads[writer], self._digest[writer], self._keys_of[writer]
                self._several_lives.discard(writer)

    def is_premature(self, message: Message) -> bool:
        """Whether it briefs for another flight, by a coordinator that has not taken charge.

        One that starts and finds nobody begins a flight of its own until it learns of the one
        that is on, whose brief it restates then. What the operator has ordered counts on. Ask
        while a mission runs, and do not join what is premature.
        """
        body, known, epoch, stamp = message.body, self.brief, self.epoch, self.epoch_stamp
        if not isinstance(body, MissionConfig) or known is None:
            return False
        if epoch is None or stamp is None or epoch.phase is MissionPhase.ENDED:
            return False
        return body.run != known.run and stamp.incarnation < message.stamp.incarnation

    def ordered(self, task: str) -> TaskEdit | None:
        """The operator's order about ``task`` in this flight; None if there is none."""
        order, brief = self.task_orders.get(task), self.brief
        return order if order and brief is not None and order.run == brief.run else None

    def _take_brief(self, brief: MissionConfig) -> None:
        """Of another flight than before, other orders of the operator count."""
        before, self.brief = self.brief, brief
        if before is None or before.run != brief.run:
            for task in self.task_orders:
                self._settle(task)
        if before is None or before.uavs != brief.uavs:
            self._fleet = {uav.id for uav in brief.uavs}
            self._forget_strangers()
            self.claims.clear()
            self.claim_version += 1
            self.claimants.clear()
            self.outcomes.clear()
            self.calibrations.clear()
            self.calibration_version += 1
            for message in self._registers.values():
                if self._takes_part(message.writer):
                    self._note(message)
        self.board_version += 1
        self.task_version += 1

    def _take_zone(self, edit: ZoneEdit) -> None:
        """Where one may fly is part of the mission, and so of the board."""
        before, self.zone_edits[edit.zone.id] = self.zone_edits.get(edit.zone.id), edit
        run = None if self.brief is None else self.brief.run
        if any(word is not None and word.run == run for word in (before, edit)):
            self.board_version += 1
            self.task_version += 1

    def _takes_part(self, writer: str) -> bool:
        """Whether what that UAV claims and has done counts: it must be one of those briefed."""
        return self._fleet is None or writer in self._fleet

    def _note(self, message: Message) -> None:
        """What a UAV that takes part claims, or has done, or how it flies."""
        match message.body:
            case Claim() as claim:
                self._note_claim(message.writer, claim)
            case Outcome(task=task) as outcome:
                self.reattempts += (message.writer, task) in self.outcomes
                self.outcomes[message.writer, task] = outcome
            case Calibration() as calibration:
                self.calibration_version += self.calibrations.get(message.writer) != calibration
                self.calibrations[message.writer] = calibration
            case _:
                pass

    def _note_claim(self, uav: str, claim: Claim) -> None:
        before, self.claims[uav] = self.claims.get(uav), claim
        self.claim_version += before != claim
        if before is not None and before.task is not None:
            rivals = self.claimants[before.task]
            del rivals[uav]
            if not rivals:
                del self.claimants[before.task]
        if claim.task is not None:
            self.claimants.setdefault(claim.task, {})[uav] = claim

    def _settle(self, task: str) -> None:
        """Find out anew what counts of all that is said of ``task``."""
        order, known = self.ordered(task), self._ordered.pop(task, None)
        if order is None:
            entry = self.posted.get(task)
        else:
            entry = known[1] if known is not None and known[0] is order else _entry_of(order)
            self._ordered[task] = order, entry
        before = self.board.get(task)
        if entry == before:
            return
        if entry is None:
            del self.board[task]
        else:
            self.board[task] = entry
        self.board_version += 1
        self.task_version += 1

    def join_all(self, messages: Iterable[Message]) -> bool:
        """Take many in; whether any was news."""
        return sum(self.join(message) for message in messages) > 0

    def demote_revoked(self, signers: Collection[str]) -> None:
        """Of all that ``signers`` have said so far, let any later word be worth more.

        Their keys are replaced or revoked, and who had them may have given its words the largest
        stamps there are. What they say counts until somebody says otherwise: done stays done.
        """
        registers = self._registers.values()
        words = [(old, new) for old in registers if (new := _without(signers, old)) is not old]
        for _, message in words:
            self._registers[message.key] = message
            self._changed.add(message.key)
            self._changes += 1
            match message.body:
                case PlanEpoch():
                    self.epoch_stamp = message.stamp
                case OperatorCommand(target=target) as command:
                    self.commands[target] = message.stamp, command
                case UavReady(uav=uav) as ready:
                    self.readies[uav] = message.stamp, ready
                case _:
                    pass
        for writer in {message.writer for _, message in words}:
            self._several_lives.add(writer)
            self.heads[writer] = max(m.stamp for m in self.messages({writer}))

    def messages(self, writers: Iterable[str] | None = None) -> Iterator[Message]:
        """All registers, or those of ``writers``, in key order."""
        if writers is None:
            keys = sorted(self._registers)
        else:
            keys = sorted(key for each in set(writers) for key in self._keys_of.get(each, ()))
        for key in keys:
            yield self._registers[key]

    def answers(self, own: str, steady: Collection[str]) -> tuple[Message, ...]:
        """What ``own`` answers for, in key order.

        That is its own registers and those of all who may not remember them: who is not
        steady, and of everyone what an earlier life has said, which the present one may
        not have found yet. ``steady`` are the writers that are there and remember all they ever
        said. When somebody is lost everybody asks, so the last answer is kept until it changes.
        """
        asked = self._changes, own, frozenset(steady)
        if self._asked != asked:
            registers, whole = self._registers, self._keys_of.keys() - (set(steady) - {own})
            answered = [key for writer in whole for key in self._keys_of[writer]]
            for writer in self._several_lives - whole:
                newest = self.heads[writer].incarnation
                keys = self._keys_of[writer]
                answered += [k for k in keys if registers[k].stamp.incarnation < newest]
            self._asked, self._answered = asked, tuple(registers[key] for key in sorted(answered))
        return self._answered

    def digest(self) -> dict[str, int]:
        """Writer -> a number that is equal wherever all its registers are."""
        for key in self._changed:
            message = self._registers[key]
            number = fingerprint(message)
            change = number ^ self._in_digest.get(key, 0)
            self._digest[message.writer] = self._digest.get(message.writer, 0) ^ change
            self._in_digest[key] = number
        self._changed.clear()
        return dict(self._digest)

    def writers(self) -> set[str]:
        """Everyone who has said something."""
        return set(self.heads)

    def known(self, message: Message) -> Message | None:
        """What is known of the register that ``message`` is about."""
        return self._registers.get(message.key)

    def register(self, key: str) -> Message | None:
        """What is known of the register of that key."""
        return self._registers.get(key)


def without_signers(signers: Collection[str], messages: Iterable[Message]) -> list[Message]:
    """``messages``, those that ``signers`` have signed `demoted`: `Replica.demote_revoked`."""
    return [_without(signers, message) for message in messages]


def snapshot_without(signers: Collection[str], snapshot: Snapshot) -> Snapshot:
    """``snapshot``, and what ``signers`` have signed in it `demoted`."""
    return replace(snapshot, messages=tuple(without_signers(signers, snapshot.messages)))


def _without(signers: Collection[str], message: Message) -> Message:
    envelope = None if message.envelope is None else open_envelope(message.envelope)
    # Of recordings, which have no signatures, the writer is the best that is known.
    signer = message.writer if envelope is None else envelope.signer
    return demoted(message) if signer in signers else message


def _entry_of(order: TaskEdit) -> TaskEntry:
    """What ``order`` puts on the board."""
    return TaskEntry(**{name: getattr(order, name) for name in FIELDS[TaskEntry]})


def _says_more(new: Message, known: Message) -> bool:
    """Whether it is the same statement with a signature that the known one has lost, or with
    more that only newer releases understand.

    An older one that repeats another's statement may have left that out.
    """
    if new.stamp != known.stamp or new.body != known.body:
        return False
    if known.envelope is None and new.envelope is not None:
        return True
    return new.said is not None and new.said > encode(known)


def _beats(new: Message, known: Message) -> bool:
    """A total order on statements of one register.

    Equal stamps with different contents need two processes under one name; the
    larger bytes win then, so that all replicas still agree.
    """
    if new.stamp != known.stamp:
        return new.stamp > known.stamp
    return new.body != known.body and encode(new) > encode(known)
