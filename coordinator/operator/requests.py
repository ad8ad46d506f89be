"""An operator's requests, any number at once, each followed until it is known what came of it.

For whoever observes already: a `RequestTracker` is given the `MissionState` of a mission, which
somebody else feeds, says what the operator wants under the operator's name, repeats it, and
judges from that state what comes of it. One command line's `OperatorClient` has one request, a
dashboard many.

    tracker = RequestTracker(mission_state, incarnation=…, timing=…, patience_s=10.0)
    request = tracker.give(NewTask((10.0, 20.0, 0.0), value=3.0), now_s)
    actions = tracker.step(event, now_s)  # after `mission_state.step`, for every event
    request.verdict                       # None while it is open

`step` gives what is to be published and asked, so step once (with a `Tick`) after `give`, and
whenever `next_deadline_s` comes. The process behind it joins without a token, and its shell has the
name `OPERATOR`: then answers to its questions always tell what is known of the operator's own
registers, which is how a task edit is confirmed. It should have asked once before it gives
anything, lest it speaks below what other operators have said.
"""

from __future__ import annotations

import math
from dataclasses import replace

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver
from coordinator.mission_view.uav_state import ABSENT
from coordinator.operator.commands import (
    CommandHandler,
    CommandRequest,
    RequestResult,
    RequestVerdict,
    StartHandler,
    StartRequest,
)
from coordinator.operator.readiness import ReadyHandler, ReadyRequest
from coordinator.operator.task_edits import NewTask, TaskEditHandler, TaskWithdrawal
from coordinator.operator.zone_edits import NewZone, ZoneEditHandler, ZoneRemoval
from swarm.model.ids import OPERATOR
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    Finish,
    LinkChanged,
    Publish,
    SnapshotsReceived,
)
from swarm.protocol.field_messages import UavReady, ZoneEdit
from swarm.protocol.messages import Message, OperatorCommand, StartWithout, TaskEdit
from swarm.protocol.register_writer import RegisterWriter
from swarm.protocol.timing import Timing, earliest

OperatorRequest = (
    CommandRequest | StartRequest | NewTask | TaskWithdrawal | NewZone | ZoneRemoval | ReadyRequest
)
OperatorStatement = OperatorCommand | StartWithout | TaskEdit | ZoneEdit | UavReady


AnyHandler = CommandHandler | StartHandler | TaskEditHandler | ZoneEditHandler | ReadyHandler


class TrackedRequest:
    """One wish under way."""

    def __init__(self, wish: OperatorRequest, handler: AnyHandler) -> None:
        self.wish = wish
        self.handler = handler
        """Tells more than the verdict: whom a command concerns, who knows of a task order."""
        self.said: Message | None = None
        """What was said; None when it could not be."""
        self.verdict: RequestVerdict | None = None
        """What has come of it; None as long as that is open."""
        self.leave_at_s = math.inf
        self.again_at_s = math.inf
        self.ask_at_s = math.inf

    @property
    def obeyed(self) -> bool:
        """Whether it was seen to take effect."""
        return self.verdict is not None and self.verdict.result is RequestResult.OBEYED

    @property
    def task(self) -> str | None:
        """Id of the task that it is about, once there is one."""
        return self.handler.task


