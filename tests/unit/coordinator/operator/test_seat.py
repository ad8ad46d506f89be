"""One command from an operator's seat: how it is stamped, repeated and seen to take effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from coordinator.operator.commands import CommandRequest, RequestResult
from coordinator.operator.requests import OperatorClient
from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.events import (
    Ask,
    CommonAction,
    CommonEvent,
    Finish,
    MessageReceived,
    PeerGone,
    PeerSeen,
    Publish,
    SnapshotsReceived,
    Tick,
)
from swarm.protocol.messages import Body, CommandKind, Message, OperatorCommand, Snapshot, Stamp
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import IDLE, MISSION, OUT, brief, message, status, uav

HOLD, RESUME, RETURN, ABORT = CommandKind
BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1")))
PATIENCE_S = 10.0
TIMING = Timing(silence_s=100.0)
"""Nobody is given up for silence alone."""


class Seat:
    """An operator's seat beside ``u0`` and ``u1``, whom the test plays."""

    def __init__(self, kind: CommandKind, target: str = "u0") -> None:
        self.core = OperatorClient(
            MISSION,
            CommandRequest(kind, target, "because"),
            incarnation=50,
            timing=TIMING,
            patience_s=PATIENCE_S,
        )
        self.now_s = 0.0
        self.wishes: list[CommonAction] = []
        self._counter = 0
        self._do(self.core.start(0.0))
        for writer in ("u0", "u1"):
            self.happen(PeerSeen(writer))
            self.does(writer, StatusPhase.FLYING)

    def learn(self, *messages: Message) -> None:
        self.happen(SnapshotsReceived((Snapshot(MISSION, "u1", 1, None, (BRIEF, *messages)),)))

    def does(self, writer: str, phase: StatusPhase) -> None:
        self.hear(writer, status(phase))

    def hear(self, writer: str, body: Body) -> None:
        self._counter += 1
        self.happen(MessageReceived(message(writer, body, self._counter)))

    def happen(self, fact: CommonEvent, at_s: float | None = None) -> None:
        self.now_s = self.now_s if at_s is None else at_s
        self._do(self.core.step(fact, self.now_s))

    def wait(self, until_s: float) -> None:
        while (due_s := self.core.next_deadline_s()) is not None and due_s <= until_s:
            self.happen(Tick(), max(due_s, self.now_s))

    @property
    def said(self) -> list[Message]:
        return [wish.message for wish in self.wishes if isinstance(wish, Publish)]

    @property
    def result(self) -> RequestResult | None:
        return None if self.core.verdict is None else self.core.verdict.result

    @property
    def text(self) -> str:
        return "" if self.core.verdict is None else self.core.verdict.text

    def _do(self, wishes: Sequence[CommonAction]) -> None:
        self.wishes += wishes


def test_it_learns_before_it_speaks_and_names_the_flight() -> None:
    seat = Seat(HOLD)
    assert seat.said == []

    seat.learn()

    assert seat.said == [
        Message(MISSION, OPERATOR, Stamp(50, 1), OperatorCommand("u0", HOLD, 1, "because"))
    ]


def test_a_mission_that_is_only_overheard_is_asked_about() -> None:
    seat = Seat(HOLD)
    seat.happen(SnapshotsReceived(()))
    seat.happen(MessageReceived(BRIEF))
    seat.wishes.clear()
    seat.wait(TIMING.ask_s)

    assert Ask() in seat.wishes
    assert seat.said == []


def test_it_speaks_above_every_command_that_is_known() -> None:
    seat = Seat(RESUME)
    seat.learn(Message(MISSION, OPERATOR, Stamp(7_000, 3), OperatorCommand(FLEET, ABORT, 1, "")))

    assert seat.said[0].stamp > Stamp(7_000, 3)


def test_it_repeats_itself_until_it_is_obeyed_and_then_ends() -> None:
    seat = Seat(HOLD)
    seat.learn()
    seat.wait(2.5 * TIMING.announce_s)
    assert len(seat.said) == 3
    assert len(set(seat.said)) == 1

    seat.does("u0", StatusPhase.HOLDING)

    assert seat.result is RequestResult.OBEYED
    assert Finish(0) in seat.wishes
    assert seat.core.next_deadline_s() is None


def test_a_hold_is_obeyed_once_the_vehicle_stands() -> None:
    seat = Seat(HOLD)
    seat.learn()
    seat.hear("u0", replace(status(StatusPhase.HOLDING), note="being stopped, held"))
    assert seat.result is None
    seat.hear("u0", replace(status(StatusPhase.HOLDING), note="held"))
    assert seat.result is RequestResult.OBEYED


