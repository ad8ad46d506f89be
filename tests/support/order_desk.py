"""An operator's requests beside two UAVs of which everything is told by the test."""

from __future__ import annotations

from collections.abc import Sequence

from coordinator.mission_view.mission_state import MissionState
from coordinator.operator.commands import RequestResult
from coordinator.operator.requests import OperatorRequest, RequestTracker, TrackedRequest
from swarm.model import Mission
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    CommonAction,
    CommonEvent,
    MessageReceived,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, Message, Snapshot
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, MISSION, brief, entry, epoch, message, mission, uav

PATIENCE_S = 10.0
TIMING = Timing(silence_s=100.0)
FLEET = [uav("u0", lift=0.0), uav("u1", lift=0.0)]


class Desk:
    """An operator's requests beside ``u0`` and ``u1``, whom the test plays.

    Args:
        flown: the mission, if it is not that of `FLEET`.
        seen: whose tokens have been seen.
        looked_for_s: how long the operator has been there at 0 s.
    """

    def __init__(
        self,
        flown: Mission | None = None,
        *,
        seen: Sequence[str] = ("u0", "u1"),
        looked_for_s: float = TIMING.relink_grace_s,
    ) -> None:
        self.mission_state = MissionState(flown or mission(FLEET, []), TIMING)
        self.errands = RequestTracker(
            self.mission_state, incarnation=50, timing=TIMING, patience_s=PATIENCE_S
        )
        self.now_s = -looked_for_s
        self.wishes: list[CommonAction] = []
        self._counter = 0
        self.hear(COORDINATOR, brief(*FLEET))
        self.hear(COORDINATOR, entry("t0", value=2.0), entry("t1", number=4, value=6.0))
        self.hear(COORDINATOR, epoch("u0", "u1"))
        for writer in ("u0", "u1"):
            if writer in seen:
                self.happen(PeerSeen(writer))
            self.hear(writer, IDLE)
        self.now_s = 0.0
        self.wishes.clear()

    def hear(self, writer: str, *bodies: Body) -> None:
        for body in bodies:
            self._counter += 1
            self.happen(MessageReceived(message(writer, body, self._counter)))

    def give(self, wish: OperatorRequest) -> TrackedRequest:
        tracked_request = self.errands.give(wish, self.now_s)
        self.happen(Tick())
        return tracked_request

    def confirm(self, tracked_request: TrackedRequest, *writers: str) -> None:
        assert tracked_request.said is not None
        answers = [Snapshot(MISSION, w, 1, None, (tracked_request.said,)) for w in writers]
        self.happen(SnapshotsReceived(tuple(answers)))

    def happen(self, fact: CommonEvent, at_s: float | None = None) -> None:
        self.now_s = self.now_s if at_s is None else at_s
        self.mission_state.step(fact, self.now_s)
        self.wishes += self.errands.step(fact, self.now_s)

    def wait(self, until_s: float) -> None:
        while (due_s := self.errands.next_deadline_s()) is not None and due_s <= until_s:
            assert due_s >= self.now_s
            self.happen(Tick(), due_s)

    @property
    def said(self) -> list[Message]:
        return [wish.message for wish in self.wishes if isinstance(wish, Publish)]


def came(tracked_request: TrackedRequest) -> tuple[RequestResult, str]:
    assert tracked_request.verdict is not None
    return tracked_request.verdict.result, tracked_request.verdict.text
