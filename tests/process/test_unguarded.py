"""Real processes whose router passes every lie of somebody with valid keys on."""

from __future__ import annotations

import asyncio

import pytest

from tests.chaos.insider import Trick
from tests.chaos.unguarded import fly_unguarded
from tests.process.pace import pace

pytestmark = [pytest.mark.process]


def test_lies_that_a_router_passes_on_are_seen_through_and_counted_by_every_uav() -> None:
    flight = asyncio.run(fly_unguarded(2.0 / pace(1.0), speedup=pace(2.0)))

    assert flight.fates == ()
    assert len(flight.result.done) == 8
    assert flight.result.executed_routes == flight.planned
    assert min(flight.lies[trick] for trick in Trick) > 10
    assert flight.questions > 10
    for uav, counts in flight.dropped.items():
        for reason in ("not signed", "wrongly signed", "not the signer's to say"):
            assert counts.get(reason, 0) > 10, (uav, counts)
