"""Orders that the bridge has no activity for: refused with a plain reason, and nothing follows."""

from __future__ import annotations

import pytest

from agent.core.interface import GoTo, Refused, Return, Swap, VehicleOrder
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import FakeCopter

CORNER = (20.0, 10.0, 10.0)
TARGET = (40.0, 30.0, 10.0)


@pytest.mark.parametrize(
    ("order", "reason"),
    [
        (Swap(1, (0.0, 0.0, 0.0)), "landing for another battery is not flown on autopilots yet"),
        (
            GoTo(1, TARGET, via_enu_m=(CORNER,)),
            "paths with corners are not flown on autopilots yet",
        ),
        (
            Return("over", path_enu_m=(CORNER,), via_enu_m=TARGET),
            "paths with corners are not flown on autopilots yet",
        ),
        (
            Return("over", via_enu_m=TARGET, land=True),
            "landing elsewhere than at home is not flown on autopilots yet",
        ),
    ],
    ids=["swap", "corners", "corners home", "landing elsewhere"],
)
def test_it_says_what_it_does_not_fly_yet_and_hovers_on(
    fake: type[FakeCopter], order: VehicleOrder, reason: str
) -> None:
    flight = BridgeFlight(fake(ORIGIN), BridgeConfig(1, ORIGIN))
    flight.prepared()

    refusals = [each for each in flight.order(order) if isinstance(each, Refused)]

    assert refusals == [Refused(order, reason)]
    flight.run(5.0)
    assert flight.bridge.phase is FlightPhase.HOVERING
    assert flight.copter.position_m == pytest.approx(START.position_enu_m, abs=1.0)
