"""A vehicle that is called home is given no mission any more, whatever was under way."""

from __future__ import annotations

import itertools

import pytest

from agent.core.interface import Arrived, GoTo, Home, Return
from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, BridgeFlight
from tests.support.fake_copter import FakeCopter

MISSIONS = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION, mission_patience_s=20.0)
NORTH, EAST = (5.0, 40.0, 12.0), (45.0, 0.0, 12.0)
GIVING = {"MISSION_COUNT", "MISSION_ITEM_INT", "MISSION_SET_CURRENT"}


def said(flight: BridgeFlight) -> set[str]:
    return {message.get_type() for message in flight.copter.heard}


def at_its_target(fake: type[FakeCopter]) -> BridgeFlight:
    flight = BridgeFlight(fake(ORIGIN), MISSIONS).prepared()
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    return flight


@pytest.mark.parametrize("answers", range(1, 8))
def test_upload_under_way_ends_with_the_call_home(fake: type[FakeCopter], answers: int) -> None:
    flight = at_its_target(fake)
    left = answers

    def few(data: bytes) -> list[bytes]:
        nonlocal left
        is_mission = int.from_bytes(data[7:10], "little") in (40, 44, 47, 51, 73)
        left -= is_mission
        return [] if is_mission and left < 0 else [data]

    flight.to_bridge = few
    flight.order(GoTo(2, EAST))
    flight.copter.heard.clear()
    flight.order(Return("enough"))
    flight.run_until(Home(), limit_s=200.0)
    assert not said(flight) & GIVING


def test_mission_of_an_earlier_life_is_not_renewed_before_the_call_home(
    fake: type[FakeCopter],
) -> None:
    flight = at_its_target(fake).restart()
    flight.run(3.0)
    copter, later_ms = flight.copter, itertools.count(1)

    def with_position(data: bytes) -> list[bytes]:
        """What tells the mission tells in the same read that the vehicle waits at its target."""
        if int.from_bytes(data[7:10], "little") != 73:
            return [data]
        copter.position(round((flight.now_s - copter.on_at_s) * 1e3) + next(later_ms))
        return [data + b"".join(copter._flush())]

    flight.to_bridge = with_position
    flight.copter.heard.clear()
    flight.order(Return("enough", resume=True))
    flight.run_until(Home(), limit_s=200.0)
    assert "MISSION_REQUEST_LIST" in said(flight)
    assert not said(flight) & GIVING
