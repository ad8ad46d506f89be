"""The simulated plane against a recorded flight of PX4's, from one end of its runway to the other.

Compared is what a bridge goes by: acknowledgements, the landing as it is read back, modes and
landed states in their order. When each of them comes depends on how the plane flies.
"""

from __future__ import annotations

import itertools
from typing import Any

import pytest

from agent.vehicle.firmware.px4_plane import Px4Plane
from tests.support.autopilot_plays import PLAYS, Key, played, recording, states, what_matters

TAKEOFF, HOLD, RETURN = ((4 << 16) | (sub << 24) for sub in (2, 3, 5))
CONVERSATION = {"COMMAND_ACK", "MISSION_REQUEST_INT", "MISSION_ACK"}
Said = list[dict[str, Any]]


@pytest.fixture(scope="module")
def flights() -> tuple[Said, Said, set[str]]:
    return played(PLAYS["PX4's runway"])


def keys(messages: Said, asked: set[str], kinds: set[str]) -> list[Key]:
    said = (key for name, key in what_matters(messages, asked) if name in kinds)
    return [key for key, _ in itertools.groupby(said)]


@pytest.mark.parametrize("kinds", [CONVERSATION, {"HEARTBEAT"}, {"MISSION_ITEM_INT"}])
def test_it_says_what_the_recorded_one_said_in_the_order_of_each_kind(
    flights: tuple[Said, Said, set[str]], kinds: set[str]
) -> None:
    real, simulated, asked = flights
    assert keys(simulated, asked, kinds) == keys(real, asked, kinds)


def test_it_takes_off_holds_returns_and_is_down(flights: tuple[Said, Said, set[str]]) -> None:
    real, simulated, _ = flights
    for said in (real, simulated):
        modes = [mode for (mode,) in states(said, "HEARTBEAT", "custom_mode")]
        assert modes == [HOLD, TAKEOFF, HOLD, RETURN, HOLD]
    landed = states(real, "EXTENDED_SYS_STATE", "landed_state")
    assert states(simulated, "EXTENDED_SYS_STATE", "landed_state") == landed


def test_the_recorded_plane_has_a_landing_by_its_own_parameters() -> None:
    told = {
        each["param_id"]: each["param_value"]
        for each in recording("px4-1.17-runway.jsonl")
        if each["msg"] == "PARAM_VALUE"
    }
    assert set(Px4Plane.landing_names) <= set(told)
    assert (told["NAV_LOITER_RAD"], told["FW_LND_ANG"]) == (80.0, 5.0)
