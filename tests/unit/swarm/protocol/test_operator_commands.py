"""Which of the operator's commands counts for whom."""

from __future__ import annotations

from swarm.model.ids import COORDINATOR, FLEET, OPERATOR
from swarm.protocol.messages import CommandKind, OperatorCommand
from swarm.protocol.operator_commands import (
    abort_command,
    describe_command,
    in_force,
    newest_command,
)
from swarm.protocol.registers import Replica
from tests.support.builders import brief, message, uav

HOLD, RESUME, RETURN, ABORT = CommandKind
BRIEF = message(COORDINATOR, brief(uav("u0"), uav("u1")))


def said(*kinds: CommandKind, run: int = 1) -> Replica:
    """The replica of one who knows the mission and these commands, given in this order."""
    replica = Replica()
    replica.join(BRIEF)
    for number, kind in enumerate(kinds, start=1):
        target = FLEET if kind is ABORT else "u0"
        replica.join(message(OPERATOR, OperatorCommand(target, kind, run, ""), number))
    return replica


def kind_for(replica: Replica, uav_id: str) -> CommandKind | None:
    found = newest_command(replica, uav_id)
    return None if found is None else found[1].kind


def test_the_newest_command_to_a_uav_counts() -> None:
    assert kind_for(said(HOLD, RESUME), "u0") is RESUME
    assert kind_for(said(HOLD, RESUME), "u1") is None


def test_a_command_to_the_fleet_concerns_everyone_until_a_newer_one() -> None:
    assert kind_for(said(HOLD, ABORT), "u0") is ABORT
    assert kind_for(said(ABORT, HOLD), "u0") is HOLD
    assert kind_for(said(ABORT, HOLD), "u1") is ABORT


def test_an_abort_stands_whatever_is_said_to_one_uav_afterwards() -> None:
    assert abort_command(said(ABORT, HOLD, RESUME)) is not None
    assert abort_command(said(HOLD, RETURN)) is None


def test_commands_of_an_earlier_flight_do_not_count() -> None:
    replica = said(HOLD, ABORT, run=7)

    assert in_force(replica) == {}
    assert newest_command(replica, "u0") is None
    assert abort_command(replica) is None


def test_nothing_counts_before_the_flight_is_known() -> None:
    replica = Replica()
    replica.join(message(OPERATOR, OperatorCommand(FLEET, ABORT, 1, "")))
    assert abort_command(replica) is None

    replica.join(BRIEF)
    assert abort_command(replica) is not None


def test_everyone_answers_for_the_operator_who_is_never_there() -> None:
    replica = said(HOLD)

    answered = list(replica.answers("u1", steady={"u0", "u1", COORDINATOR}))

    assert [each.writer for each in answered] == [OPERATOR]


def test_words_say_what_happened_and_why() -> None:
    assert describe_command(OperatorCommand("u0", HOLD, 1, "")) == "held by the operator"
    assert (
        describe_command(OperatorCommand(FLEET, ABORT, 1, "storm"))
        == "aborted by the operator: storm"
    )
    assert len(describe_command(OperatorCommand(FLEET, ABORT, 1, "x" * 200))) == 200
