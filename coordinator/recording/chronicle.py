"""What happened in a recorded mission, event by event, in sentences that say why.

Everything is told as the recorder heard it; what reached it late is told late. Leaves out:
picking what belongs to one task or UAV (coordinator.recording.explain).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from coordinator.observer import Observer
from coordinator.recording.reader import Recording
from coordinator.recording.sentences import (
    chosen,
    keeps,
    place_in_words,
    seconds,
    timeliness,
    value_in_words,
)
from coordinator.status.onlooker import Onlooker
from swarm.events import Heard, Learned
from swarm.model.ids import COORDINATOR
from swarm.state.claims import claim_strength
from swarm.wire.messages import (
    Board,
    Brief,
    Choice,
    Claim,
    ClaimPhase,
    Command,
    CommandKind,
    Epoch,
    EpochPhase,
    Message,
    Outcome,
    Result,
    StartWithout,
    Status,
    StatusPhase,
    TaskOrder,
)

__all__ = ["Chronicle", "Event", "chronicle"]

_COMMANDS = {
    CommandKind.HOLD: "The operator told {} to hold",
    CommandKind.RESUME: "The operator let {} go on",
    CommandKind.RETURN: "The operator sent {} home",
    CommandKind.ABORT: "The operator aborted the mission",
}
_SOON_S = 1.0
"""Within this time the reason of a claim has followed it, unless it was lost."""
_TRYING = (ClaimPhase.PROPOSED, ClaimPhase.HELD)


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that happened."""

    mission_s: float | None
    """Mission time [s]; None before the start."""
    kind: str
    """For programs: what sort of thing."""
    text: str
    """A sentence."""
    uavs: frozenset[str]
    """Whom it concerns."""
    tasks: frozenset[str]
    """Which tasks it concerns."""


@dataclass(slots=True)
class _Release:
    """A UAV's claim that went away, maybe since its attempt had ended."""

    event: Event
    claim: Claim


