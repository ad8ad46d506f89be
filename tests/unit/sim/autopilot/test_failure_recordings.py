"""The simulated vehicle against recordings of flights by our bridge's orders, and of failures.

Compared is what a bridge goes by: the order of modes and words when a failsafe acts, the
estimator's flags before, while and after, the failsafes' parameters, a target beyond the
firmware's own fence, and the mission that brings a vehicle home.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.support.autopilot_plays import PLAYS, Key, played, recording, states, what_matters

ARDUCOPTERS = [
    "ArduCopter's flight",
    "ArduCopter without its ground station",
    "ArduCopter with a low battery",
    "ArduCopter without GPS",
]
PX4S = [
    "PX4's flight",
    "PX4 without its ground station",
    "PX4 with a low battery",
    "PX4 without GPS",
]
CONVERSATION = {"COMMAND_ACK", "MISSION_REQUEST_INT", "MISSION_ACK"}
KINDS = [
    CONVERSATION,
    *({kind} for kind in ("HEARTBEAT", "STATUSTEXT", "PARAM_VALUE", "MISSION_COUNT")),
    *({kind} for kind in ("MISSION_ITEM_INT", "MISSION_ITEM_REACHED")),
]
"""Not what PX4 says to its gimbals and cameras."""
TERRAIN_OR_GLITCH = mavlink.EKF_POS_VERT_AGL | mavlink.ESTIMATOR_GPS_GLITCH
"""Flags that no bridge looks at."""
PASSING = {
    ("text", 2, "Low battery\t", 0),  # simulated batteries are fine, low or critical
    ("text", 4, "Preflight: GPS fix too low", 0),
}


def reason_left_out(said: list[tuple[str, Key]]) -> list[Key]:
    """Of what keeps a vehicle from arming, only that something does: firmware has many reasons."""
    keys = [
        ("text", key[1], "Arm: …") if str(key[2:3]).startswith("('Arm: ") else key
        for _, key in said
    ]
    return [key for key, _ in itertools.groupby(keys)]


def same_order(keys: list[Key], within: list[Key]) -> bool:
    """Whether they occur in that order, others between them or not."""
    rest = iter(within)
    return all(key in rest for key in keys)


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopter_says_what_the_recorded_one_said_in_one_order(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    said = reason_left_out(list(what_matters(simulated, asked)))
    assert said == reason_left_out(list(what_matters(real, asked)))


@pytest.mark.parametrize("name", PX4S)
def test_px4_says_what_the_recorded_one_said_in_the_order_of_each_kind(name: str) -> None:
    real, simulated, asked = played(PLAYS[name])

    for kinds in KINDS:
        # How often an item is told again depends on how fast it was flown.
        said, recorded = (
            [
                key
                for key, _ in itertools.groupby(
                    key for kind, key in what_matters(messages, asked) if kind in kinds
                )
                if key not in PASSING
            ]
            for messages in (simulated, real)
        )
        assert said == recorded


@pytest.mark.parametrize("name", [*ARDUCOPTERS, *PX4S])
def test_heartbeats_go_through_the_recorded_states(name: str) -> None:
    """A failsafe that acts is told as CRITICAL, and when that is over."""
    real, simulated, _ = played(PLAYS[name])

    fields = ("HEARTBEAT", "custom_mode", "system_status")
    # States that last less than a heartbeat may be missed on either side.
    assert same_order(states(simulated, *fields), states(real, *fields))
    critical = [state for state in states(real, *fields) if state[1] == mavlink.MAV_STATE_CRITICAL]
    assert [state for state in states(simulated, *fields) if state in critical] == critical


@pytest.mark.parametrize("name", ARDUCOPTERS)
def test_arducopters_estimator_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    fields = ("EKF_STATUS_REPORT", "flags")
    lost = [(37,), (167,)] if name == "ArduCopter without GPS" else []
    assert states(simulated, *fields)[-2 - len(lost) :] == [(167,), (831,), *lost]
    assert same_order(states(simulated, *fields), states(real, *fields))


@pytest.mark.parametrize("name", PX4S)
def test_px4s_estimator_goes_through_the_recorded_states(name: str) -> None:
    real, simulated, _ = played(PLAYS[name])

    def flags(messages: list[dict[str, Any]]) -> list[int]:
        told = (state for (state,) in states(messages, "ESTIMATOR_STATUS", "flags"))
        plain = (state & ~TERRAIN_OR_GLITCH for state in told if state)
        return [state for state, _ in itertools.groupby(plain)]

    ended = [37, 165] if name == "PX4 without GPS" else [959]
    assert flags(simulated) == [959, 831, *ended]
    assert same_order([(each,) for each in flags(simulated)], [(each,) for each in flags(real)])


@pytest.mark.parametrize(
    ("name", "battery_ok", "may_arm"),
    [
        ("ArduCopter's flight", True, True),
        ("ArduCopter with a low battery", False, False),
        ("PX4 with a low battery", False, False),
    ],
)
def test_a_low_battery_is_told_among_the_sensors(
    name: str, battery_ok: bool, may_arm: bool
) -> None:
    for messages in played(PLAYS[name])[:2]:
        told = states(messages, "SYS_STATUS", "onboard_control_sensors_health")
        health = [state for (state,) in told if state & mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO]
        batteries = [bool(state & mavlink.MAV_SYS_STATUS_SENSOR_BATTERY) for state in health]
        checks = [bool(state & mavlink.MAV_SYS_STATUS_PREARM_CHECK) for state in health]
        ready = checks.index(True)
        assert all(batteries[ready:]) == battery_ok
        assert all(checks[ready:]) == may_arm


def test_arducopter_tells_that_its_fence_is_on() -> None:
    for messages in played(PLAYS["ArduCopter's flight"])[:2]:
        told = states(messages, "SYS_STATUS", "onboard_control_sensors_enabled")
        fences = [bool(state & mavlink.MAV_SYS_STATUS_GEOFENCE) for (state,) in told]
        assert [each for each, _ in itertools.groupby(fences)] == [False, True]


def test_px4_says_nothing_of_its_failsafe_to_who_is_not_heard() -> None:
    """Its texts wait a few seconds for a ground station, and are dropped."""
    failsafes = {
        name: [
            each["text"]
            for each in recording(PLAYS[name].name)
            if each["msg"] == "STATUSTEXT" and "Failsafe" in each["text"]
        ]
        for name in ("PX4 without its ground station", "PX4 with a low battery")
    }

    assert failsafes == {
        "PX4 without its ground station": [],
        "PX4 with a low battery": [
            "Failsafe activated: entering Hold for 5 seconds\t",
            "Failsafe activated\t",
        ],
    }
