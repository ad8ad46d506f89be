"""Start and home must fit each other, the ground and the scenario before a vehicle takes off."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import Prepare, Refused, VehicleReady
from agent.vehicle.activity import FlightPhase
from agent.vehicle.config import BridgeConfig
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import ARM, TAKEOFF, FakeCopter
from tests.support.fake_px4 import FakePx4


def test_height_of_takeoff_follows_from_home_not_from_the_origin(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN, ground_m=-20.0))
    flight.order(START)
    flight.run_until(VehicleReady())
    [takeoff] = flight.copter.commands(TAKEOFF)
    takeoff_m = {FakeCopter: 30.0, FakePx4: ORIGIN.alt_m + 10.0}[fake]
    assert takeoff.param7 == pytest.approx(takeoff_m, abs=0.01)
    assert flight.copter.position_m[2] == pytest.approx(10.0, abs=1.0)


@pytest.mark.parametrize(
    ("ground_m", "words"), [(9.8, "0.2 m above"), (50.0, "-40.0 m above the vehicle's home")]
)
def test_start_at_or_below_the_ground_is_refused_before_arming(
    fake: type[FakeCopter], ground_m: float, words: str
) -> None:
    flight = BridgeFlight(fake(ORIGIN, ground_m=ground_m))
    flight.order(START)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert words in refused.reason
    assert not flight.copter.commands(ARM)


@pytest.mark.parametrize(
    ("ground_m", "home_m"), [(-24.0, 464), (24.0, 512), (10.1, 498), (-10.1, 478)]
)
def test_home_at_another_height_than_the_scenario_says_is_refused_before_arming(
    fake: type[FakeCopter], ground_m: float, home_m: int
) -> None:
    flight = BridgeFlight(fake(ORIGIN, ground_m=ground_m))
    order = replace(START, position_enu_m=(5.0, 0.0, 50.0), ground_up_m=0.0)
    flight.order(order)
    assert flight.run_until(Refused) == Refused(
        order,
        f"home is at {home_m} m above sea level, the scenario says 488 m there: "
        "correct [origin] alt_m, or position_m",
    )
    assert not flight.copter.commands(ARM)


@pytest.mark.parametrize(("ground_m", "tolerance_m"), [(9.0, 10.0), (-9.0, 10.0), (25.0, 30.0)])
def test_home_at_about_the_height_that_the_scenario_says_will_do(
    fake: type[FakeCopter], ground_m: float, tolerance_m: float
) -> None:
    config = BridgeConfig(1, ORIGIN, position_rate_hz=10.0, home_tolerance_m=tolerance_m)
    flight = BridgeFlight(fake(ORIGIN, ground_m=ground_m), config)
    flight.order(replace(START, position_enu_m=(5.0, 0.0, 30.0), ground_up_m=0.0))
    flight.run_until(VehicleReady())


def test_home_of_a_vehicle_armed_on_the_ground_is_looked_at_before_takeoff(
    fake: type[FakeCopter],
) -> None:
    copter = fake(ORIGIN, ground_m=-24.0, ready_s=1.0)
    flight = BridgeFlight(copter)
    flight.run(3.0)
    copter.set_mode(fake.own_mode)
    copter.armed, copter.armed_at_s = True, copter.now_s
    flight.order(replace(START, resume=True, ground_up_m=0.0))
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "home is at 464 m above sea level" in refused.reason
    assert not copter.commands(TAKEOFF)


def test_home_of_a_vehicle_resumed_in_the_air_does_not_matter(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(fake(ORIGIN)).flying().restart()
    flight.order(replace(START, resume=True, ground_up_m=100.0))
    flight.run_until(VehicleReady())


def test_vehicle_at_the_other_end_of_the_world_is_refused(fake: type[FakeCopter]) -> None:
    elsewhere = replace(ORIGIN, lat_deg=-35.0, lon_deg=149.0)
    flight = BridgeFlight(fake(elsewhere))
    flight.order(START)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert refused.reason.endswith("km from the mission's origin")
    assert not flight.copter.commands(ARM)


def test_vehicle_that_an_older_px4_put_off_africa_is_refused_with_the_cause(
    fake: type[FakeCopter],
) -> None:
    flight = BridgeFlight(fake(replace(ORIGIN, lat_deg=4.7e-6, lon_deg=8e-7)))
    flight.order(START)
    refused = flight.run_until(Refused)
    assert isinstance(refused, Refused)
    assert "near 0° N 0° E: a PX4 before 1.16" in refused.reason
    assert not flight.copter.commands(ARM)


@pytest.mark.parametrize(
    "order",
    [
        Prepare((math.nan, 0.0, 10.0), 4.0),
        Prepare((0.0, 0.0, 10.0), 0.0),
        Prepare((0.0, 0.0, 10.0), math.inf),
        Prepare((30_000.0, 0.0, 10.0), 4.0),
        Prepare((0.0, 0.0, 2_000.0), 4.0),
    ],
)
def test_impossible_start_is_refused_at_once(fake: type[FakeCopter], order: Prepare) -> None:
    flight = BridgeFlight(fake(ORIGIN))
    [refused] = flight.order(order)
    assert isinstance(refused, Refused)
    assert flight.bridge.phase is FlightPhase.IDLE
