"""A vehicle that nobody would bring home is not armed, unless that is accepted."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from agent.core.interface import VehicleReady
from agent.vehicle.config import BridgeConfig, CommandStyle
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight, rough_link
from tests.support.fake_copter import ARM, FakeCopter
from tests.support.fake_px4 import FakePx4

CONFIG = BridgeConfig(1, ORIGIN)
ACCEPTED = BridgeConfig(1, ORIGIN, accept_no_failsafe=True)
LOST = {FakeCopter: "FS_GCS_ENABLE", FakePx4: "NAV_DLL_ACT"}
"""What decides on what the vehicle does without its agent."""
BATTERY = {FakeCopter: "BATT_FS_LOW_ACT", FakePx4: "COM_LOW_BAT_ACT"}

Change = Callable[[FakeCopter], None]


def prepared(
    fake: type[FakeCopter], change: Change, config: BridgeConfig = CONFIG, **link: Any
) -> BridgeFlight:
    """A flight whose vehicle is prepared for as long as that takes."""
    copter = fake(ORIGIN)
    change(copter)
    flight = BridgeFlight(copter, config, **link)
    flight.order(START)
    for _ in range(20):
        if VehicleReady() not in flight.reports:
            flight.run(1.0)
    return flight


def setting(**parameters: float | None) -> Change:
    """Parameters of other values; None: the firmware does not know them."""

    def change(copter: FakeCopter) -> None:
        for name, value in parameters.items():
            if value is None:
                copter.parameters.pop(name, None)
            else:
                copter.parameters[name] = value

    return change


def cautions(flight: BridgeFlight) -> list[str]:
    return flight.cautions


def assert_not_armed(flight: BridgeFlight, why: str) -> None:
    assert not flight.copter.commands(ARM)
    reason = flight.reasons()[-1]
    assert why in reason
    assert "--accept-no-failsafe" in reason
    assert "\n" not in reason
    assert len(reason) <= 200


def assert_flies(flight: BridgeFlight) -> None:
    assert VehicleReady() in flight.reports, flight.reasons()


def test_vehicle_that_comes_home_without_its_agent_is_armed(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting())

    assert_flies(flight)
    assert cautions(flight) == []


def test_vehicle_that_would_stay_in_the_air_is_not_armed(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{LOST[fake]: 0.0}))

    assert_not_armed(flight, f"{LOST[fake]} is 0")


def test_landing_is_as_good_as_returning(fake: type[FakeCopter]) -> None:
    lands = {FakeCopter: 5.0, FakePx4: 3.0}[fake]

    assert_flies(prepared(fake, setting(**{LOST[fake]: lands})))


@pytest.mark.parametrize(("value", "what"), [(1, "hovers"), (5, "falls"), (6, "falls")])
def test_px4_that_holds_or_falls_is_not_armed(value: int, what: str) -> None:
    assert_not_armed(prepared(FakePx4, setting(NAV_DLL_ACT=float(value))), what)


def test_px4_whose_hold_mode_is_excepted_is_not_armed() -> None:
    assert_not_armed(prepared(FakePx4, setting(COM_DLL_EXCEPT=3.0)), "COM_DLL_EXCEPT")
    assert_flies(prepared(FakePx4, setting(COM_DLL_EXCEPT=5.0)))


def test_an_older_px4_has_no_exceptions() -> None:
    assert_flies(prepared(FakePx4, setting(COM_DLL_EXCEPT=None)))


@pytest.mark.parametrize("name", ["MAV_GCS_SYSID", "SYSID_MYGCS"])
def test_arducopter_that_listens_to_another_ground_station_is_not_armed(name: str) -> None:
    def change(copter: FakeCopter) -> None:
        del copter.parameters["MAV_GCS_SYSID"]
        copter.parameters[name] = 252.0

    assert_not_armed(prepared(FakeCopter, change), "system id 252")


def test_older_arducopters_call_it_by_other_names() -> None:
    older = setting(MAV_GCS_SYSID=None, MAV_GCS_SYSID_HI=None, SYSID_MYGCS=255.0)

    assert_flies(prepared(FakeCopter, older))


def test_arducopter_may_listen_to_many_ground_stations() -> None:
    assert_flies(prepared(FakeCopter, setting(MAV_GCS_SYSID=250.0, MAV_GCS_SYSID_HI=255.0)))


def test_a_parameter_that_nobody_tells_brings_no_vehicle_home(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{LOST[fake]: None}))

    assert_not_armed(flight, f"{LOST[fake]} is not known")


def test_it_is_armed_once_the_parameter_is_set(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{LOST[fake]: 0.0}))
    flight.copter.parameters[LOST[fake]] = 2.0

    flight.run_until(VehicleReady())


def test_who_accepts_it_is_told_and_flies(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{LOST[fake]: 0.0}), ACCEPTED)

    assert_flies(flight)
    (caution,) = cautions(flight)
    assert f"{LOST[fake]} is 0" in caution
    assert "\n" not in caution
    assert len(caution) <= 200


def test_missions_have_their_own_way_home(fake: type[FakeCopter]) -> None:
    missions = BridgeConfig(1, ORIGIN, command=CommandStyle.MISSION)
    flight = prepared(fake, setting(**{LOST[fake]: 0.0}), missions)

    assert_flies(flight)
    assert cautions(flight) == []


def test_battery_that_is_only_warned_of_is_told(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{BATTERY[fake]: 0.0}))

    assert_flies(flight)
    (caution,) = cautions(flight)
    assert f"{BATTERY[fake]} is 0" in caution


def test_a_simulated_vehicle_is_flown_as_it_is(fake: type[FakeCopter]) -> None:
    as_it_comes = {LOST[fake]: 0.0, BATTERY[fake]: 0.0, "SWARM_SIMULATED": 1.0}
    flight = prepared(fake, setting(**as_it_comes))

    assert_flies(flight)
    assert cautions(flight) == []


@pytest.mark.parametrize("seed", range(5))
def test_parameters_are_read_over_a_rough_link(fake: type[FakeCopter], seed: int) -> None:
    flight = prepared(fake, setting(), to_vehicle=rough_link(seed), to_bridge=rough_link(seed + 99))

    if VehicleReady() not in flight.reports:
        flight.run_until(VehicleReady())
    assert_flies(flight)


def test_nothing_is_read_any_more_in_the_air(fake: type[FakeCopter]) -> None:
    flight = prepared(fake, setting(**{LOST[fake]: 0.0}), ACCEPTED)
    before = len([m for m in flight.copter.heard if m.get_type() == "PARAM_REQUEST_READ"])
    flight.run(20.0)

    reads = [m for m in flight.copter.heard if m.get_type() == "PARAM_REQUEST_READ"]
    assert len(reads) == before <= 40
