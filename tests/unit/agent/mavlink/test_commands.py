"""Acknowledgement, retry and patience."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.mavlink.commands import (
    CommandEnded,
    CommandPolicy,
    Commands,
    Ending,
    result_text,
)
from agent.mavlink.messages import AltitudeFrame, CommandAck, CommandInt, CommandLong

ARM = CommandLong(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
STREAM = CommandLong(511, (33.0, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0))
TARGET = CommandInt(192, AltitudeFrame.HOME, (-1.0, 0.0, 0.0, math.nan), 47.0, 8.0, 12.0)
ACCEPTED, BUSY, DENIED, IN_PROGRESS = 0, 1, 2, 5


def machine() -> Commands:
    return Commands(CommandPolicy(tries=3, busy_tries=3))


def test_accepted_command_ends() -> None:
    commands = machine()
    assert commands.send("arm", ARM, 0.0) == [ARM]
    assert commands.on_ack(CommandAck(400, ACCEPTED), 0.1) == (
        [],
        [CommandEnded("arm", Ending.ACCEPTED, 0)],
    )
    assert commands.next_deadline_s() is None


def test_unanswered_command_is_sent_again_with_a_confirmation_and_then_given_up() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    assert commands.next_deadline_s() == 1.0
    assert commands.on_time(0.99) == ([], [])
    assert commands.on_time(1.0) == ([replace(ARM, confirmation=1)], [])
    assert commands.on_time(2.0) == ([replace(ARM, confirmation=2)], [])
    assert commands.on_time(3.0) == ([], [CommandEnded("arm", Ending.UNANSWERED, None)])
    assert not commands.pending("arm")


def test_busy_vehicle_is_asked_again_later_but_not_for_ever() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    assert commands.on_ack(CommandAck(400, BUSY), 0.1) == ([], [])
    assert commands.on_time(0.5) == ([], [])
    assert commands.on_time(0.6) == ([ARM], [])
    commands.on_ack(CommandAck(400, BUSY), 0.7)
    commands.on_time(1.2)
    assert commands.on_ack(CommandAck(400, BUSY), 1.3) == (
        [],
        [CommandEnded("arm", Ending.REFUSED, BUSY)],
    )


def test_command_in_progress_is_waited_for_without_sending_again() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    commands.on_ack(CommandAck(400, IN_PROGRESS), 0.1)
    assert commands.on_time(9.0) == ([], [])
    assert commands.on_ack(CommandAck(400, ACCEPTED), 9.5)[1] == [
        CommandEnded("arm", Ending.ACCEPTED, 0)
    ]


def test_commands_of_one_number_wait_in_line() -> None:
    commands = machine()
    second = replace(STREAM, params=(1.0, *STREAM.params[1:]))
    assert commands.send("a", STREAM, 0.0) == [STREAM]
    assert commands.send("b", second, 0.0) == []
    assert commands.send("arm", ARM, 0.0) == [ARM]
    assert commands.on_ack(CommandAck(511, DENIED), 0.1) == (
        [second],
        [CommandEnded("a", Ending.REFUSED, DENIED)],
    )
    assert commands.pending("b")


def test_newer_target_supersedes_and_the_old_acknowledgement_does_not_count() -> None:
    commands = machine()
    newer = replace(TARGET, lat_deg=48.0)
    commands.send("target", TARGET, 0.0)
    assert commands.send("target", newer, 0.1) == [newer]
    assert commands.on_ack(CommandAck(192, ACCEPTED), 0.2) == ([], [])
    assert commands.on_ack(CommandAck(192, ACCEPTED), 0.3)[1] == [
        CommandEnded("target", Ending.ACCEPTED, 0)
    ]
    assert commands.stray_acks == 1


def test_acknowledgement_that_never_comes_does_not_block_the_next_for_ever() -> None:
    commands = machine()
    commands.send("target", TARGET, 0.0)  # its acknowledgement is lost
    commands.send("target", replace(TARGET, lat_deg=48.0), 0.1)
    commands.on_ack(CommandAck(192, ACCEPTED), 0.2)
    commands.on_time(1.1)
    assert commands.on_ack(CommandAck(192, ACCEPTED), 1.2)[1]


def test_stray_and_doubled_acknowledgements_end_nothing() -> None:
    commands = machine()
    assert commands.on_ack(CommandAck(400, ACCEPTED), 0.0) == ([], [])
    commands.send("arm", ARM, 0.0)
    commands.on_ack(CommandAck(400, ACCEPTED), 0.1)
    assert commands.on_ack(CommandAck(400, ACCEPTED), 0.2) == ([], [])
    assert commands.stray_acks == 2


def test_cancelled_commands_are_silent() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    commands.cancel_all()
    assert commands.on_ack(CommandAck(400, ACCEPTED), 0.1) == ([], [])
    assert commands.on_time(10.0) == ([], [])


def test_results_are_named() -> None:
    assert [result_text(r) for r in (None, 1, 9, 77)] == [
        "no answer",
        "temporarily rejected",
        "unsupported frame",
        "result 77",
    ]


@pytest.mark.parametrize("name", ["ack_timeout_s", "tries", "busy_delay_s", "progress_timeout_s"])
def test_patience_must_be_positive(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        CommandPolicy(**{name: 0})