def test_a_vehicle_that_cannot_be_stopped_does_not_obey() -> None:
    seat = Seat(HOLD)
    seat.learn()
    seat.hear("u0", replace(status(StatusPhase.HOLDING), note="cannot hold: it goes on"))
    assert seat.result is RequestResult.NOT_OBEYED
    assert Finish(1) in seat.wishes


def test_what_a_uav_said_before_the_command_proves_nothing() -> None:
    seat = Seat(RESUME)
    seat.learn()
    assert seat.result is None

    seat.does("u0", StatusPhase.HOLDING)
    assert seat.result is None
    seat.does("u0", StatusPhase.PREPARING)
    assert seat.result is RequestResult.OBEYED


@pytest.mark.parametrize("kind", [HOLD, RESUME, RETURN])
def test_a_vehicle_that_is_not_commanded_is_told(kind: CommandKind) -> None:
    seat = Seat(kind)
    seat.learn()
    seat.does("u0", StatusPhase.OUT)

    assert seat.result is RequestResult.NOT_OBEYED
    assert seat.text.startswith("u0 takes no part, and its vehicle is not commanded")


def test_who_is_on_its_way_home_does_not_go_on() -> None:
    seat = Seat(RESUME)
    seat.learn()
    seat.does("u0", StatusPhase.RETURNING)

    assert (seat.result, Finish(1) in seat.wishes) == (RequestResult.NOT_OBEYED, True)


def test_who_was_stopped_on_its_way_home_goes_on_home() -> None:
    seat = Seat(RESUME)
    seat.does("u0", StatusPhase.HOLDING)
    seat.learn()
    seat.does("u0", StatusPhase.RETURNING)

    assert seat.result is RequestResult.OBEYED


@pytest.mark.parametrize(
    ("gone", "text"),
    [
        (
            True,
            "nobody flies u0, or it is cut off; back again, it learns of it from those who know",
        ),
        (False, "u0 has not been heard of within 10 s"),
    ],
)
def test_when_nothing_comes_of_it_it_says_why(*, gone: bool, text: str) -> None:
    seat = Seat(HOLD)
    seat.learn()
    if gone:
        seat.happen(PeerGone("u0"))
    seat.wait(PATIENCE_S)

    assert seat.result is RequestResult.NOT_OBEYED
    assert seat.text.startswith(text)


def test_who_goes_on_all_the_same_is_told() -> None:
    seat = Seat(HOLD)
    seat.learn()
    seat.does("u0", StatusPhase.FLYING)
    seat.wait(PATIENCE_S)

    assert seat.text == "u0 is flying still, hold was not obeyed within 10 s"


def test_another_operators_later_word_ends_it() -> None:
    seat = Seat(HOLD)
    seat.learn()
    other = Message(MISSION, OPERATOR, Stamp(60, 1), OperatorCommand("u0", RESUME, 1, ""))
    seat.happen(MessageReceived(other))

    assert (seat.result, seat.text) == (
        RequestResult.NOT_OBEYED,
        "another operator has said resume meanwhile",
    )


def test_a_uav_that_is_not_in_the_fleet_is_not_commanded() -> None:
    seat = Seat(HOLD, "u9")
    seat.learn()

    assert (seat.said, seat.result) == ([], RequestResult.UNKNOWN_UAV)
    assert seat.text == "the fleet is u0, u1"


def test_a_mission_nobody_knows_is_told() -> None:
    seat = Seat(HOLD)
    seat.wait(PATIENCE_S)

    assert seat.result is RequestResult.UNKNOWN_MISSION
    assert seat.text == "nothing is known of mission test: u0, u1 cannot tell it yet"


def test_an_abort_is_obeyed_when_everyone_there_goes_home() -> None:
    seat = Seat(ABORT, FLEET)
    seat.learn()
    seat.does("u0", StatusPhase.RETURNING)
    assert seat.result is None

    seat.hear("u1", OUT)
    seat.happen(PeerGone("u1"))
    seat.happen(Tick(), seat.now_s + TIMING.loss_delay_s)
    assert seat.result is RequestResult.OBEYED


def test_what_is_the_same_for_several_uavs_is_told_once() -> None:
    seat = Seat(ABORT, FLEET)
    seat.learn()
    seat.does("u0", StatusPhase.RETURNING)
    seat.does("u1", StatusPhase.RETURNING)

    assert seat.text.startswith("u0, u1: each is returning")


def test_an_abort_that_a_lost_uav_has_not_heard_is_told() -> None:
    seat = Seat(ABORT, FLEET)
    seat.hear("u1", IDLE)
    seat.learn()
    seat.does("u0", StatusPhase.RETURNING)
    seat.happen(PeerGone("u1"))
    seat.wait(PATIENCE_S)

    assert seat.result is RequestResult.NOT_OBEYED
    assert seat.text.startswith("nobody flies u1")