class Chronicle:
    """Tells the events of one recording; see `chronicle`."""

    def __init__(self, recording: Recording) -> None:
        self.events: list[Event] = []
        self._onlooker = Onlooker(recording.mission, recording.timing, None)
        self._onlooker.start(recording.start_s)
        self._now_s = recording.start_s
        self._untrue: set[int] = set()
        """Ids of events that later ones have proved wrong."""
        self._posted: set[str] = set()
        self._releases: dict[tuple[str, str], _Release] = {}
        self._lost_s: dict[str, tuple[str, float]] = {}
        """Task -> UAV that was lost on its way to it, and when."""
        self._turned: dict[str, Choice] = {}
        """UAV -> its latest choice."""
        self._lists: dict[str, tuple[str, ...]] = {}
        self._epoch: int | None = None
        self._over = False
        self._phases: dict[str, StatusPhase] = {}
        for entry in recording.entries:
            self._now_s = entry.now_s
            self._hear(entry.fact)
        self.events = [event for event in self.events if id(event) not in self._untrue]

    @property
    def observer(self) -> Observer:
        """All that was known in the end."""
        return self._onlooker.observer

    # -- facts --------------------------------------------------------------------------

    def _hear(self, fact: object) -> None:
        observer = self.observer
        match fact:
            case Heard(message):
                messages: Sequence[Message] = (message,)
            case Learned(snapshots):
                messages = [each for snapshot in snapshots for each in snapshot.messages]
            case _:
                messages = ()
        known = [(message, observer.replica.known(message)) for message in messages]
        claims = dict(observer.replica.claims)
        present, lost = set(observer.present), list(observer.lost)
        self._onlooker.step(fact, self._now_s)  # type: ignore[arg-type]  # entries hold facts
        for message, before in known:
            self._tell_message(message, before, claims)
        for uav in observer.lost:
            if uav not in lost:
                self._tell_loss(uav)
        for uav in lost:
            if uav not in observer.lost:
                self._tell("back", f"{uav} was back.", uavs=[uav])
        if COORDINATOR in present and COORDINATOR not in observer.present:
            self._tell("coordinator", "The coordinator was gone; the fleet went on by itself.")

    def _tell_message(
        self, message: Message, before: Message | None, claims: dict[str, Claim]
    ) -> None:
        body, writer = message.body, message.writer
        if isinstance(body, Choice):
            if self._turned.get(writer) != body:
                self._tell_choice(writer, body)
            return
        if isinstance(body, Status):
            self._tell_status(writer, body)
            return
        news = self.observer.replica.known(message) is message
        if not news or (before is not None and before.body == body):
            return
        brief = self.observer.replica.brief
        match body:
            case Board():
                self._tell_posting(body.task, body, by="the coordinator")
            case TaskOrder() | Command() | StartWithout() if (
                brief is not None and body.run != brief.run
            ):
                pass  # of another flight
            case TaskOrder():
                self._tell_posting(body.task, body, by="the operator")
            case Claim():
                self._tell_claim(writer, body, claims.get(writer))
            case Outcome():
                former = before.body if before is not None else None
                self._tell_outcome(writer, body, former)
            case Epoch():
                self._tell_epoch(body)
            case Command():
                self._tell_command(body)
            case StartWithout():
                why = f": {body.reason}" if body.reason else ""
                text = f"The operator let the mission start without {body.uav}{why}."
                self._tell("command", text, uavs=[body.uav])
            case Brief():
                pass

    # -- sentences ------------------------------------------------------------------------

    def _tell(
        self, kind: str, text: str, *, uavs: Iterable[str] = (), tasks: Iterable[str] = ()
    ) -> None:
        mission_s = self.observer.mission_s(self._now_s)
        self.events.append(Event(mission_s, kind, text, frozenset(uavs), frozenset(tasks)))

    def _tell_posting(self, task: str, entry: Board | TaskOrder, *, by: str) -> None:
        why = f": {entry.reason}" if isinstance(entry, TaskOrder) and entry.reason else ""
        if entry.withdrawn:
            self._tell("withdrawn", f"{by.capitalize()} withdrew {task}{why}.", tasks=[task])
            return
        if task in self._posted and not isinstance(entry, TaskOrder):
            return
        self._posted.add(task)
        service = f", service {seconds(entry.service_s)}" if entry.service_s else ""
        kind = f", kind {entry.kind}" if entry.kind else ""
        where = place_in_words(entry.position_enu_m)
        worth = f"value {value_in_words(entry.value)}"
        text = f"{by.capitalize()} posted {task}{why}: {worth}, {where}{service}{kind}."
        self._tell("posted", text, tasks=[task])

    def _tell_choice(self, uav: str, choice: Choice) -> None:
        self._turned[uav] = choice
        tasks = {choice.task} if choice.left is None else {choice.task, choice.left}
        self._tell("chosen", chosen(uav, choice), uavs=[uav], tasks=tasks)
        self._put_before_claim(uav, choice.task)
        for candidate in choice.candidates:
            if candidate.task not in tasks:
                score = value_in_words(candidate.score)
                best = value_in_words(choice.score)
                text = (
                    f"{uav} preferred {choice.task} (score {best}) to {candidate.task} ({score})."
                )
                self._tell("passed over", text, tasks=[candidate.task])

    def _put_before_claim(self, uav: str, task: str) -> None:
        """Agents say what they take first, and why afterwards; people want it the other way."""
        told = self.events[-1]
        for place in range(len(self.events) - 2, -1, -1):
            event = self.events[place]
            if (told.mission_s or 0.0) - (event.mission_s or 0.0) > _SOON_S:
                return
            if event.kind == "claimed" and uav in event.uavs and task in event.tasks:
                self.events.insert(place, self.events.pop())
                return

    def _tell_claim(self, uav: str, claim: Claim, before: Claim | None) -> None:
        left = before.task if before is not None and before.phase in _TRYING else None
        if left is not None and left != claim.task and before is not None:
            self._tell_release(uav, before, claim)
        task = claim.task
        if task is None:
            if claim.phase is ClaimPhase.IDLE and before is None:
                self._tell("free", f"{uav} was in the air and free.", uavs=[uav])
            elif claim.phase is ClaimPhase.PAUSED and left is None:
                self._tell("paused", f"{uav} held, as told.", uavs=[uav])
            return
        rivals = [
            (other, theirs)
            for other, theirs in self.observer.replica.claims.items()
            if other != uav and theirs.task == task and other in self.observer.present
        ]
        if left != task:
            taken = self._lost_s.pop(task, None)
            over = ""
            if taken is not None and taken[0] != uav:
                after = seconds(self._now_s - taken[1])
                over = f", taking over from {taken[0]} {after} after its loss was noticed"
            done = f"done at {seconds(claim.completion_s)} by its reckoning"
            text = f"{uav} claimed {task}{over}, and set off; {done}."
            self._tell("claimed", text, uavs=[uav], tasks=[task])
            for rival in rivals:
                strongest, weaker = sorted(
                    [(uav, claim), rival], key=lambda each: claim_strength(*each)
                )
                text = f"Both {weaker[0]} and {strongest[0]} claimed {task}: "
                text += keeps(strongest, weaker)
                self._tell("contested", text, uavs=[uav, rival[0]], tasks=[task])
        elif claim.phase is ClaimPhase.PROPOSED:
            self._tell("claimed", f"{uav} claimed {task} once more.", uavs=[uav], tasks=[task])
        elif before is not None and before.phase is ClaimPhase.PROPOSED:
            text = f"Nobody with a better claim objected: {uav} held {task}."
            self._tell("held", text, uavs=[uav], tasks=[task])

    def _tell_release(self, uav: str, before: Claim, claim: Claim) -> None:
        """A claim has gone; of an attempt that has ended nothing more need be said."""
        task = before.task or ""
        outcome = self.observer.replica.outcomes.get((uav, task))
        if outcome is not None and outcome.completed_s >= before.decided_s:
            return
        why = self._why_released(uav, task, before, claim)
        self._tell("released", f"{uav} gave {task} up{why}.", uavs=[uav], tasks=[task])
        self._releases[uav, task] = _Release(self.events[-1], before)

    def _why_released(self, uav: str, task: str, before: Claim, claim: Claim) -> str:
        observer = self.observer
        choice, entry = self._turned.get(uav), observer.replica.board.get(task)
        if choice is not None and choice.left == task and choice.task == claim.task:
            return f": it had turned aside to {choice.task}"
        if entry is not None and entry.withdrawn:
            return ": it had been withdrawn"
        for (other, what), outcome in observer.replica.outcomes.items():
            if what == task and other != uav and outcome.result is Result.DONE:
                return f": {other} had done it"
        for other, theirs in observer.replica.claims.items():
            if other != uav and theirs.task == task and other in observer.present:
                rival, mine = (other, theirs), (uav, before)
                if claim_strength(*rival) < claim_strength(*mine):
                    return f" to {other}: {keeps(rival, mine)[:-1]}"
        match claim.phase:
            case ClaimPhase.PAUSED:
                return ", told to hold"
            case ClaimPhase.OUT:
                status = observer.statuses.get(uav)
                note = f": {status.note}" if status is not None and status.note else ""
                return f" and took no further part{note}"
            case _:
                return ""

    def _tell_outcome(self, uav: str, outcome: Outcome, former: object) -> None:
        task = outcome.task
        if isinstance(former, Outcome) and former.completed_s == outcome.completed_s:
            return
        release = self._releases.pop((uav, task), None)
        claim = self.observer.replica.claims.get(uav) if release is None else release.claim
        if release is not None:
            # It was no giving up: the end of the attempt was merely heard of later.
            self._untrue.add(id(release.event))
        choice = self._turned.get(uav)
        predicted_s = None
        if claim is not None and claim.task == task:
            predicted_s = claim.completion_s
        elif choice is not None and choice.task == task:
            predicted_s = choice.completion_s
        late = "" if predicted_s is None else timeliness(outcome.completed_s - predicted_s)
        attempt = f" at its attempt number {outcome.attempt}" if outcome.attempt > 1 else ""
        at = f" at {seconds(outcome.completed_s)}"
        if outcome.result is Result.DONE:
            others = [
                other
                for (other, what), theirs in self.observer.replica.outcomes.items()
                if what == task and other != uav and theirs.result is Result.DONE
            ]
            again = f", though {others[0]} had done it before" if others else ""
            text = f"{uav} did {task}{at}{attempt}{late}{again}."
        else:
            brief = self.observer.replica.brief
            opens = brief is not None and brief.reattempt_failed
            then = "it was open again" if opens else "that was the end of it"
            text = f"{uav} tried {task}{attempt} and failed{at}; {then}."
        self._tell(outcome.result.value, text, uavs=[uav], tasks=[task])

    def _tell_loss(self, uav: str) -> None:
        claim = self.observer.replica.claims.get(uav)
        task = None if claim is None or claim.phase not in _TRYING else claim.task
        if task is None:
            self._tell("lost", f"{uav} was lost.", uavs=[uav])
            return
        self._lost_s[task] = uav, self._now_s
        text = f"{uav} was lost on its way; {task} was open again for everyone."
        self._tell("lost", text, uavs=[uav], tasks=[task])

    def _tell_status(self, uav: str, status: Status) -> None:
        before = self._phases.get(uav)
        self._phases[uav] = status.phase
        if status.phase is before:
            return
        note = f": {status.note}" if status.note else ""
        match status.phase:
            case StatusPhase.RETURNING:
                self._tell("returning", f"{uav} went home{note}.", uavs=[uav])
            case StatusPhase.HOME:
                self._tell("home", f"{uav} was home.", uavs=[uav])
            case StatusPhase.OUT:
                self._tell("out", f"{uav} took no further part{note}.", uavs=[uav])
            case _:
                pass

    def _tell_command(self, command: Command) -> None:
        why = f": {command.reason}" if command.reason else ""
        text = _COMMANDS[command.kind].format(command.target)
        fleet = command.kind is CommandKind.ABORT
        uavs = [uav.id for uav in self.observer.mission.uavs] if fleet else [command.target]
        self._tell("command", f"{text}{why}.", uavs=uavs)

    def _tell_epoch(self, epoch: Epoch) -> None:
        if epoch.phase is EpochPhase.ENDED:
            if self._over:
                return  # it is restated with every new mission time
            self._over = True
            everyone = [uav.id for uav in self.observer.mission.uavs]
            self._tell("end", f"The mission was over: {epoch.reason}.", uavs=everyone)
            return
        lists = {uav: tuple(tasks) for uav, tasks in epoch.routes.items()}
        changed = epoch.number != self._epoch or lists != self._lists
        if epoch.phase is not EpochPhase.RUNNING or not changed:
            return
        first, before = self._epoch is None, self._lists
        self._epoch, self._lists = epoch.number, lists
        why = f" ({epoch.reason})" if epoch.reason and not first else ""
        for uav, tasks in lists.items():
            if tasks != before.get(uav) and (tasks or before.get(uav)):
                shown = ", ".join(tasks) or "empty"
                text = f"In epoch {epoch.number}{why} the list of {uav} was {shown}."
                self._tell("list", text, uavs=[uav])
        was = dict(_places(before))
        for task, (uav, number) in _places(lists):
            text = f"Epoch {epoch.number}{why} planned {task} as number {number} for {uav}"
            former = was.get(task)
            if former is None or former[0] != uav:
                moved = "" if former is None else f", no longer for {former[0]}"
                self._tell("planned", f"{text}{moved}.", tasks=[task])


def _places(lists: dict[str, tuple[str, ...]]) -> Iterator[tuple[str, tuple[str, int]]]:
    """Tasks of all lists, each with its UAV and its place from 1."""
    for uav, tasks in lists.items():
        for number, task in enumerate(tasks, 1):
            yield task, (uav, number)


def chronicle(recording: Recording) -> Chronicle:
    """The events of ``recording``, in the order in which they were heard of."""
    return Chronicle(recording)
