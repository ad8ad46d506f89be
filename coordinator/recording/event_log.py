"""What happened in a recorded mission, event by event, in sentences that say why.

Everything is told as the recorder heard it; what reached it late is told late. Leaves out:
picking what belongs to one task or UAV (coordinator.recording.explanation).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver
from coordinator.recording.reader import Recording
from coordinator.recording.wording import (
    choice_in_words,
    contest_in_words,
    lateness_in_words,
    place_in_words,
    seconds_in_words,
    value_in_words,
)
from swarm.model.ids import COORDINATOR
from swarm.protocol.board import claim_strength
from swarm.protocol.events import MessageReceived, SnapshotsReceived
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionConfig,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    StartWithout,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.uav_messages import (
    AttemptResult,
    Choice,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)

__all__ = ["EventLog", "LoggedEvent", "events_of"]


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
class LoggedEvent:
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

    event: LoggedEvent
    claim: Claim


class EventLog:
    """Tells the events of one recording; see `events_of`."""

    def __init__(self, recording: Recording) -> None:
        self.events: list[LoggedEvent] = []
        self._observer = MissionObserver(recording.mission, recording.timing, None)
        self._observer.start(recording.start_s)
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
    def mission_state(self) -> MissionState:
        """All that was known in the end."""
        return self._observer.mission_state

    # -- facts --------------------------------------------------------------------------

    def _hear(self, fact: object) -> None:
        mission_state = self.mission_state
        match fact:
            case MessageReceived(message):
                messages: Sequence[Message] = (message,)
            case SnapshotsReceived(snapshots):
                messages = [each for snapshot in snapshots for each in snapshot.messages]
            case _:
                messages = ()
        known = [(message, mission_state.replica.known(message)) for message in messages]
        claims = dict(mission_state.replica.claims)
        present, lost = set(mission_state.present), list(mission_state.lost)
        self._observer.step(fact, self._now_s)  # type: ignore[arg-type]  # entries hold facts
        for message, before in known:
            self._tell_message(message, before, claims)
        for uav in mission_state.lost:
            if uav not in lost:
                self._tell_loss(uav)
        for uav in lost:
            if uav not in mission_state.lost:
                self._tell("back", f"{uav} was back.", uavs=[uav])
        if COORDINATOR in present and COORDINATOR not in mission_state.present:
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
        news = self.mission_state.replica.known(message) is message
        if not news or (before is not None and before.body == body):
            return
        brief = self.mission_state.replica.brief
        match body:
            case TaskEntry():
                self._tell_posting(body.task, body, by="the coordinator")
            case TaskEdit() | OperatorCommand() | StartWithout() if (
                brief is not None and body.run != brief.run
            ):
                pass  # of another flight
            case TaskEdit():
                self._tell_posting(body.task, body, by="the operator")
            case Claim():
                self._tell_claim(writer, body, claims.get(writer))
            case Outcome():
                former = before.body if before is not None else None
                self._tell_outcome(writer, body, former)
            case PlanEpoch():
                self._tell_epoch(body)
            case OperatorCommand():
                self._tell_command(body)
            case StartWithout():
                why = f": {body.reason}" if body.reason else ""
                text = f"The operator let the mission start without {body.uav}{why}."
                self._tell("command", text, uavs=[body.uav])
            case MissionConfig():
                pass

    # -- sentences ------------------------------------------------------------------------

    def _tell(
        self, kind: str, text: str, *, uavs: Iterable[str] = (), tasks: Iterable[str] = ()
    ) -> None:
        mission_s = self.mission_state.mission_s(self._now_s)
        self.events.append(LoggedEvent(mission_s, kind, text, frozenset(uavs), frozenset(tasks)))

    def _tell_posting(self, task: str, entry: TaskEntry | TaskEdit, *, by: str) -> None:
        why = f": {entry.reason}" if isinstance(entry, TaskEdit) and entry.reason else ""
        if entry.withdrawn:
            self._tell("withdrawn", f"{by.capitalize()} withdrew {task}{why}.", tasks=[task])
            return
        if task in self._posted and not isinstance(entry, TaskEdit):
            return
        self._posted.add(task)
        service = f", service {seconds_in_words(entry.service_s)}" if entry.service_s else ""
        kind = f", kind {entry.kind}" if entry.kind else ""
        where = place_in_words(entry.position_enu_m)
        worth = f"value {value_in_words(entry.value)}"
        text = f"{by.capitalize()} posted {task}{why}: {worth}, {where}{service}{kind}."
        self._tell("posted", text, tasks=[task])

    def _tell_choice(self, uav: str, choice: Choice) -> None:
        self._turned[uav] = choice
        tasks = {choice.task} if choice.left is None else {choice.task, choice.left}
        self._tell("chosen", choice_in_words(uav, choice), uavs=[uav], tasks=tasks)
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
            for other, theirs in self.mission_state.replica.claims.items()
            if other != uav and theirs.task == task and other in self.mission_state.present
        ]
        if left != task:
            taken = self._lost_s.pop(task, None)
            over = ""
            if taken is not None and taken[0] != uav:
                after = seconds_in_words(self._now_s - taken[1])
                over = f", taking over from {taken[0]} {after} after its loss was noticed"
            done = f"done at {seconds_in_words(claim.completion_s)} by its reckoning"
            text = f"{uav} claimed {task}{over}, and set off; {done}."
            self._tell("claimed", text, uavs=[uav], tasks=[task])
            for rival in rivals:
                strongest, weaker = sorted(
                    [(uav, claim), rival], key=lambda each: claim_strength(*each)
                )
                text = f"Both {weaker[0]} and {strongest[0]} claimed {task}: "
                text += contest_in_words(strongest, weaker)
                self._tell("contested", text, uavs=[uav, rival[0]], tasks=[task])
        elif claim.phase is ClaimPhase.PROPOSED:
            self._tell("claimed", f"{uav} claimed {task} once more.", uavs=[uav], tasks=[task])
        elif before is not None and before.phase is ClaimPhase.PROPOSED:
            text = f"Nobody with a better claim objected: {uav} held {task}."
            self._tell("held", text, uavs=[uav], tasks=[task])

    def _tell_release(self, uav: str, before: Claim, claim: Claim) -> None:
        """A claim has gone; of an attempt that has ended nothing more need be said."""
        task = before.task or ""
        outcome = self.mission_state.replica.outcomes.get((uav, task))
        if outcome is not None and outcome.completed_s >= before.decided_s:
            return
        why = self._why_released(uav, task, before, claim)
        self._tell("released", f"{uav} gave {task} up{why}.", uavs=[uav], tasks=[task])
        self._releases[uav, task] = _Release(self.events[-1], before)

    def _why_released(self, uav: str, task: str, before: Claim, claim: Claim) -> str:
        mission_state = self.mission_state
        choice, entry = self._turned.get(uav), mission_state.replica.board.get(task)
        if choice is not None and choice.left == task and choice.task == claim.task:
            return f": it had turned aside to {choice.task}"
        if entry is not None and entry.withdrawn:
            return ": it had been withdrawn"
        for (other, what), outcome in mission_state.replica.outcomes.items():
            if what == task and other != uav and outcome.result is AttemptResult.DONE:
                return f": {other} had done it"
        for other, theirs in mission_state.replica.claims.items():
            if other != uav and theirs.task == task and other in mission_state.present:
                rival, mine = (other, theirs), (uav, before)
                if claim_strength(*rival) < claim_strength(*mine):
                    return f" to {other}: {contest_in_words(rival, mine)[:-1]}"
        match claim.phase:
            case ClaimPhase.PAUSED:
                return ", told to hold"
            case ClaimPhase.OUT:
                status = mission_state.statuses.get(uav)
                note = f": {status.note}" if status is not None and status.note else ""
                return f" and took no further part{note}"
            case _:
                return ""

    def _tell_outcome(self, uav: str, outcome: Outcome, former: object) -> None:
        task = outcome.task
        if isinstance(former, Outcome) and former.completed_s == outcome.completed_s:
            return
        release = self._releases.pop((uav, task), None)
        claim = self.mission_state.replica.claims.get(uav) if release is None else release.claim
        if release is not None:
            # It was no giving up: the end of the attempt was merely heard of later.
            self._untrue.add(id(release.event))
        choice = self._turned.get(uav)
        predicted_s = None
        if claim is not None and claim.task == task:
            predicted_s = claim.completion_s
        elif choice is not None and choice.task == task:
            predicted_s = choice.completion_s
        late = "" if predicted_s is None else lateness_in_words(outcome.completed_s - predicted_s)
        attempt = f" at its attempt number {outcome.attempt}" if outcome.attempt > 1 else ""
        at = f" at {seconds_in_words(outcome.completed_s)}"
        if outcome.result is AttemptResult.DONE:
            others = [
                other
                for (other, what), theirs in self.mission_state.replica.outcomes.items()
                if what == task and other != uav and theirs.result is AttemptResult.DONE
            ]
            again = f", though {others[0]} had done it before" if others else ""
            text = f"{uav} did {task}{at}{attempt}{late}{again}."
        else:
            brief = self.mission_state.replica.brief
            opens = brief is not None and brief.reattempt_failed
            then = "it was open again" if opens else "that was the end of it"
            text = f"{uav} tried {task}{attempt} and failed{at}; {then}."
        self._tell(outcome.result.value, text, uavs=[uav], tasks=[task])

    def _tell_loss(self, uav: str) -> None:
        claim = self.mission_state.replica.claims.get(uav)
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

    def _tell_command(self, command: OperatorCommand) -> None:
        why = f": {command.reason}" if command.reason else ""
        text = _COMMANDS[command.kind].format(command.target)
        fleet = command.kind is CommandKind.ABORT
        uavs = [uav.id for uav in self.mission_state.mission.uavs] if fleet else [command.target]
        self._tell("command", f"{text}{why}.", uavs=uavs)

    def _tell_epoch(self, epoch: PlanEpoch) -> None:
        if epoch.phase is MissionPhase.ENDED:
            if self._over:
                return  # it is restated with every new mission time
            self._over = True
            everyone = [uav.id for uav in self.mission_state.mission.uavs]
            self._tell("end", f"The mission was over: {epoch.reason}.", uavs=everyone)
            return
        lists = {uav: tuple(tasks) for uav, tasks in epoch.routes.items()}
        changed = epoch.number != self._epoch or lists != self._lists
        if epoch.phase is not MissionPhase.RUNNING or not changed:
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


def events_of(recording: Recording) -> EventLog:
    """The events of ``recording``, in the order in which they were heard of."""
    return EventLog(recording)
