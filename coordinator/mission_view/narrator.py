"""What happens in a mission, put into words: the one place that does.

A mission state says what it has heard and what that changes; here it becomes a line of the story,
with the detail that an explanation adds if one is wanted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

from coordinator.mission_view.pace import PacedClock
from coordinator.mission_view.reasons import Reasons
from coordinator.mission_view.story import EventKind, MissionEvent, Story
from coordinator.mission_view.wording import (
    because,
    choice_in_words,
    counted,
    entry_in_words,
    goal_in_words,
    left_out_in_words,
    listed,
    order_in_words,
    rates_in_words,
    visit_in_words,
    why_left_out,
    zone_in_words,
)
from swarm.model import Mission
from swarm.protocol.board import TaskBoard, TaskState
from swarm.protocol.calibration import FlightRates, is_calibrated
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.membership import Membership
from swarm.protocol.messages import (
    CommandKind,
    Message,
    MissionPhase,
    OperatorCommand,
    PlanEpoch,
    StartWithout,
    TaskEdit,
    TaskEntry,
)
from swarm.protocol.operator_commands import dispensable, in_force, readiness, zone_edits
from swarm.protocol.uav_messages import (
    AttemptResult,
    Calibration,
    Choice,
    Claim,
    ClaimPhase,
    Outcome,
    Status,
    StatusPhase,
)

NAMES_TOLD = 5
"""Of those whose keys have changed."""
_LEAVING = {
    StatusPhase.OUT: (EventKind.OUT, "gave its vehicle up"),
    StatusPhase.RETURNING: (EventKind.RETURNING, "goes home"),
}
"""Parts of an agent's life in which it takes no tasks any more, in words."""
_IN_FLIGHT = (StatusPhase.IDLE, StatusPhase.FLYING, StatusPhase.SERVING)
"""Parts in which a note is a remark about the vehicle."""
_UP_AGAIN = (
    "its battery is being changed",
    "waiting to hear",
    "waiting for",
    "setting",
    "arming",
    "takeoff",
    "climbing",
    "flying to",
)
"""How bridges begin to say what a vehicle does on a base, and on its way into the air again."""


