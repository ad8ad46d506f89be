"""A session observes for ever, and follows whatever the operator wants."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.dashboard.operator_session import OperatorSession
from coordinator.dashboard.source import CommandState, Refusal, RefusedError
from coordinator.operator.commands import CommandRequest
from coordinator.operator.task_edits import NewTask, TaskWithdrawal
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import Ask, Finish, LinkChanged, LogLine, PeerSeen, SnapshotsReceived
from swarm.protocol.messages import CommandKind, MissionPhase, OperatorCommand, TaskEdit
from swarm.protocol.uav_messages import StatusPhase
from tests.support.builders import IDLE, MISSION, OUT, TIMING, brief, uav
from tests.support.desk_play import DeskPlay

HOLD = CommandRequest(CommandKind.HOLD, "u1", "camera")


def notes(play: DeskPlay) -> list[LogLine]:
    return [wish for wish in play.wishes if isinstance(wish, LogLine)]


def test_before_a_mission_is_known_nothing_can_be_said() -> None:
    play = DeskPlay()

    with pytest.raises(RefusedError, match="nothing is known of the mission") as refused:
        play.give(HOLD, "127.0.0.1")

    assert refused.value.why is Refusal.TOO_EARLY
    assert play.said == []


def test_it_asks_until_somebody_knows_the_mission() -> None:
    play = DeskPlay()
    for _ in range(10):
        play.wait(0.5)
        play.take(SnapshotsReceived(()))  # nobody knows it

    assert sum(isinstance(wish, Ask) for wish in play.wishes) >= 5


def test_a_command_is_said_followed_and_logged() -> None:
    play = DeskPlay()
    play.begin()
    play.status("u1", StatusPhase.IDLE)

    n = play.give(HOLD, "10.0.0.7")
    (pending,) = play.desk.rows
    play.wait(1.0)
    play.status("u1", StatusPhase.HOLDING, note="held by the operator")
    (row,) = play.desk.rows

    assert n == pending.n == 1
    assert (pending.text, pending.state, pending.result) == ("hold u1", CommandState.PENDING, "")
    assert play.said[0].body == OperatorCommand("u1", CommandKind.HOLD, 1, "camera")
    assert (row.state, row.result) == (
        CommandState.OBEYED,
        "u1 is holding: held by the operator",
    )
    assert "operator holds u1: camera" in [line.text for line in play.desk.mission_state.story]
    assert [(note.text, note.fields["who"]) for note in notes(play)] == [
        ("order given", "10.0.0.7"),
        ("order obeyed", "10.0.0.7"),
    ]


def test_what_is_not_obeyed_in_time_is_told() -> None:
    play = DeskPlay()
    play.begin()
    play.status("u1")
    play.give(HOLD, "me")
    for _ in range(6):
        play.wait(2.0)
        play.status("u1", StatusPhase.FLYING)

    (row,) = play.desk.rows

    assert row.state is CommandState.NOT_OBEYED
    assert "hold was not obeyed within 10 s" in row.result
    assert (
        len([m for m in play.said if isinstance(m.body, OperatorCommand)]) >= 5
    )  # repeated meanwhile


def test_many_orders_are_under_way_at_once() -> None:
    play = DeskPlay()
    play.begin()
    for name in ("u1", "u2"):
        play.status(name)
    play.give(HOLD, "me")
    play.give(replace(HOLD, target="u2"), "me")
    play.give(NewTask((5.0, 5.0, 0.0), value=3.0), "me")
    play.give(TaskWithdrawal("t2"), "me")
    play.wait(0.5)
    play.status("u2", StatusPhase.HOLDING)

    assert [(row.n, row.text, row.state.value) for row in play.desk.rows] == [
        (1, "hold u1", "pending"),
        (2, "hold u2", "obeyed"),
        (3, "add a task: op1", "pending"),
        (4, "withdraw task t2", "pending"),
    ]
    orders = {m.body.task for m in play.said if isinstance(m.body, TaskEdit)}
    assert orders == {"op1", "t2"}


@pytest.mark.parametrize(
    ("wish", "text"),
    [
        (CommandRequest(CommandKind.HOLD, "u9"), "no such UAV: the fleet is u1, u2"),
        (TaskWithdrawal("t9"), "no such task: "),
        (NewTask((0.0, 0.0, 0.0), task="t1"), "that id is taken: "),
    ],
)
def test_what_does_not_fit_the_mission_is_refused(
    wish: CommandRequest | TaskWithdrawal | NewTask, text: str
) -> None:
    play = DeskPlay()
    play.begin()

    with pytest.raises(RefusedError, match=text) as refused:
        play.give(wish, "me")

    assert refused.value.why is Refusal.WRONG
    assert list(play.desk.rows) == []
    assert play.said == []


def test_a_mission_flown_anew_is_begun_with_anew() -> None:
    play = DeskPlay()
    play.begin()
    play.end("u1", "t1")
    play.give(HOLD, "me")
    earlier = max(message.stamp for message in play.said)

    play.begin(["t8"], run=2)

    mission_state = play.desk.mission_state
    assert mission_state.replica.brief is not None
    assert mission_state.replica.brief.run == 2
    assert (list(mission_state.board.states), mission_state.replica.outcomes) == (["t8"], {})
    assert mission_state.present == {"u1", "u2", COORDINATOR}
    (row,) = play.desk.rows
    assert (row.state, row.result) == (
        CommandState.NOT_OBEYED,
        "the mission was begun anew before it took effect",
    )
    play.give(HOLD, "me")
    assert max(message.stamp for message in play.said) > earlier
    assert mission_state.replica.commands["u1"][1].run == 2


def test_a_brief_of_an_earlier_flight_changes_nothing() -> None:
    play = DeskPlay()
    play.begin(run=3)
    before = play.desk.mission_state

    play._run = 2  # an old process restates an old flight
    play.say(COORDINATOR, replace(brief(uav("u1")), run=2))

    assert play.desk.mission_state is before


def test_a_coordinator_that_is_started_again_is_seen_to_go_and_come() -> None:
    play = DeskPlay()
    play.begin()
    mission_state = play.desk.mission_state
    play.lose(COORDINATOR)
    gone = COORDINATOR in mission_state.present
    play.take(PeerSeen(COORDINATOR))
    play.epoch(MissionPhase.RUNNING)

    assert not gone
    assert COORDINATOR in mission_state.present
    assert play.desk.mission_state is mission_state


def test_it_stays_when_everybody_has_left() -> None:
    play = DeskPlay()
    play.begin()
    play.epoch(MissionPhase.ENDED)
    for name in ("u1", "u2"):
        play.say(name, OUT)
    for name in ("u1", "u2", COORDINATOR):
        play.lose(name)
    play.wait(60.0)

    assert not [wish for wish in play.wishes if isinstance(wish, Finish)]


def test_one_that_took_the_only_mission_leaves_it_when_that_is_over() -> None:
    play = DeskPlay()
    play.desk = OperatorSession(
        MISSION, TIMING, incarnation=5, patience_s=10.0, stays=False, first=7
    )
    play.begin()
    play.status("u1")
    n = play.give(HOLD, "me")
    play.wait(30.0)
    running = [wish for wish in play.wishes if isinstance(wish, Finish)]
    for name in ("u1", "u2"):
        play.say(name, IDLE)
    play.epoch(MissionPhase.ENDED)
    for name in ("u1", "u2", COORDINATOR):
        play.lose(name)
    play.wait(10.0)

    assert n == 7
    assert running == []
    assert [wish for wish in play.wishes if isinstance(wish, Finish)] == [Finish(0)]


def test_a_cut_link_survives_a_mission_begun_anew() -> None:
    play = DeskPlay()
    play.begin()
    play.take(LinkChanged(False))
    play.begin(run=2)

    assert play.desk.mission_state.cut_since_s is not None
