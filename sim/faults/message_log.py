"""What must hold of all that is said, wherever it was said: the invariants of the messages.

`MessageLog` is told every statement in the order it was made and keeps what breaks a rule:

- *stamps*: a process never says a register with a smaller stamp than before, in this life or
  an earlier one, nor with the same stamp and other contents; words of an earlier life that
  nobody was there to hear do not count, as nobody is deaf to what is said below them;
- *keeps its task*: a UAV leaves a task it claimed only when the task is done or withdrawn,
  another has a stronger claim on it, its vehicle refused, windows, its battery or zones do not
  allow it any more, its process started anew, the operator has said so, or the mission has ended
  for it; or, once for each task that appears and each loss it learns of, in flight for something
  better; so never because of re-planning.

It knows no process from within, so recordings of real ones can be told as well.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass

from swarm.protocol.board import claim_strength
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.uav_messages import AttemptResult, Claim, ClaimPhase, Outcome, Status


@dataclass(frozen=True, slots=True)
class Violation:
    """An invariant that did not hold."""

    at_s: float
    invariant: str
    """Which, in a word or two that stay the same for the same kind of breach."""
    text: str
    """What happened."""

    def __str__(self) -> str:
        return f"at {self.at_s:.3f} s, {self.invariant}: {self.text}"


class MessageLog:
    """Everything that is said about one mission."""

    def __init__(self) -> None:
        self.broken: list[Violation] = []
        self.posted: dict[str, TaskEntry] = {}
        """The newest entry of every task that a coordinator has ever put on the board."""
        self.ordered: dict[str, TaskEdit] = {}
        """The operator's newest word about every task that they have ever said anything about."""
        self.visits: dict[tuple[str, str], set[float]] = defaultdict(set)
        """By UAV and task: when attempts ended done [s mission time]."""
        self.unheard: dict[tuple[str, str], int] = {}
        """By UAV and task: the life that told of its visit when nobody was there to hear it, where
        nobody has told of it again."""
        self.failed: set[str] = set()
        """Tasks an attempt at which failed."""
        self.ended = False
        """Whether a coordinator has said that the mission is over."""
        self.commands: dict[CommandKind, set[str]] = defaultdict(set)
        """Whom the operator has ever told what."""
        self._said: dict[tuple[str, int, str], Message] = {}
        """By process, its life and register, what it said last."""
        self._heard: dict[tuple[str, str], Message] = {}
        """By process and register, what it said last in any life while somebody was there."""
        self._claims: dict[tuple[str, int], Claim] = {}
        self._rivals: dict[str, dict[str, list[Claim]]] = defaultdict(lambda: defaultdict(list))
        self._left: set[tuple[str, str]] = set()
        """UAV and task, where the UAV may leave the task undone."""
        self._turns: Counter[str] = Counter()
        self._missed: Counter[str] = Counter()

    @property
    def done(self) -> set[str]:
        """Tasks that were visited."""
        return {task for _, task in self.visits}

    @property
    def withdrawn(self) -> set[str]:
        """Tasks that were taken off the board."""
        entries: list[TaskEntry | TaskEdit] = [*self.posted.values(), *self.ordered.values()]
        return {entry.task for entry in entries if entry.withdrawn}

    @property
    def duplicates(self) -> int:
        """Visits to tasks that had been visited before."""
        return sum(map(len, self.visits.values())) - len(self.done)

    @property
    def aborted(self) -> bool:
        """Whether the operator has aborted the mission."""
        return bool(self.commands[CommandKind.ABORT])

    def sent_home(self, uav: str) -> bool:
        """Whether the operator has ended the mission for ``uav``."""
        return self.aborted or uav in self.commands[CommandKind.RETURN]

    def refused(self, uav: str, task: str) -> None:
        """The vehicle of ``uav`` will not fly to ``task``."""
        self._left.add((uav, task))

    def gave_up(self, uav: str, task: str) -> None:
        """``uav`` can't do ``task`` any more, in time, on its battery or round zones."""
        self._left.add((uav, task))

    def missed(self, uav: str) -> None:
        """``uav`` has given somebody up."""
        self._missed[uav] += 1

    def turned_aside(self, at_s: float, uav: str, task: str) -> None:
        """``uav`` has left ``task`` of its own accord; once for each task or loss it learned of."""
        self._left.add((uav, task))
        self._turns[uav] += 1
        appeared = self.posted.keys() | self.ordered.keys()
        if self._turns[uav] > len(appeared) + self._missed[uav]:
            self._break(at_s, "left its task", f"{uav} left {task} though nothing had opened")

    def said(
        self, at_s: float, process: str, life: int, message: Message, *, unheard: bool = False
    ) -> None:
        """A process has said something.

        Two processes may speak for one writer, one after the other; ``life`` is another number in
        every life of a process. ``unheard``: nobody was there to hear it.
        """
        if isinstance(message.body, Status):
            return
        self._check_stamp(at_s, process, life, message)
        self._said[process, life, message.key] = message
        if not unheard:
            self._heard[process, message.key] = message
        match message.body:
            case TaskEntry(task=task) as entry:
                self.posted[task] = entry
            case TaskEdit(task=task) as order:
                self.ordered[task] = order
            case PlanEpoch(phase=MissionPhase.ENDED):
                self.ended = True
            case Outcome(task=task, result=AttemptResult.DONE, completed_s=completed_s):
                visit = message.writer, task
                self.visits[visit].add(completed_s)
                self.unheard.pop(visit, None)
                if unheard:
                    self.unheard[visit] = life
            case Outcome(task=task):
                self.failed.add(task)
            case Claim() as claim:
                self._check_claim(at_s, message.writer, life, claim)
            case OperatorCommand(target=target, kind=kind):
                self.commands[kind].add(target)
            case _:
                pass

    def _check_stamp(self, at_s: float, process: str, life: int, message: Message) -> None:
        register = message.key
        own, heard = self._said.get((process, life, register)), self._heard.get((process, register))
        said = [each for each in (own, heard) if each is not None]
        before = max(said, key=lambda each: each.stamp, default=None)
        if before is not None and message.stamp < before.stamp:
            text = f"{process} said {register} with {message.stamp} after {before.stamp}"
            self._break(at_s, "stamps go back", text)
        elif before is not None and message.stamp == before.stamp and message.body != before.body:
            text = f"{process} said {register} differently with {message.stamp}"
            self._break(at_s, "one stamp, two contents", text)

    def _check_claim(self, at_s: float, uav: str, life: int, claim: Claim) -> None:
        before = self._claims.get((uav, life))
        self._claims[uav, life] = claim
        if claim.task is not None:
            said = self._rivals[claim.task][uav]
            if not said or said[-1] != claim:
                said.append(claim)
        if before is None or before.task is None or before.task == claim.task:
            return
        if not self._may_leave(uav, before, claim):
            now = claim.task or claim.phase.value
            self._break(at_s, "left its task", f"{uav} left {before.task} for {now}")

    def _may_leave(self, uav: str, before: Claim, claim: Claim) -> bool:
        task = str(before.task)
        if task in self.done | self.failed | self.withdrawn or (uav, task) in self._left:
            return True
        if claim.phase is ClaimPhase.OUT and (self.ended or self.sent_home(uav)):
            return True
        if claim.phase is ClaimPhase.PAUSED and uav in self.commands[CommandKind.HOLD]:
            return True
        own = claim_strength(uav, before)
        return any(
            claim_strength(rival, said) < own
            for rival, claims in self._rivals[task].items()
            if rival != uav
            for said in claims
        )

    def _break(self, at_s: float, invariant: str, text: str) -> None:
        self.broken.append(Violation(at_s, invariant, text))
