"""Why things happen in a mission: what an explanation knows beyond the story.

Of each claim who else wanted the task and why it was kept or given up, of each attempt how it
compares with what was predicted, of each choice what it passed over, of each epoch its lists.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from coordinator.mission_view.story import EventKind, MissionEvent, Story
from coordinator.mission_view.wording import (
    because,
    contest_in_words,
    goal_in_words,
    lateness_in_words,
    seconds_in_words,
    value_in_words,
)
from swarm.protocol.board import TaskBoard, claim_strength
from swarm.protocol.membership import Membership
from swarm.protocol.messages import MissionPhase, PlanEpoch
from swarm.protocol.uav_messages import AttemptResult, Choice, Claim, ClaimPhase, Outcome, Status

_SOON_S = 1.0
"""Within this time the reason of a claim has followed it, unless it was lost."""
_TRYING = (ClaimPhase.PROPOSED, ClaimPhase.HELD)


class TellEvent(Protocol):
    """Adds to a story what happened now."""

    def __call__(
        self,
        kind: EventKind,
        text: str,
        now_s: float,
        *,
        detail: str = "",
        uavs: list[str] | tuple[str, ...] = (),
        tasks: list[str] | tuple[str, ...] = (),
    ) -> None:
        """Tell it."""
        ...


class Reasons:
    """Knows why, from claims, choices, outcomes and lists."""

    def __init__(
        self, board: TaskBoard, membership: Membership, tell: TellEvent, story: Story
    ) -> None:
        self._replica = board.replica
        self._membership = membership
        self._tell = tell
        self._story = story
        self._releases: dict[tuple[str, str], tuple[MissionEvent, Claim]] = {}
        """By UAV and task: a claim that went away, maybe since its attempt had ended."""
        self._turned: dict[str, Choice] = {}
        """UAV -> its latest choice."""
        self._lists: dict[str, tuple[str, ...]] = {}
        self._epoch: int | None = None
        self._notes: dict[str, str] = {}

    def status(self, uav: str, status: Status) -> None:
        """Remember what a UAV says of itself."""
        self._notes[uav] = status.note

    def choice(self, uav: str, choice: Choice, now_s: float) -> None:
        """A choice has been told: tell it before its claim, and what was passed over."""
        self._turned[uav] = choice
        # Agents say what they take first, and why afterwards; people want it the other way.
        self._story.put_before(
            lambda event: uav in event.uavs and _follows(event, choice),
            _SOON_S,
        )
        for candidate in choice.candidates:
            if candidate.task not in (choice.task, choice.left):
                score, best = value_in_words(candidate.score), value_in_words(choice.score)
                text = f"{uav} preferred {choice.task} (score {best}) to {candidate.task} ({score})"
                self._tell(EventKind.PASSED_OVER, text, now_s, tasks=[candidate.task])

    # -- claims -------------------------------------------------------------------------

    def claim_phase(self, uav: str, claim: Claim, before: Claim | None, now_s: float) -> None:
        """Tell what becomes of a claim that names no other task than before."""
        task = claim.task
        if task is None:
            tried = before is not None and before.phase in _TRYING
            if claim.phase is ClaimPhase.IDLE and before is None:
                self._tell(EventKind.FREE, f"{uav} was in the air and free", now_s, uavs=[uav])
            elif claim.phase is ClaimPhase.PAUSED and not tried:
                self._tell(EventKind.PAUSED, f"{uav} held, as told", now_s, uavs=[uav])
        elif claim.phase is ClaimPhase.PROPOSED:
            text = f"{uav} claimed {task} once more"
            self._tell(EventKind.CLAIMED, text, now_s, uavs=[uav], tasks=[task])
        elif before is not None and before.phase is ClaimPhase.PROPOSED:
            text = f"nobody with a better claim objected: {uav} held {task}"
            self._tell(EventKind.HELD, text, now_s, uavs=[uav], tasks=[task])

    def of_claim(self, claim: Claim, after_s: float | None) -> str:
        """What a new claim predicts; ``after_s`` since the loss of whoever had the task [s]."""
        after = ""
        if after_s is not None:
            after = f" {seconds_in_words(after_s)} after its loss was noticed"
        return (
            f"{after}, and set off; done at {seconds_in_words(claim.completion_s)} by its reckoning"
        )

    def contest(self, uav: str, claim: Claim, now_s: float) -> None:
        """Tell of all others who claim the same, and who keeps the task."""
        task = claim.task or ""
        for rival in self._rivals(uav, task):
            strongest, weaker = sorted(
                [(uav, claim), rival], key=lambda each: claim_strength(*each)
            )
            text = f"both {weaker[0]} and {strongest[0]} claimed {task}: "
            text += contest_in_words(strongest, weaker)
            self._tell(EventKind.CONTESTED, text, now_s, uavs=[uav, rival[0]], tasks=[task])

    def release(self, uav: str, claim: Claim, before: Claim | None, now_s: float) -> None:
        """Tell that a claim has gone; of an attempt that has ended nothing more need be said."""
        task = None if before is None or before.phase not in _TRYING else before.task
        if before is None or task is None or task == claim.task:
            return
        outcome = self._replica.outcomes.get((uav, task))
        if outcome is not None and outcome.completed_s >= before.decided_s:
            return
        text = f"{uav} gave {task} up{self._why_released(uav, task, before, claim)}"
        self._tell(EventKind.RELEASED, text, now_s, uavs=[uav], tasks=[task])
        self._releases[uav, task] = self._story.lines[-1], before

    def _rivals(self, uav: str, task: str) -> list[tuple[str, Claim]]:
        present = self._membership.present
        return [
            (other, claim)
            for other, claim in self._replica.claims.items()
            if other != uav and claim.task == task and other in present
        ]

    def _why_released(self, uav: str, task: str, before: Claim, claim: Claim) -> str:
        choice, entry = self._turned.get(uav), self._replica.board.get(task)
        if choice is not None and choice.left == task and choice.task == claim.task:
            return f": it had turned aside to {goal_in_words(choice)}"
        if entry is not None and entry.withdrawn:
            return ": it had been withdrawn"
        for (other, what), outcome in self._replica.outcomes.items():
            if what == task and other != uav and outcome.result is AttemptResult.DONE:
                return f": {other} had done it"
        for rival in self._rivals(uav, task):
            if claim_strength(*rival) < claim_strength(uav, before):
                return f" to {rival[0]}: {contest_in_words(rival, (uav, before))}"
        match claim.phase:
            case ClaimPhase.PAUSED:
                return ", told to hold"
            case ClaimPhase.OUT:
                return f" and took no further part{because(self._notes.get(uav, ''))}"
            case _:
                return ""

    # -- attempts and lists -------------------------------------------------------------

    def of_outcome(self, uav: str, outcome: Outcome) -> str:
        """When an attempt ended, beside what had been predicted, and what follows."""
        task, choice = outcome.task, self._turned.get(uav)
        event, claim = self._releases.pop((uav, task), (None, self._replica.claims.get(uav)))
        if event is not None:
            # It was no giving up: the end of the attempt was merely heard of later.
            self._story.take_back(event)
        attempt = f" at its attempt number {outcome.attempt}" if outcome.attempt > 1 else ""
        told = f" at {seconds_in_words(outcome.completed_s)}{attempt}"
        if outcome.result is not AttemptResult.DONE:
            brief = self._replica.brief
            opens = brief is not None and brief.reattempt_failed
            return told + ("; it is open again" if opens else "; that is the end of it")
        if claim is not None and claim.task == task:
            return told + lateness_in_words(outcome.completed_s - claim.completion_s)
        if choice is not None and choice.task == task:
            return told + lateness_in_words(outcome.completed_s - choice.completion_s)
        return told

    def lists(self, epoch: PlanEpoch, now_s: float) -> None:
        """Tell whose list has changed, and which task stands where."""
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
                text = f"in epoch {epoch.number}{why} the list of {uav} was {shown}"
                self._tell(EventKind.LIST, text, now_s, uavs=[uav])
        was = dict(_places(before))
        for task, (uav, number) in _places(lists):
            former = was.get(task)
            if former is None or former[0] != uav:
                text = f"epoch {epoch.number}{why} planned {task} as number {number} for {uav}"
                text += "" if former is None else f", no longer for {former[0]}"
                self._tell(EventKind.PLANNED, text, now_s, tasks=[task])


def _follows(event: MissionEvent, choice: Choice) -> bool:
    """Whether that is what the UAV did by its choice."""
    if choice.task is None:
        return event.kind is EventKind.BASE
    return event.kind is EventKind.CLAIMED and choice.task in event.tasks


def _places(lists: dict[str, tuple[str, ...]]) -> Iterator[tuple[str, tuple[str, int]]]:
    """Tasks of all lists, each with its UAV and its place from 1."""
    for uav, tasks in lists.items():
        for number, task in enumerate(tasks, 1):
            yield task, (uav, number)
