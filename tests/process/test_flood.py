"""A hostile peer floods the bus of a mission that is flown by real processes."""

from __future__ import annotations

import asyncio

import pytest

from sim.fleet.faults.flood import HUGE_EVERY, RATE_HZ, fly_flooded, long_mission
from sim.fleet.faults.forgery import Malformation
from tests.process.pace import pace
from tests.support.observed_mission import watch

pytestmark = [pytest.mark.process]


def test_malformed_messages_change_no_decision_and_are_all_counted() -> None:
    times = 1.5 / pace(1.0)
    flood = asyncio.run(fly_flooded(times))

    assert flood.flood_s > 5.0
    for kind in Malformation:
        every = HUGE_EVERY if kind is Malformation.HUGE else 1
        assert flood.sent[kind] >= 2.0 * RATE_HZ / every, kind  # more as the machine can
    assert flood.answers > 0
    # The same mission in virtual time, where nobody is hostile.
    routes = watch(long_mission(times)).result().executed_routes
    assert flood.result.executed_routes == routes
    assert flood.decisions_kept
    assert len(flood.result.done) == 8
    assert flood.fates == ()
    assert len(flood.counted) == 3
    assert flood.ok, (flood.expected, flood.counted)
    assert len(flood.shown["uavs"]) == 3
    assert all(uav["dropped"].keys() >= flood.expected.keys() for uav in flood.shown["uavs"])
    assert any(other.startswith("ghost") for other in flood.shown["others"])
