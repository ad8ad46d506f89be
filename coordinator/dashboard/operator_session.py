"""The core behind a dashboard: it observes a mission, and says what the operator requests.

It outlives the coordinator, all agents, and the flight: when a mission of the same name is flown
anew, it begins anew with it.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

from coordinator.dashboard.source import CommandRow, CommandState, Refusal, RefusedError
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver, deserted
from coordinator.operator.commands import RequestResult
from coordinator.operator.requests import OperatorRequest, RequestTracker, TrackedRequest
from swarm.model.ids import OPERATOR
from swarm.protocol.events import (
    CommonAction,
    CommonEvent,
    Finish,
    LinkChanged,
    LogLine,
    MessageReceived,
    PeerGone,
    PeerSeen,
    SnapshotsReceived,
)
from swarm.protocol.messages import Message, MissionConfig
from swarm.protocol.timing import Timing, earliest

KEPT_ROWS = 1000


@dataclass(slots=True)
class _Given:
    """An order under way."""

    tracked_request: TrackedRequest
    row: CommandRow
    who: str


class OperatorSession:
    """A core that looks on and gives orders.

    Args:
        incarnation: wall time in milliseconds.
        patience_s: how long to wait for the effect of an order [s of ``now_s``].
        stays: look on for ever; else until the mission is over and everyone has left.
        complete: see `MissionObserver`.
    """

    def __init__(
        self,
        mission: str,
        timing: Timing,
        *,
        incarnation: int,
        patience_s: float,
        stays: bool = True,
        first: int = 1,
        complete: bool = False,
    ) -> None:
        self.rows: deque[CommandRow] = deque(maxlen=KEPT_ROWS)
        """What was ordered, oldest first."""
        self._mission = mission
        self._timing = timing
        self._incarnation = incarnation
        self._patience_s = patience_s
        self._stays = stays
        self._complete = complete
        self._next = first
        self._tokens: set[str] = set()
        self._given: list[_Given] = []
        self._notes: list[CommonAction] = []
        self._deserted_at_s: float | None = None
        self._finished = False
        self._observer, self._request_tracker = self._begin()

    @property
    def mission_state(self) -> MissionState:
        """What is known of the flight that is on."""
        return self._observer.mission_state

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what there is to know."""
        return self._observer.start(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        if self._finished:
            return []
        match fact:
            case PeerSeen(writer):
                self._tokens.add(writer)
            case PeerGone(writer):
                self._tokens.discard(writer)
        wishes = self._begin_anew(now_s) if self._is_flown_anew(fact) else []
        wishes += self._observer.step(fact, now_s)
        wishes += self._request_tracker.step(fact, now_s)
        self._follow()
        wishes += self._notes
        self._notes = []
        if self._is_over(now_s):
            self._finished = True
            wishes.append(Finish(0))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self._finished:
            return None
        return earliest(
            self._observer.next_deadline_s(),
            self._request_tracker.next_deadline_s(),
            self._deserted_at_s,
        )

    def give(self, wish: OperatorRequest, who: str, now_s: float) -> int:
        """Give an order, which goes out with the next step; its number. ``who`` is for the log.

        Raises:
            RefusedError: it could not be said.
        """
        tracked_request = self._request_tracker.give(wish, now_s)
        what, verdict = str(wish), tracked_request.verdict
        if verdict is not None:
            self._notes.append(
                LogLine("order refused", {"what": what, "who": who, "why": verdict.text})
            )
            wrong = verdict.result.is_wrong_input
            text = f"{verdict.result.value}: {verdict.text}" if wrong else verdict.text
            early = verdict.result is RequestResult.UNKNOWN_MISSION
            raise RefusedError(Refusal.TOO_EARLY if early else Refusal.WRONG, text)
        if tracked_request.task is not None and tracked_request.task not in what:
            what = f"{what}: {tracked_request.task}"
        row = CommandRow(self._next, what, CommandState.PENDING, "", tracked_request.task)
        self._next += 1
        self.rows.append(row)
        self._given.append(_Given(tracked_request, row, who))
        said = {"n": row.n, "what": what, "who": who}
        why = {"reason": wish.reason} if wish.reason else {}
        self._notes.append(LogLine("order given", said | why))
        return row.n

    # -- what comes of the orders -----------------------------------------------------

    def _follow(self) -> None:
        for given in self._given:
            verdict = given.tracked_request.verdict
            if verdict is not None:
                obeyed = given.tracked_request.obeyed
                self._close(given, verdict.text, CommandState.OBEYED if obeyed else _FAILED)
        self._given = [given for given in self._given if given.row.state is CommandState.PENDING]

    def _close(self, given: _Given, text: str, state: CommandState) -> None:
        task = given.tracked_request.task
        before, given.row = given.row, replace(given.row, state=state, result=text, task=task)
        if before in self.rows:
            self.rows[self.rows.index(before)] = given.row
        said = {"n": before.n, "what": before.text, "who": given.who, "result": text}
        self._notes.append(LogLine(f"order {state.value}", said))

    # -- flights ----------------------------------------------------------------------

    def _begin(self) -> tuple[MissionObserver, RequestTracker]:
        observer = MissionObserver(self._mission, self._timing, None, complete=self._complete)
        errands = RequestTracker(
            observer.mission_state,
            incarnation=self._incarnation,
            timing=self._timing,
            patience_s=self._patience_s,
        )
        return observer, errands

    def _is_flown_anew(self, fact: CommonEvent) -> bool:
        """Whether ``fact`` tells of a later flight than the one that is known."""
        known = self.mission_state.replica.brief
        if known is None:
            return False
        match fact:
            case MessageReceived(message):
                return self._is_later(message, known)
            case SnapshotsReceived(snapshots):
                told = (message for snapshot in snapshots for message in snapshot.messages)
                return any(self._is_later(message, known) for message in told)
            case _:
                return False

    def _is_later(self, message: Message, known: MissionConfig) -> bool:
        if not isinstance(message.body, MissionConfig) or message.body.run == known.run:
            return False
        earlier = self.mission_state.replica.known(message)
        return earlier is not None and message.stamp > earlier.stamp

    def _begin_anew(self, now_s: float) -> list[CommonAction]:
        """Know only who is there, and what the operator has said, so as to speak above it."""
        for given in self._given:
            self._close(given, "the mission was begun anew before it took effect", _FAILED)
        self._given = []
        before = self.mission_state
        self._observer, self._request_tracker = self._begin()
        self.mission_state.replica.join_all(before.replica.messages({OPERATOR}))
        wishes = self._observer.start(now_s)
        if before.cut_since_s is not None:
            wishes += self._observer.step(LinkChanged(False), now_s)
        for writer in sorted(self._tokens):
            wishes += self._observer.step(PeerSeen(writer), now_s)
        return wishes

    def _is_over(self, now_s: float) -> bool:
        if self._stays or not deserted(self.mission_state):
            self._deserted_at_s = None
            return False
        if self._deserted_at_s is None:
            self._deserted_at_s = now_s + self._timing.relink_grace_s
        return self._deserted_at_s <= now_s


_FAILED = CommandState.NOT_OBEYED
