"""What ground stations are told of one UAV, and which of their words are wishes."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.station_words import (
    AnswerStation,
    ShowStations,
    StationAsked,
    StationVerdict,
    StationWish,
)
from agent.vehicle.framing import TextJoiner
from agent.vehicle.signing import Signing, SigningKey
from agent.vehicle.station_desk import (
    ASK,
    CONFIRM,
    CONFIRM_INTERVALS,
    WISHES,
    DeskAction,
    StationDesk,
    TellStation,
)
from swarm.protocol.uav_messages import StatusPhase
from tests.support.mavlink_frames import frame

STATION = {"system": 250, "component": 190}
KEY = SigningKey(bytes(range(32)))
NOW_UNIX_S = 1.8e9
SHOWN = ShowStations("uav2", StatusPhase.FLYING, "t3", 3, "", 1, 4, 12.5)


def desk(*, heeds: bool = True, stations: int = 1) -> StationDesk:
    return StationDesk(2, [None] * stations, heeds=heeds)


def command(number: int, param1: float = 0.0, system: int = 2, component: int = 191) -> bytes:
    rest = (0.0,) * 6
    message = mavlink.MAVLink_command_long_message(system, component, number, 0, param1, *rest)
    return frame(message, **STATION)


def heard(at: StationDesk, station: int, data: bytes, now_s: float = 0.0) -> list[DeskAction]:
    return at.hear(station, data, now_s)


def told(actions: list[DeskAction]) -> list[Any]:
    """Messages told to stations."""
    parser = mavlink.MAVLink(None)
    return [
        parser.decode(bytearray(action.data))
        for action in actions
        if isinstance(action, TellStation)
    ]


def results(actions: list[DeskAction]) -> list[tuple[int, int]]:
    """(command, MAV_RESULT) of each acknowledgement."""
    acks = [message for message in told(actions) if message.get_type() == "COMMAND_ACK"]
    assert all((ack.target_system, ack.target_component) == (250, 190) for ack in acks)
    return [(ack.command, ack.result) for ack in acks]


def text(actions: list[DeskAction]) -> str:
    joiner = TextJoiner()
    said = [
        whole.text
        for message in told(actions)
        if message.get_type() == "STATUSTEXT"
        for whole in joiner.add(message.severity, message.text, message.id, message.chunk_seq)
    ]
    return " | ".join(said)


@pytest.mark.parametrize(("number", "wish"), WISHES.items())
@pytest.mark.parametrize("system", [2, 0])
def test_each_action_is_a_wish_and_is_answered(number: int, wish: StationWish, system: int) -> None:
    at = desk()

    heard(at, 0, command(31014, ASK))
    (asked,) = heard(at, 0, command(number, CONFIRM, system))

    assert isinstance(asked, StationAsked)
    assert asked.wish is wish
    answer = at.tell(AnswerStation(asked.number, StationVerdict.DONE), 0.0)
    assert results(answer) == [(number, mavlink.MAV_RESULT_ACCEPTED)]
    assert all(message.get_srcSystem() == 2 for message in told(answer))
    assert at.tell(AnswerStation(asked.number, StationVerdict.DONE), 0.0) == []


@pytest.mark.parametrize(
    ("verdict", "result"),
    [
        (StationVerdict.NOT_NOW, mavlink.MAV_RESULT_TEMPORARILY_REJECTED),
        (StationVerdict.DENIED, mavlink.MAV_RESULT_DENIED),
    ],
)
def test_what_is_not_done_is_acknowledged_with_a_reason(
    verdict: StationVerdict, result: int
) -> None:
    at = desk()
    (asked,) = heard(at, 0, command(31010))
    assert isinstance(asked, StationAsked)

    answer = at.tell(AnswerStation(asked.number, verdict, "it flies home"), 0.0)

    assert results(answer) == [(31010, result)]
    assert text(answer) == "it flies home"


def test_an_abort_concerns_everybody_who_hears_it() -> None:
    at = desk()

    assert results(heard(at, 0, command(31014, ASK, system=7))) == []
    (asked,) = heard(at, 0, command(31014, CONFIRM, system=7))
    assert isinstance(asked, StationAsked)
    assert asked.wish is StationWish.ABORT
    answer = at.tell(AnswerStation(asked.number, StationVerdict.DONE), 0.0)
    assert results(answer) == [], "system 7 answers"


def test_an_abort_counts_once_its_station_has_confirmed_it_in_time() -> None:
    at = desk(stations=2)
    too_soon = [(31014, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)]
    asks, confirms = command(31014, ASK), command(31014, CONFIRM)

    assert results(heard(at, 0, confirms, 0.0)) == too_soon
    assert results(heard(at, 0, asks, 1.0)) == [(31014, mavlink.MAV_RESULT_ACCEPTED)]
    assert results(heard(at, 1, confirms, 2.0)) == too_soon, "another has asked"
    assert results(heard(at, 0, confirms, 1.1 + CONFIRM_INTERVALS)) == too_soon
    heard(at, 0, asks, 20.0)
    for _ in range(2):  # its answer may be lost
        (asked,) = heard(at, 0, confirms, 20.0 + CONFIRM_INTERVALS)
        assert isinstance(asked, StationAsked)
    for step in (0.0, 3.0, math.nan):
        actions = heard(at, 0, command(31014, step))
        assert results(actions) == [(31014, mavlink.MAV_RESULT_DENIED)]


@pytest.mark.parametrize("number", list(WISHES))
def test_unless_told_to_nothing_is_heeded(number: int) -> None:
    at = desk(heeds=False)

    actions = heard(at, 0, command(number, 1.0))

    assert results(actions) == [(number, mavlink.MAV_RESULT_DENIED)]
    assert "--station-actions" in text(actions)


def test_other_commands_to_this_component_are_not_supported() -> None:
    at = desk()
    takeoff = mavlink.MAVLink_command_int_message(2, 191, 0, 31010, 0, 0, 0, 0, 0, 0, 0, 0, 0)

    assert results(heard(at, 0, command(176))) == [(176, mavlink.MAV_RESULT_UNSUPPORTED)]
    assert results(heard(at, 0, frame(takeoff, **STATION))) == [
        (31010, mavlink.MAV_RESULT_COMMAND_LONG_ONLY)
    ]


HARMLESS = [
    command(31010, system=7),
    command(31010, component=1),
    command(31010, component=0),
    command(400, 1.0, component=1),
    command(176, 1.0, component=0),
    frame(mavlink.MAVLink_set_mode_message(2, 1, 9), **STATION),
    frame(mavlink.MAVLink_manual_control_message(2, 500, 0, 500, 0, 0), **STATION),
    frame(mavlink.MAVLink_mission_clear_all_message(2, 1), **STATION),
    frame(mavlink.MAVLink_statustext_message(6, b"hold"), **STATION),
    b"\xfd\x09noise",
]


@pytest.mark.parametrize("data", HARMLESS)
def test_nothing_else_means_anything(data: bytes) -> None:
    assert heard(desk(), 0, data) == []


@given(st.binary(max_size=400))
def test_any_bytes_are_survived_and_ask_for_nothing(data: bytes) -> None:
    assert not any(isinstance(action, StationAsked) for action in heard(desk(), 0, data))


def test_wishes_that_nobody_answers_are_bounded() -> None:
    at = desk()

    actions = [action for _ in range(40) for action in heard(at, 0, command(31010))]

    assert sum(isinstance(action, StationAsked) for action in actions) == 16
    assert set(results(actions)) == {(31010, mavlink.MAV_RESULT_TEMPORARILY_REJECTED)}


def test_the_file_for_qgroundcontrol_has_each_action() -> None:
    file = Path(__file__).parents[4] / "deploy/ground-stations/qgroundcontrol-actions.json"
    contents = json.loads(file.read_text())

    at = desk()
    assert (contents["version"], contents["fileType"]) == (1, "MavlinkActions")
    for action in contents["actions"]:
        assert set(action) <= {"label", "description", "mavCmd", "compId", "param1"}
        data = command(action["mavCmd"], action.get("param1", 0.0), component=action["compId"])
        wish = WISHES[action["mavCmd"]]
        assert action["label"].lower().startswith(wish.value)
        actions = heard(at, 0, data)
        asked = [each.wish for each in actions if isinstance(each, StationAsked)]
        assert asked == ([] if action["label"] == "Abort: ask" else [wish])
    assert {action["mavCmd"] for action in contents["actions"]} == set(WISHES)


# -- keys -------------------------------------------------------------------------------------


def signed(data: bytes, key: SigningKey = KEY, *, late_s: float = 0.0) -> bytes:
    crc_extra = mavlink.mavlink_map[mavlink.MAVLINK_MSG_ID_COMMAND_LONG].crc_extra
    return Signing(key, lambda: NOW_UNIX_S - late_s, link_id=0).sign(data, crc_extra)


def test_with_a_key_only_what_is_signed_with_it_is_heeded_and_once() -> None:
    at = StationDesk(2, [Signing(KEY, lambda: NOW_UNIX_S, link_id=201)], heeds=True)
    other = SigningKey(bytes(range(1, 33)))
    good = signed(command(31010))

    assert heard(at, 0, command(31010)) == []
    assert heard(at, 0, signed(command(31010), other)) == []
    assert heard(at, 0, signed(command(31010), late_s=90.0)) == []
    assert [type(action) for action in heard(at, 0, good)] == [StationAsked]
    assert heard(at, 0, good) == []
    assert at.distrusted == 4


def test_with_a_key_everything_told_is_signed_for_each_station() -> None:
    signings = [Signing(KEY, lambda: NOW_UNIX_S, link_id=201 + n) for n in range(2)]
    at = StationDesk(2, signings, heeds=False)

    actions = at.tell(SHOWN, 0.0) + at.advance(0.0)

    for number in range(2):
        ear = Signing(KEY, lambda: NOW_UNIX_S)
        frames = [a.data for a in actions if isinstance(a, TellStation) and a.station == number]
        assert len(frames) > 3
        assert {str(ear.judge(each)) for each in frames} == {"believed"}


# -- what is told -----------------------------------------------------------------------------


def test_it_is_an_onboard_computer_that_beats_each_second() -> None:
    at = desk()

    beats = [n for n in range(31) if at.advance(0.1 * n)]

    assert beats == [0, 10, 20, 30]
    (beat,) = told(desk().advance(0.0))
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (2, 191)
    assert (beat.type, beat.autopilot) == (
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
        mavlink.MAV_AUTOPILOT_INVALID,
    )


def test_task_and_state_are_told_in_words_when_they_change_and_in_numbers_each_time() -> None:
    at = desk()

    assert text(at.tell(SHOWN, 5.0)) == "uav2 flying t3"
    assert at.tell(replace(SHOWN, n_done=2), 5.5) == []
    first, again = told(at.advance(6.0)[1:]), told(at.advance(7.5)[1:])

    values = {m.name: m.value for m in again}
    phase = list(StatusPhase).index(StatusPhase.FLYING)
    assert values == {"phase": phase, "task": 3, "tasks_done": 2, "tasks_open": 4, "eta_s": 10.5}
    assert {m.time_boot_ms for m in again} == {1500}
    assert next(m.value for m in first if m.name == "eta_s") == 12.0


def test_who_stops_or_leaves_is_told_of_as_a_warning() -> None:
    at = desk()
    note = "held by the operator: " + "x" * 200
    view = ShowStations("uav2", StatusPhase.HOLDING, None, 0, note, 1, 4, None)

    actions = at.tell(view, 0.0)

    assert text(actions) == f"uav2 holding: {note}"
    texts = [m for m in told(actions) if m.get_type() == "STATUSTEXT"]
    assert {m.severity for m in texts} == {mavlink.MAV_SEVERITY_WARNING}
    (eta,) = (m for m in told(at.advance(0.0)) if m.get_type() == "NAMED_VALUE_FLOAT")
    assert math.isnan(eta.value)


@pytest.mark.parametrize("length", [49, 50, 51, 100])
def test_texts_of_any_length_come_whole(length: int) -> None:
    at = desk()
    words = "a" * length
    (asked,) = heard(at, 0, command(31010))
    assert isinstance(asked, StationAsked)

    assert text(at.tell(AnswerStation(asked.number, StationVerdict.DENIED, words), 0.0)) == words


def test_only_who_asked_is_answered() -> None:
    at = desk(stations=2)
    (asked,) = heard(at, 1, command(31010))
    assert isinstance(asked, StationAsked)

    actions = at.tell(AnswerStation(asked.number, StationVerdict.DENIED, "no"), 0.0)

    assert {action.station for action in actions if isinstance(action, TellStation)} == {1}
