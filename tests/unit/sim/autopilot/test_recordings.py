"""The simulated vehicle against what the real firmwares said, word for word where it matters.

What ArduCopter says is compared in one order. PX4 tells of modes once a second and sends
texts when it finds time, so what it says is compared in the order of each kind.
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import MavlinkReceived
from tests.support.autopilot_plays import (
    PLAYS,
    RECORDINGS,
    REDUCTIONS,
    STATES,
    TELEMETRY,
    message_of,
    played,
    recording,
    states,
    what_matters,
)

ARDUCOPTERS = ["ArduCopter's mission", "ArduCopter's retarget"]
PX4S = ["PX4's mission", "PX4's boot", "PX4's retarget"]


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopter_says_what_the_recorded_one_said_in_one_order(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    assert list(what_matters(simulated, asked)) == list(what_matters(real, asked))


@pytest.mark.parametrize("name", PX4S)
def test_px4_says_what_the_recorded_one_said_in_the_order_of_each_kind(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    conversation = {"COMMAND_ACK", "MISSION_REQUEST_INT", "MISSION_ACK"}
    kinds = [conversation, *({kind} for kind in sorted(REDUCTIONS.keys() - conversation))]
    for kind in kinds:
        said, recorded = (
            [key for message, key in what_matters(messages, asked) if message in kind]
            for messages in (simulated, real)
        )
        assert said == recorded


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopter_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    mission = STATES["MISSION_CURRENT"]
    assert states(simulated, "MISSION_CURRENT", *mission) == states(
        real, "MISSION_CURRENT", *mission
    )
    landed = states(real, "EXTENDED_SYS_STATE", "landed_state")
    # A recording may end before the last state is reported.
    assert states(simulated, "EXTENDED_SYS_STATE", "landed_state")[: len(landed)] == landed
    # States that last less than a heartbeat may be missed on either side.
    fields = ("HEARTBEAT", *STATES["HEARTBEAT"])
    assert set(states(simulated, *fields)) <= set(states(real, *fields))
    assert (4, 217, 3) in states(simulated, *fields)  # armed and spooling up
    last = states(real, "SYS_STATUS", *STATES["SYS_STATUS"])[-1]
    assert states(simulated, "SYS_STATUS", *STATES["SYS_STATUS"])[-1] == last
    assert states(simulated, "EKF_STATUS_REPORT", "flags") == [(167,), (831,)]


@pytest.mark.parametrize("name", PX4S)
def test_px4_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    for message, fields in STATES.items():
        recorded = states(real, message, *fields)
        said = states(simulated, message, *fields)
        # A recording may end before the last state is reported.
        last = len(recorded) if message == "EXTENDED_SYS_STATE" else None
        assert said[:last] == recorded


METRES_PER_E7 = 1.11195e-2
"""Of latitude."""
FIELD = ["landings", "fence", "camera", "corners"]


@pytest.mark.parametrize("what", FIELD)
def test_arducopter_in_the_field_says_what_the_recorded_one_said_in_one_order(what: str) -> None:
    real, simulated, asked = played(PLAYS[f"ArduCopter's {what}"])

    # What is asked for while it boots is answered sooner or later.
    rate = "ack", mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
    said, recorded = (
        [each for each in what_matters(messages, asked) if each[1][:2] != rate]
        for messages in (simulated, real)
    )
    assert said == recorded


@pytest.mark.parametrize("what", FIELD)
def test_px4_in_the_field_says_what_the_recorded_one_said_in_the_order_of_each_kind(
    what: str,
) -> None:
    real, simulated, asked = played(PLAYS[f"PX4's {what}"])

    conversation = {"COMMAND_ACK", "MISSION_REQUEST_INT", "MISSION_ACK"}
    for kind in [conversation, *({kind} for kind in sorted(REDUCTIONS.keys() - conversation))]:
        said, recorded = (
            # How often it repeats itself depends on how long everything takes.
            [
                key
                for key, _ in itertools.groupby(
                    key for message, key in what_matters(messages, asked) if message in kind
                )
            ]
            for messages in (simulated, real)
        )
        assert said == recorded


@pytest.mark.parametrize("what", FIELD)
@pytest.mark.parametrize("whose", ["ArduCopter", "PX4"])
def test_vehicles_in_the_field_go_through_recorded_states(whose: str, what: str) -> None:
    real, simulated, _ = played(PLAYS[f"{whose}'s {what}"])

    landed = states(real, "EXTENDED_SYS_STATE", "landed_state")
    assert states(simulated, "EXTENDED_SYS_STATE", "landed_state") == landed
    fields = ("HEARTBEAT", *STATES["HEARTBEAT"])
    assert set(states(simulated, *fields)) <= set(states(real, *fields))


@pytest.mark.parametrize("whose", ["ArduCopter", "PX4"])
def test_missions_pass_corners_as_near_as_the_recorded_ones(whose: str) -> None:
    play = PLAYS[f"{whose}'s corners"]
    items = [each for each in play.messages() if each["msg"] == "MISSION_ITEM_INT" and each["z"]]
    corners = [(each["x"], each["y"]) for each in items]
    assert len(corners) == 4
    near_m = [
        [closest_m(before_targets(messages), corner) for corner in corners]
        for messages in played(play)[:2]
    ]

    for real_m, simulated_m in zip(*near_m, strict=True):
        assert abs(real_m - simulated_m) < 0.9
        assert max(real_m, simulated_m) < 2.0


def before_targets(messages: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """What was said before the vehicle was told to fly to targets."""
    command = mavlink.MAV_CMD_DO_REPOSITION
    told = next(place for place, each in enumerate(messages) if each.get("command") == command)
    return messages[:told]


def closest_m(messages: list[dict[str, Any]], corner: tuple[int, int]) -> float:
    """How near the vehicle came to a place of an item [m]."""
    east_m_per_e7 = 1.11195e-2 * math.cos(math.radians(corner[0] / 1e7))
    return min(
        math.hypot(
            (each["lat"] - corner[0]) * 1.11195e-2, (each["lon"] - corner[1]) * east_m_per_e7
        )
        for each in messages
        if each["msg"] == "GLOBAL_POSITION_INT"
    )


def test_everything_in_the_recordings_is_compared() -> None:
    known = REDUCTIONS.keys() | STATES.keys() | TELEMETRY
    for path in RECORDINGS.glob("*.jsonl"):
        said = {each["msg"] for each in recording(path.name) if each["from"] == "vehicle"}
        assert said <= known, f"{path.name} has messages that no comparison looks at"
        assert path.name in {play.name for play in PLAYS.values()}


def test_everything_the_recorded_ground_said_is_understood() -> None:
    for play in PLAYS.values():
        vehicle = play.vehicle()
        for each in play.messages():
            if each["from"] == "ground":
                message = message_of(each)
                message._header.srcSystem = 255
                said = vehicle.step(MavlinkReceived(0, message), 0.0)
                results = [send.message.result for send in said if hasattr(send.message, "result")]
                assert mavlink.MAV_RESULT_UNSUPPORTED not in results, each
        assert vehicle.unknown == 0
