"""A parameter is raised for the flight and put back after it, whatever comes between."""

from __future__ import annotations

from dataclasses import replace

import pytest

from agent.core.interface import Arrived, GoTo, HandedOver, Home, Return, VehicleReady
from agent.vehicle.config import BridgeConfig, CommandStyle
from agent.vehicle.parameter_override import OverrideSpec
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight, rough_link
from tests.support.fake_copter import FakeCopter
from tests.support.fake_px4 import FakePx4

MISSIONS = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION, position_rate_hz=10.0)
OWN = {"WP_JERK": 1.0, "MPC_JERK_AUTO": 4.0}
RAISED = {"MPC_JERK_AUTO": 20.004}
NORTH = (5.0, 30.0, 10.0)


@pytest.fixture
def fake() -> type[FakeCopter]:
    """The only firmware that has one to lend."""
    return FakePx4


def jerk_of(copter: FakeCopter) -> tuple[str, float]:
    name = next(name for name in copter.jerk_names if name in copter.parameters)
    return name, copter.parameters[name]


def flight_of(fake: type[FakeCopter], config: BridgeConfig = MISSIONS) -> BridgeFlight:
    return BridgeFlight(fake(ORIGIN), config)


def is_raised(flight: BridgeFlight) -> bool:
    name, value = jerk_of(flight.copter)
    return value == pytest.approx(RAISED[name], rel=1e-6)


def is_own(flight: BridgeFlight) -> bool:
    name, value = jerk_of(flight.copter)
    return value == pytest.approx(OWN[name], rel=1e-6)


def test_it_is_raised_for_the_flight_and_put_back_before_the_landing(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake).prepared()
    assert is_raised(flight)
    flight.order(GoTo(1, NORTH))
    flight.run_until(Arrived(1))
    assert is_raised(flight)
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert is_own(flight)
    assert flight.cautions == []


def test_it_stays_as_long_as_the_vehicle_is_not_armed(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    copter.prearm_ok = False
    flight = BridgeFlight(copter, MISSIONS)
    flight.order(START)
    flight.run(20.0)
    assert is_own(flight)


def test_it_is_put_back_when_a_pilot_takes_over(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake).flying()
    flight.copter.mode = flight.copter.pilot_mode
    flight.run_until(HandedOver)
    flight.run(5.0)
    assert is_own(flight)


def test_another_life_of_the_agent_puts_back_what_the_first_one_raised(
    fake: type[FakeCopter],
) -> None:
    flight = flight_of(fake).flying()
    flight.restart()
    flight.order(replace(START, resume=True))
    flight.run_until(VehicleReady())
    flight.run(3.0)
    assert is_raised(flight)
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert is_own(flight)


def test_it_is_set_and_put_back_over_a_rough_link(fake: type[FakeCopter]) -> None:
    flight = BridgeFlight(
        fake(ORIGIN), MISSIONS, to_vehicle=rough_link(1), to_bridge=rough_link(2)
    ).prepared()
    flight.run(10.0)
    assert is_raised(flight)
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert is_own(flight)


def test_a_vehicle_that_has_more_keeps_it(fake: type[FakeCopter]) -> None:
    copter = fake(ORIGIN)
    name, _ = jerk_of(copter)
    copter.parameters[name] = 30.0
    flight = BridgeFlight(copter, MISSIONS).prepared()
    flight.run(5.0)
    flight.order(Return("mission ended"))
    flight.run_until(Home())
    assert copter.parameters[name] == 30.0
    assert not [m for m in copter.heard if m.get_type() == "PARAM_SET" and m.param_id == name]


def test_nothing_is_set_where_the_vehicles_own_is_to_be_kept(fake: type[FakeCopter]) -> None:
    flight = flight_of(fake, replace(MISSIONS, raises_jerk=False)).prepared()
    flight.run(5.0)
    assert is_own(flight)
    told = [m for m in flight.copter.heard if m.get_type() == "PARAM_SET"]
    assert not [m for m in told if m.param_id in fake.jerk_names]


@pytest.mark.parametrize("command", list(CommandStyle))
def test_an_arducopter_needs_no_other_jerk(command: CommandStyle) -> None:
    flight = BridgeFlight(FakeCopter(ORIGIN), replace(MISSIONS, command=command)).prepared()
    flight.run(5.0)
    assert is_own(flight)
    assert not [m for m in flight.copter.heard if getattr(m, "param_id", "") in OWN]


def test_a_vehicle_without_it_flies_all_the_same_and_people_are_told(
    fake: type[FakeCopter],
) -> None:
    copter = fake(ORIGIN)
    name, _ = jerk_of(copter)
    del copter.parameters[name]
    flight = BridgeFlight(copter, MISSIONS).prepared()
    flight.run(20.0)
    names = " or ".join(fake.jerk_names)
    assert flight.cautions == [f"{names} cannot be set for the flight, so legs take longer"]


@pytest.mark.parametrize("own", [1.0, 4.0, 4.25, 0.5, 19.99])
def test_what_was_set_tells_what_the_vehicle_had(own: float) -> None:
    override_spec = OverrideSpec(("JERK",), 20.0)
    override = override_spec.override(own)
    assert 20.0 < override <= 20.02
    assert override_spec.own(override) == own


@pytest.mark.parametrize("found", [-3.0, 0.0, 1.0, 20.0, 20.5, 80.0])
def test_what_was_not_set_by_us_is_the_vehicles_own(found: float) -> None:
    override_spec = OverrideSpec(("JERK",), 20.0)
    assert override_spec.own(found) == found
