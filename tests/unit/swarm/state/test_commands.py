"""Which of the operator's commands counts for whom."""

from __future__ import annotations

from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.state.commands import aborted, in_force, newest, words
from swarm.state.registers import Replica
from swarm.wire.messages import Command, CommandKind
from tests.builders import brief, message, uav

HOLD, RESUME, RETURN, ABORT = CommandKind
BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1")))


def said(*kinds: CommandKind, run: int = 1) -> Replica:
    """The replica of one who knows the mission and these commands, given in this order."""
    replica = Replica()
    replica.join(BRIEF)
    for number, kind in enumerate(kinds, start=1):
        target = FLEET if kind is ABORT else "u0"
        replica.join(message(OPERATOR, Command(target, kind, run, ""), number))
    return replica


def kind_for(replica: Replica, uav_id: str) -> CommandKind | None:
    found = newest(replica, uav_id)
    return None if found is None else found[1].kind


def test_the_newest_command_to_a_uav_counts() -> None:
    assert kind_for(said(HOLD, RESUME), "u0") is RESUME
    assert kind_for(said(HOLD, RESUME), "u1") is None


def test_a_command_to_the_fleet_concerns_everyone_until_a_newer_one() -> None:
    assert kind_for(said(HOLD, ABORT), "u0") is ABORT
    assert kind_for(said(ABORT, HOLD), "u0") is HOLD
    assert kind_for(said(ABORT, HOLD), "u1") is ABORT


def test_an_abort_stands_whatever_is_said_to_one_uav_afterwards() -> None:
    assert aborted(said(ABORT, HOLD, RESUME)) is not None
    assert aborted(said(HOLD, RETURN)) is None


def test_commands_of_an_earlier_flight_do_not_count() -> None:
    replica = said(HOLD, ABORT, run=7)

    assert in_force(replica) == {}
    assert newest(replica, "u0") is None
    assert aborted(replica) is None


def test_nothing_counts_before_the_flight_is_known() -> None:
    replica = Replica()
    replica.join(message(OPERATOR, Command(FLEET, ABORT, 1, "")))
    assert aborted(replica) is None

    replica.join(BRIEF)
    assert aborted(replica) is not None


def test_everyone_answers_for_the_operator_who_is_never_there() -> None:
    replica = said(HOLD)

    answered = list(replica.answers("u1", steady={"u0", "u1", COORDINATOR}))

    assert [each.writer for each in answered] == [OPERATOR]


def test_words_say_what_happened_and_why() -> None:
    assert words(Command("u0", HOLD, 1, "")) == "held by the operator"
    assert words(Command(FLEET, ABORT, 1, "storm")) == "aborted by the operator: storm"
    assert len(words(Command(FLEET, ABORT, 1, "x" * 200))) == 200