class MissionNarrator:
    """Tells the story of one mission.

    Args:
        explains: say of everything why, and tell what needs an explanation alone: every claim,
            choice and list. Such a story is kept whole.
    """

    def __init__(
        self,
        mission: Mission,
        board: TaskBoard,
        membership: Membership,
        clock: PacedClock,
        *,
        explains: bool,
    ) -> None:
        self.story = Story(None) if explains else Story()
        self.joining = False
        """Whether what is heard is what happened before this process came."""
        self._board = board
        self._replica = board.replica
        self._clock = clock
        self._known_at_start = {task.id for task in mission.known_at_start().tasks}
        self._reasons = Reasons(board, membership, self.tell, self.story) if explains else None
        self._left: set[str] = set()
        """UAVs of which has been told why they left, while there was something to do."""
        self._remarks: dict[str, str] = {}
        """What was told last of each UAV's vehicle."""
        self._orphans: dict[str, tuple[str, float]] = {}
        """Task -> UAV that was lost on its way to it, and when."""
        self._left_out: dict[str, str] = {}
        """By task that the epoch in force leaves out, why."""

    def tell(
        self,
        kind: EventKind,
        text: str,
        now_s: float,
        *,
        detail: str = "",
        uavs: Iterable[str] = (),
        tasks: Iterable[str] = (),
        at_s: float | None = None,
    ) -> None:
        """Add to the story what happened now, or at mission time ``at_s``."""
        mission_s = self._clock.mission_s(now_s) if at_s is None else at_s
        self.story.add(
            MissionEvent(mission_s, text, kind, detail, frozenset(uavs), frozenset(tasks))
        )

    # -- what was said ------------------------------------------------------------------

    def hear(
        self, message: Message, earlier: Message | None, claim: Claim | None, now_s: float
    ) -> None:
        """Tell what a register newly says.

        ``earlier`` is what it said before, ``claim`` what the writer claimed.
        """
        body = message.body
        if earlier is not None and earlier.body == body and not isinstance(body, PlanEpoch):
            return  # said again, as by a new life of its writer
        match body:
            case PlanEpoch():
                if self._reasons is not None:
                    self._reasons.lists(body, now_s)
            case TaskEntry():
                self._hear_entry(body, earlier, now_s)
            case Claim():
                self._hear_claim(message.writer, body, claim, now_s)
            case Outcome():
                self._hear_outcome(message.writer, body, now_s)
            case Calibration():
                self._hear_calibration(message.writer, body, earlier, now_s)
            case OperatorCommand() if in_force(self._replica).get(body.target) == body:
                fleet = body.kind is CommandKind.ABORT
                uavs = self._fleet() if fleet else [body.target]
                self.tell(EventKind.COMMAND, order_in_words(body), now_s, uavs=uavs)
            case TaskEdit() if self._replica.ordered(body.task) is body:
                self._hear_edit(body, now_s)
            case StartWithout() if body.uav in dispensable(self._replica):
                text = f"operator does not wait for {body.uav} to start{because(body.reason)}"
                self.tell(EventKind.COMMAND, text, now_s, uavs=[body.uav])
            case ZoneEdit() if body in zone_edits(self._replica).values():
                self.tell(EventKind.COMMAND, zone_in_words(body), now_s)
            case UavReady() if body.uav in readiness(self._replica):
                text = f"operator lets {body.uav} start again{because(body.reason)}"
                self.tell(EventKind.COMMAND, text, now_s, uavs=[body.uav])
            case _:
                pass

    def _hear_calibration(
        self, uav: str, told: Calibration, earlier: Message | None, now_s: float
    ) -> None:
        """Tell that a UAV flies otherwise than before, however long it lands or climbs."""
        brief = self._replica.brief
        if brief is None or not is_calibrated(brief):
            return
        briefed = next((each for each in brief.uavs if each.id == uav), None)
        if briefed is None:
            return
        said = None if earlier is None else earlier.body
        known = FlightRates.believed(said if isinstance(said, Calibration) else None, briefed)
        now = FlightRates.believed(told, briefed)
        if replace(now, land_s=known.land_s, climb_s=known.climb_s) == known:
            return
        measured = not (now.as_measured and known.as_measured)
        detail = f", as {counted(told.legs, 'leg')} show" if measured else ""
        text = f"{uav} {rates_in_words(now)}"
        self.tell(EventKind.CALIBRATED, text, now_s, detail=detail, uavs=[uav])

    def _hear_entry(self, entry: TaskEntry, earlier: Message | None, now_s: float) -> None:
        task = entry.task
        if self._replica.board.get(task) is not entry:
            return  # the operator has said otherwise
        if entry.withdrawn:
            self.tell(EventKind.WITHDRAWN, f"task {task} withdrawn", now_s, tasks=[task])
            return
        # A pop-up, or a task that the scenario does not know at all.
        is_news = self._clock.is_set and not self.joining and task not in self._known_at_start
        if is_news or (self._reasons is not None and earlier is None):
            text, detail = f"task {task} {'appeared' if is_news else 'posted'}", ""
            if self._reasons is not None:
                detail = f": {entry_in_words(entry)}"
            self.tell(EventKind.POSTED, text, now_s, detail=detail, tasks=[task])

    def _hear_edit(self, edit: TaskEdit, now_s: float) -> None:
        task, why = edit.task, because(edit.reason)
        if edit.withdrawn:
            self.tell(EventKind.WITHDRAWN, f"operator withdraws {task}{why}", now_s, tasks=[task])
            return
        detail = f"; {entry_in_words(edit)}"
        text = f"operator adds task {task}{why}"
        self.tell(EventKind.POSTED, text, now_s, detail=detail, tasks=[task])

    def _hear_claim(self, uav: str, claim: Claim, before: Claim | None, now_s: float) -> None:
        reasons, task = self._reasons, claim.task
        running = self._phase is MissionPhase.RUNNING
        if claim.phase is ClaimPhase.OUT and running and self._board.unfinished:
            self.tell(EventKind.OUT, f"{uav} takes no further part", now_s, uavs=[uav])
        if (visit := visit_in_words(claim, before)) is not None:
            self.tell(EventKind.BASE, f"{uav} {visit}", now_s, uavs=[uav])
        if reasons is not None:
            reasons.release(uav, claim, before, now_s)
        if task is None or (before is not None and before.task == task):
            if reasons is not None:
                reasons.claim_phase(uav, claim, before, now_s)
            return
        former, lost_s = self._orphans.pop(task, (uav, now_s))
        if former == uav and reasons is None:
            return
        text = f"{uav} claimed {task}" if former == uav else f"{uav} took over {task} from {former}"
        detail = ""
        if reasons is not None:
            detail = reasons.of_claim(claim, None if former == uav else now_s - lost_s)
        self.tell(EventKind.CLAIMED, text, now_s, detail=detail, uavs=[uav], tasks=[task])
        if reasons is not None:
            reasons.contest(uav, claim, now_s)

    def _hear_outcome(self, uav: str, outcome: Outcome, now_s: float) -> None:
        task, done = outcome.task, outcome.result is AttemptResult.DONE
        others = {
            other
            for (other, what), theirs in self._replica.outcomes.items()
            if done and what == task and other != uav and theirs.result is AttemptResult.DONE
        }
        again = f", as {', '.join(sorted(others))} had" if others else ""
        self.tell(
            EventKind.DONE if done else EventKind.FAILED,
            f"{uav} ended {task}: {outcome.result}{again}",
            now_s,
            detail="" if self._reasons is None else self._reasons.of_outcome(uav, outcome),
            uavs=[uav],
            tasks=[task],
            at_s=outcome.completed_s if self.joining else None,
        )

    def status(
        self, uav: str, status: Status, before: Status | None, now_s: float, *, reborn: bool
    ) -> None:
        """Tell why a UAV leaves, and what it says about its vehicle.

        ``before`` is what it said before; ``reborn`` if another life of its agent says so.
        """
        phase, note = status.phase, status.note
        changed = self._reasons is not None and (before is None or before.phase is not phase)
        if self._reasons is not None:
            self._reasons.status(uav, status)
        if reborn:
            self._left.discard(uav)
        if phase in _LEAVING:
            matters = bool(note) and self._board.unfinished
            if (uav not in self._left) if matters else changed:
                kind, how = _LEAVING[phase]
                if matters:
                    self._left.add(uav)
                self.tell(kind, f"{uav} {how}{because(note)}", now_s, uavs=[uav])
        elif phase in _IN_FLIGHT and note and note != self._remarks.get(uav):
            if self._is_routine(note):
                return  # and what was remarked before may go on
            self._remarks[uav] = note
            self.tell(EventKind.REMARK, f"{uav}: {note}", now_s, uavs=[uav])
        elif phase is StatusPhase.HOME and changed:
            self.tell(EventKind.HOME, f"{uav} is home", now_s, uavs=[uav])

    def _is_routine(self, note: str) -> bool:
        """Whether it tells of a visit to a base what a claim has told already."""
        brief = self._replica.brief
        bases = () if brief is None else brief.bases
        return any(f"base {base.id}" in note for base in bases) or (
            bool(bases) and note.startswith(_UP_AGAIN)
        )

    def choice(self, uav: str, choice: Choice, now_s: float) -> None:
        """Tell that a UAV turns aside; where reasons are wanted, of every choice."""
        left, reasons = choice.left, self._reasons
        if left is None and reasons is None:
            return
        went = goal_in_words(choice)
        text = f"{uav} chose {went}" if left is None else f"{uav} turns aside from {left} to {went}"
        tasks = {task for task in (choice.task, left) if task is not None}
        detail = "" if reasons is None else choice_in_words(choice)
        self.tell(EventKind.CHOSEN, text, now_s, detail=detail, uavs=[uav], tasks=tasks)
        if reasons is not None:
            reasons.choice(uav, choice, now_s)

    # -- what follows from it -----------------------------------------------------------

    def epoch(self, epoch: PlanEpoch, now_s: float) -> None:
        """Tell that the mission goes on by other lists."""
        fleet = set(self._fleet())
        notable = epoch.number > 1 or not fleet.issubset(epoch.sequence)
        why = f" ({epoch.reason})" if notable and epoch.reason else ""
        text = f"epoch {epoch.number}: {epoch.rule}, {' > '.join(epoch.sequence)}{why}"
        # With the first one mission time began.
        at_s = 0.0 if self.joining and epoch.number == 1 else None
        self.tell(EventKind.EPOCH, text, now_s, at_s=at_s)

    def left_out(self, epoch: PlanEpoch, now_s: float) -> None:
        """Tell what an epoch leaves out, as far as that is new and not over already."""
        known, self._left_out = self._left_out, epoch.why_left_out
        news = {
            task: why
            for task, why in self._left_out.items()
            if known.get(task) != why
            and self._board.states.get(task, TaskState.OPEN) is TaskState.OPEN
        }
        if not news:
            return
        text = f"epoch {epoch.number} leaves out {left_out_in_words(news, NAMES_TOLD)}"
        meant = {why: why_left_out(why) for why in news.values()}
        detail = "".join(f"; {why}: {words}" for why, words in meant.items() if words != why)
        at_s = 0.0 if self.joining and epoch.number == 1 else None
        self.tell(EventKind.LEFT_OUT, text, now_s, detail=detail, tasks=news, at_s=at_s)

    def end(self, epoch: PlanEpoch, now_s: float) -> None:
        """Tell that the mission is over."""
        self.tell(EventKind.END, f"mission ends: {epoch.reason}", now_s, uavs=self._fleet())

    def lost(self, uav: str, claim: Claim, now_s: float, *, silent: bool) -> None:
        """Tell that a UAV that took part is gone, and what that opens."""
        text = f"{uav} lost{_SILENT if silent else ''}"
        opens = self._board.states.get(claim.task or "") is TaskState.OPEN
        tasks = [] if claim.task is None or not opens else [claim.task]
        for task in tasks:
            self._orphans[task] = uav, now_s
            text += f"; task {task} is open again"
        self.tell(EventKind.LOST, text, now_s, uavs=[uav], tasks=tasks)

    def back(self, uav: str, now_s: float) -> None:
        """Tell that a UAV that was lost is there again."""
        self.tell(EventKind.BACK, f"{uav} is back", now_s, uavs=[uav])

    def coordinator_lost(self, now_s: float, *, silent: bool) -> None:
        """Tell that it is gone, as long as the mission needs one."""
        text = f"coordinator lost{_SILENT if silent else ''}"
        if self._phase is MissionPhase.RUNNING:
            self.tell(EventKind.LOST, f"{text}; the fleet goes on with the last epoch", now_s)
        elif self._phase is MissionPhase.PREPARING:
            self.tell(EventKind.LOST, f"{text} before the mission began", now_s)

    def coordinator_back(self, now_s: float, *, another: bool) -> None:
        """Tell that it is there again, or that another one has taken its place."""
        text = "a new coordinator has taken charge" if another else "coordinator is back"
        self.tell(EventKind.COORDINATOR, text, now_s)

    def keys_replaced(self, names: Collection[str], now_s: float) -> None:
        """Tell who is believed under other keys from now on."""
        text = f"keys revoked or replaced: {listed(sorted(names), NAMES_TOLD)}"
        self.tell(EventKind.NOTE, text, now_s)

    @property
    def _phase(self) -> MissionPhase:
        epoch = self._replica.epoch
        return MissionPhase.PREPARING if epoch is None else epoch.phase

    def _fleet(self) -> list[str]:
        brief = self._replica.brief
        return [] if brief is None else [uav.id for uav in brief.uavs]


_SILENT = ", silent though its link is up"
