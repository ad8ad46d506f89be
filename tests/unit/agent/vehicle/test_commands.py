"""Acknowledgement, retry and patience."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent.vehicle.commands import (
    CommandEnded,
    CommandOutcome,
    CommandPolicy,
    CommandQueue,
    VehicleCommand,
    result_text,
)
from agent.vehicle.messages import AltitudeFrame, CommandAck, CommandInt, CommandLong

ARM = CommandLong(400, (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
STREAM = CommandLong(511, (33.0, 1e5, 0.0, 0.0, 0.0, 0.0, 0.0))
TARGET = CommandInt(192, AltitudeFrame.HOME, (-1.0, 0.0, 0.0, math.nan), 47.0, 8.0, 12.0)
HOLD = CommandLong(176, (1.0, 4.0, 3.0, 0.0, 0.0, 0.0, 0.0))
RTL = CommandLong(176, (1.0, 4.0, 5.0, 0.0, 0.0, 0.0, 0.0))
ACCEPTED, BUSY, DENIED, IN_PROGRESS = 0, 1, 2, 5


def machine() -> CommandQueue:
    return CommandQueue(CommandPolicy(tries=3, busy_tries=3))


def test_accepted_command_ends() -> None:
    commands = machine()
    assert commands.send("arm", ARM, 0.0) == [ARM]
    assert commands.on_ack(CommandAck(400, ACCEPTED), 0.1) == (
        [],
        [CommandEnded("arm", CommandOutcome.ACCEPTED, 0)],
    )
    assert commands.next_deadline_s() is None


def test_unanswered_command_is_sent_again_with_a_confirmation_and_then_given_up() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    assert commands.next_deadline_s() == 1.0
    assert commands.on_time(0.99) == ([], [])
    assert commands.on_time(1.0) == ([replace(ARM, confirmation=1)], [])
    assert commands.on_time(2.0) == ([replace(ARM, confirmation=2)], [])
    assert commands.on_time(3.0) == ([], [CommandEnded("arm", CommandOutcome.UNANSWERED, None)])
    assert not commands.pending("arm")


@pytest.mark.parametrize("busy", [False, True])
def test_what_is_sent_again_is_made_anew_if_that_is_wished(busy: bool) -> None:
    commands = machine()
    later = deque([replace(TARGET, lat_deg=47.1), None, replace(TARGET, lat_deg=47.2)])
    sent = commands.send("stop", TARGET, 0.0, later.popleft)
    for at_s in (1.0, 2.0):
        if busy:
            commands.on_ack(CommandAck(TARGET.command, BUSY), at_s - 0.5)
        sent += commands.on_time(at_s)[0]

    assert [message.lat_deg for message in sent if isinstance(message, CommandInt)] == [
        47.0,
        47.1,
        47.1,
    ]


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
        [CommandEnded("arm", CommandOutcome.REFUSED, BUSY)],
    )


def test_command_in_progress_is_waited_for_without_sending_again() -> None:
    commands = machine()
    commands.send("arm", ARM, 0.0)
    commands.on_ack(CommandAck(400, IN_PROGRESS), 0.1)
    assert commands.on_time(9.0) == ([], [])
    assert commands.on_ack(CommandAck(400, ACCEPTED), 9.5)[1] == [
        CommandEnded("arm", CommandOutcome.ACCEPTED, 0)
    ]


def test_commands_of_one_number_wait_in_line() -> None:
    commands = machine()
    second = replace(STREAM, params=(1.0, *STREAM.params[1:]))
    assert commands.send("a", STREAM, 0.0) == [STREAM]
    assert commands.send("b", second, 0.0) == []
    assert commands.send("arm", ARM, 0.0) == [ARM]
    assert commands.on_ack(CommandAck(511, DENIED), 0.1) == (
        [second],
        [CommandEnded("a", CommandOutcome.REFUSED, DENIED)],
    )
    assert commands.pending("b")


def test_newer_target_supersedes_and_the_old_acknowledgement_does_not_count() -> None:
    commands = machine()
    newer = replace(TARGET, lat_deg=48.0)
    commands.send("target", TARGET, 0.0)
    assert commands.send("target", newer, 0.1) == [newer]
    assert commands.on_ack(CommandAck(192, ACCEPTED), 0.2) == ([], [])
    assert commands.on_ack(CommandAck(192, ACCEPTED), 0.3)[1] == [
        CommandEnded("target", CommandOutcome.ACCEPTED, 0)
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


def test_a_second_acknowledgement_does_not_answer_the_next_command() -> None:
    commands = machine()
    commands.acknowledged_twice = frozenset({176})
    commands.send("mode", HOLD, 0.0)
    assert commands.on_ack(CommandAck(176, ACCEPTED), 0.1)[1] == [
        CommandEnded("mode", CommandOutcome.ACCEPTED, 0)
    ]
    assert commands.send("return", RTL, 0.1) == [RTL]
    assert commands.on_ack(CommandAck(176, ACCEPTED), 0.1) == ([], [])
    assert commands.pending("return")
    assert commands.on_ack(CommandAck(176, DENIED), 0.2)[1] == [
        CommandEnded("return", CommandOutcome.REFUSED, DENIED)
    ]


def test_a_second_acknowledgement_that_is_lost_delays_the_next_command_by_one_repetition() -> None:
    commands = machine()
    commands.acknowledged_twice = frozenset({176})
    commands.send("mode", HOLD, 0.0)
    commands.on_ack(CommandAck(176, ACCEPTED), 0.1)
    commands.send("return", RTL, 0.2)
    assert commands.on_ack(CommandAck(176, DENIED), 0.3) == ([], [])  # may be the first one's
    assert commands.on_ack(CommandAck(176, DENIED), 0.3)[1] == [
        CommandEnded("return", CommandOutcome.REFUSED, DENIED)
    ]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["send a", "send b", "send c", "wait", "wait"]),
            st.floats(0.0, 1.5),
            st.lists(st.booleans(), min_size=2, max_size=2),
            st.floats(0.0, 1.99),
        ),
        max_size=40,
    )
)
def test_no_command_is_ended_by_the_answer_to_another(
    steps: list[tuple[str, float, list[bool], float]],
) -> None:
    """Two acknowledgements each, lost or late by less than two timeouts, but in order."""
    commands = machine()
    commands.acknowledged_twice = frozenset({176})
    on_their_way: deque[tuple[float, int]] = deque()
    results: dict[str, int] = {}
    now_s, latest_s, sent = 0.0, 0.0, 0

    def transmit(out: list[VehicleCommand], arrive: list[bool], delay_s: float) -> None:
        nonlocal latest_s
        for message in out:
            assert isinstance(message, CommandLong)
            latest_s = max(latest_s, now_s + delay_s)
            answer = (latest_s, int(message.params[1]))
            on_their_way.extend(answer for arrives in arrive if arrives)

    def judge(ended: list[CommandEnded]) -> None:
        for one in ended:
            assert one.result in (None, results[one.tag])

    for what, wait_s, arrive, delay_s in steps:
        if what != "wait":
            sent += 1
            # Every command has an answer of its own, so that it cannot be mixed up unseen.
            results[what] = 100 + sent
            message = replace(RTL, params=(1.0, 100.0 + sent, *RTL.params[2:]))
            transmit(commands.send(what, message, now_s), arrive, delay_s)
        end_s = now_s + wait_s
        while True:
            ack_s = on_their_way[0][0] if on_their_way else math.inf
            due_s = commands.next_deadline_s()
            next_s = min(ack_s, math.inf if due_s is None else due_s)
            if next_s > end_s:
                break
            now_s = max(now_s, next_s)
            if ack_s <= next_s:
                out, ended = commands.on_ack(CommandAck(176, on_their_way.popleft()[1]), now_s)
            else:
                out, ended = commands.on_time(now_s)
            judge(ended)
            transmit(out, arrive, delay_s)
        now_s = end_s


def test_a_cancelled_command_makes_room_for_the_next() -> None:
    commands = machine()
    commands.send("mode", HOLD, 0.0)
    commands.send("return", RTL, 0.0)
    assert commands.cancel("return", 0.1) == []
    assert not commands.pending("return")
    commands.send("return", RTL, 0.2)
    assert commands.cancel("mode", 0.3) == [RTL]
    assert commands.cancel("mode", 0.4) == []


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