class RequestTracker:
    """All of one operator's wishes in one mission.

    Args:
        mission_state: of the mission; somebody else feeds it.
        timing: timers, in the seconds of ``now_s``.
        patience_s: how long to wait for the effect of each [s of ``now_s``].
    """

    def __init__(
        self, mission_state: MissionState, *, incarnation: int, timing: Timing, patience_s: float
    ) -> None:
        self.open: list[TrackedRequest] = []
        """Those of which it is not known what came, oldest first."""
        self._mission_state = mission_state
        self._register_writer = RegisterWriter(mission_state.mission.name, OPERATOR, incarnation)
        self._timing = timing
        self._patience_s = patience_s
        self._shown_at_s: float | None = None
        """By then everyone who is there has shown its token since the own link came up."""
        self._all_shown = False

    def give(self, wish: OperatorRequest, now_s: float) -> TrackedRequest:
        """Say what the operator wants, from the next step on; with a verdict if it cannot."""
        brief = self._mission_state.replica.brief
        handler = self._handler_of(wish, now_s)
        request = TrackedRequest(wish, handler)
        unknown = RequestVerdict(RequestResult.UNKNOWN_MISSION, "nothing is known of the mission")
        body = unknown if brief is None else handler.body(brief)
        if isinstance(body, RequestVerdict):
            request.verdict = body
            return request
        self._say(request, body, now_s)
        request.leave_at_s = now_s + self._patience_s
        if handler.asks:
            request.ask_at_s = now_s + self._timing.ask_gap_s
        self.open.append(request)
        return request

    def _handler_of(self, wish: OperatorRequest, now_s: float) -> AnyHandler:
        mission_state, patience_s = self._mission_state, self._patience_s
        match wish:
            case CommandRequest():
                return CommandHandler(wish, mission_state, patience_s)
            case StartRequest():
                return StartHandler(wish, mission_state, patience_s)
            case ReadyRequest():
                return ReadyHandler(wish, mission_state, patience_s)
            case NewZone() | ZoneRemoval():
                return ZoneEditHandler(wish, mission_state, patience_s)
            case NewTask() | TaskWithdrawal():
                given_s = mission_state.mission_s(now_s)
                return TaskEditHandler(wish, mission_state, self._timing, patience_s, given_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Follow what has been given; call it after the observer has taken note of ``fact``."""
        wishes: list[CommonAction] = []
        asks = False
        if self._shown_at_s is None or (isinstance(fact, LinkChanged) and fact.up):
            self._shown_at_s = now_s + self._timing.relink_grace_s
        self._all_shown = self._shown_at_s <= now_s
        for request in self.open:
            request.handler.all_shown = self._all_shown
            said = self._said_for_this_run(request, now_s)
            if said is None:
                continue
            if (body := request.handler.apart(said)) is not None:
                said = self._say(request, body, now_s)
            request.handler.heed(fact, said)
            if request.again_at_s <= now_s:
                request.again_at_s = now_s + self._timing.announce_s
                wishes.append(Publish(said))
            if request.ask_at_s <= now_s:
                request.ask_at_s = now_s + self._timing.ask_s
                asks = True
            late = request.leave_at_s <= now_s
            request.verdict = request.handler.judge(said, now_s, late=late)
        self.open = [request for request in self.open if request.verdict is None]
        return [*wishes, Ask()] if asks else wishes

    def _say(self, request: TrackedRequest, body: OperatorStatement, now_s: float) -> Message:
        """State ``body`` above all that is known of any operator."""
        for message in self._mission_state.replica.messages({OPERATOR}):
            self._register_writer.observe(message.stamp)
        said = self._register_writer.say(body)
        self._mission_state.take_note(said, now_s)
        request.said, request.again_at_s = said, now_s
        return said

    def _said_for_this_run(self, request: TrackedRequest, now_s: float) -> Message | None:
        """What was said; anew, if the brief turns out to be of another run than it was told of."""
        said, brief = request.said, self._mission_state.replica.brief
        if said is None or brief is None or not isinstance(said.body, OperatorStatement):
            return said
        if said.body.run == brief.run:
            return said
        return self._say(request, replace(said.body, run=brief.run), now_s)

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None while nothing is open."""
        deadlines = [
            min(request.leave_at_s, request.again_at_s, request.ask_at_s) for request in self.open
        ]
        if self.open and self._shown_at_s is not None and not self._all_shown:
            deadlines.append(self._shown_at_s)
        looks = (request.handler.next_deadline_s() for request in self.open)
        return min([*deadlines, *(at_s for at_s in looks if at_s is not None)], default=None)


class OperatorClient:
    """A core that has one request, and ends when it knows what came of it.

    Args:
        patience_s: how long to wait for the mission, and then for the effect [s of ``now_s``].
    """

    def __init__(
        self,
        mission: str,
        wish: OperatorRequest,
        *,
        incarnation: int,
        timing: Timing,
        patience_s: float,
    ) -> None:
        self.tracked_request: TrackedRequest | None = None
        """What it was told to do; None as long as it knows too little to begin."""
        self._observer = MissionObserver(mission, timing, None)
        self._wish = wish
        self._request_tracker = RequestTracker(
            self._observer.mission_state,
            incarnation=incarnation,
            timing=timing,
            patience_s=patience_s,
        )
        self._ask_s = timing.ask_s
        self._patience_s = patience_s
        self._leave_at_s = math.inf
        self._ask_at_s = math.inf
        self._gave_up: RequestVerdict | None = None

    @property
    def verdict(self) -> RequestVerdict | None:
        """What has come of it; None as long as that is open."""
        return self._gave_up if self.tracked_request is None else self.tracked_request.verdict

    def start(self, now_s: float) -> list[CommonAction]:
        """Ask what there is to know."""
        self._leave_at_s, self._ask_at_s = now_s + self._patience_s, now_s + self._ask_s
        return self._observer.start(now_s)

    def step(self, fact: CommonEvent, now_s: float) -> list[CommonAction]:
        """Take note of one fact."""
        if self.verdict is not None:
            return []
        wishes = self._observer.step(fact, now_s)
        if self.tracked_request is None:
            self._begin(fact, now_s)
        wishes += self._request_tracker.step(fact, now_s)
        if self.tracked_request is None and self._ask_at_s <= now_s:
            self._ask_at_s = now_s + self._ask_s
            wishes.append(Ask())
        if self.tracked_request is None and self._leave_at_s <= now_s:
            self._gave_up = RequestVerdict(RequestResult.UNKNOWN_MISSION, self._observer.lack)
        if self.verdict is not None:
            wishes.append(Finish(0 if self.obeyed else 1))
        return wishes

    def next_deadline_s(self) -> float | None:
        """When `step` wants a tick; None when it has finished."""
        if self.verdict is not None:
            return None
        own_s = min(self._leave_at_s, self._ask_at_s) if self.tracked_request is None else None
        looks_s = self._observer.next_deadline_s()
        return earliest(own_s, looks_s, self._request_tracker.next_deadline_s())

    @property
    def obeyed(self) -> bool:
        """Whether it was seen to take effect."""
        return self.verdict is not None and self.verdict.result is RequestResult.OBEYED

    @property
    def as_json(self) -> dict[str, object]:
        """What a program is told of the request and what came of it, but for the mission."""
        handler = None if self.tracked_request is None else self.tracked_request.handler
        match wish := self._wish:
            case CommandRequest():
                about: dict[str, object] = {"command": wish.kind.value, "target": wish.target}
            case StartRequest():
                about = {"command": "start", "without": wish.target}
            case ReadyRequest():
                about = {"command": "ready", "target": wish.target}
            case NewZone() | ZoneRemoval():
                done = "add" if isinstance(wish, NewZone) else "remove"
                about = {"command": f"zone {done}", "zone": wish.zone}
            case _:
                about = {"command": f"task {'add' if isinstance(wish, NewTask) else 'withdraw'}"}
        about |= {} if handler is None else handler.told
        text = "" if self.verdict is None else self.verdict.text
        about |= {"reason": wish.reason, "obeyed": self.obeyed, "text": text}
        return about | {"uavs": self._does} if isinstance(wish, CommandRequest) else about

    @property
    def _does(self) -> dict[str, str]:
        """What each UAV does that a command concerns: `StatusPhase`, or absent."""
        handler = None if self.tracked_request is None else self.tracked_request.handler
        mission_state = self._observer.mission_state
        statuses, present = mission_state.statuses, mission_state.present
        return {
            uav: statuses[uav].phase.value if uav in present and uav in statuses else ABSENT
            for uav in (handler.concerned if isinstance(handler, CommandHandler) else ())
        }

    def _begin(self, fact: CommonEvent, now_s: float) -> None:
        """Once somebody has answered who knows the mission, the operator's other words too."""
        answered = isinstance(fact, SnapshotsReceived) and bool(fact.snapshots)
        if answered and self._observer.known:
            self.tracked_request = self._request_tracker.give(self._wish, now_s)
