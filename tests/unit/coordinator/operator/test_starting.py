"""The operator lets a mission start without a UAV: what is said, and what is told of it."""

from __future__ import annotations

import pytest

from coordinator.operator.commands import RequestResult, StartRequest
from coordinator.operator.requests import OperatorClient
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import (
    CommonAction,
    MessageReceived,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, Message, MissionPhase, Snapshot, StartWithout
from swarm.protocol.timing import Timing
from tests.support.builders import IDLE, MISSION, brief, epoch, message, uav

BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1"), uav("u2")))
PATIENCE_S = 10.0
SAID = StartWithout("u2", 1, "no GPS")


class Seat:
    """An operator's seat beside a fleet that gets ready."""

    def __init__(self, target: str = "u2", *, coordinator: bool = True, known: Body | None = None):
        self.core = OperatorClient(
            MISSION,
            StartRequest(target, "no GPS"),
            incarnation=50,
            timing=Timing(silence_s=100.0),
            patience_s=PATIENCE_S,
        )
        self.now_s = 0.0
        self.wishes: list[CommonAction] = list(self.core.start(0.0))
        self._counter = 1
        for writer in [*["coordinator"] * coordinator, "u0", "u1"]:
            self.wishes += self.core.step(PeerSeen(writer), 0.0)
        before = [] if known is None else [message(COORDINATOR, known, 2)]
        self.learn("u0", BRIEF, *before)

    def learn(self, writer: str, *messages: Message) -> None:
        fact = SnapshotsReceived((Snapshot(MISSION, writer, 1, None, messages),))
        self.wishes += self.core.step(fact, self.now_s)

    def hear(self, writer: str, body: Body) -> None:
        self._counter += 1
        self.wishes += self.core.step(
            MessageReceived(message(writer, body, self._counter)), self.now_s
        )

    def confirm(self) -> None:
        self.learn(COORDINATOR, BRIEF, self.said[-1])

    def wait(self) -> None:
        while (due_s := self.core.next_deadline_s()) is not None and due_s <= 2.0 * PATIENCE_S:
            self.now_s = max(due_s, self.now_s)
            self.wishes += self.core.step(Tick(), self.now_s)

    @property
    def said(self) -> list[Message]:
        return [wish.message for wish in self.wishes if isinstance(wish, Publish)]

    @property
    def told(self) -> tuple[RequestResult, str] | None:
        verdict = self.core.verdict
        return None if verdict is None else (verdict.result, verdict.text)


def test_it_is_done_when_the_mission_has_started_without_it() -> None:
    seat = Seat()
    for ready in ("u0", "u1"):
        seat.hear(ready, IDLE)
    seat.confirm()
    assert [each.body for each in seat.said] == [SAID]
    assert seat.said[0].key.endswith("operator/start/u2")
    assert seat.told is None

    seat.hear(COORDINATOR, epoch("u0", "u1"))
    assert seat.told == (RequestResult.OBEYED, "the mission has started without u2")


def test_a_uav_that_got_ready_meanwhile_takes_part() -> None:
    seat = Seat()
    seat.hear(COORDINATOR, epoch("u0", "u1", "u2"))

    assert seat.told == (RequestResult.OBEYED, "the mission has started with u2")


def test_what_else_the_start_waits_for_is_told() -> None:
    seat = Seat()
    seat.hear("u0", IDLE)
    seat.confirm()

    assert seat.told == (RequestResult.OBEYED, "without u2; the mission waits for u1")


def test_a_plan_that_takes_long_is_told_in_the_end() -> None:
    seat = Seat()
    for ready in ("u0", "u1"):
        seat.hear(ready, IDLE)
    seat.confirm()
    seat.wait()

    assert seat.told == (
        RequestResult.OBEYED,
        "without u2; the mission starts as soon as it is planned",
    )


def test_nobody_confirms_it() -> None:
    deaf, alone = Seat(), Seat(coordinator=False)
    deaf.wait()
    alone.wait()

    text = "the coordinator has not confirmed it within 10 s"
    assert deaf.told == (RequestResult.NOT_OBEYED, text)
    text = "there is no coordinator that could start the mission"
    assert alone.told == (RequestResult.NOT_OBEYED, text)


@pytest.mark.parametrize(
    ("phase", "text"),
    [
        (MissionPhase.RUNNING, "the mission has started already: nobody waits for u2"),
        (MissionPhase.ENDED, "the mission has ended: nobody waits for u2"),
    ],
)
def test_after_the_start_it_is_too_late(phase: MissionPhase, text: str) -> None:
    seat = Seat(known=epoch("u0", "u1", phase=phase))

    assert (seat.told, seat.said) == ((RequestResult.NOT_OBEYED, text), [])


def test_a_uav_that_is_not_in_the_fleet_is_wrong_input() -> None:
    assert Seat("u9").told == (RequestResult.UNKNOWN_UAV, "the fleet is u0, u1, u2")
