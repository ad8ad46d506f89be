"""How a vehicle flies its legs: read from its parameters before it takes off, and told."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from agent.core.interface import FlightLimits, VehicleReady
from agent.vehicle.config import BridgeConfig
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.kinematics import (
    Kinematics,
    arducopter_jerk_s,
    arducopter_kinematics,
    px4_jerk_s,
    px4_kinematics,
)
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.flight_limits import LimitsReading
from agent.vehicle.messages import ParameterMissing, ParameterValue
from tests.support.bridge_flight import ORIGIN, START, BridgeFlight
from tests.support.fake_copter import FakeCopter
from tests.support.fake_px4 import FakePx4

NEW = {"WP_ACC": 1.5, "PSC_JERK_NE": 5.0, "ATC_ANGLE_MAX": 30.0}
OLD = {"WPNAV_ACCEL": 150.0, "PSC_JERK_XY": 5.0, "ANGLE_MAX": 3000.0}
PX4 = {
    "MPC_ACC_HOR": 3.0,
    "MPC_JERK_AUTO": 20.0,
    "MPC_TILTMAX_AIR": 45.0,
    "MPC_XY_VEL_MAX": 12.0,
}


def acceleration_of(told: Kinematics) -> float | None:
    return None if told.acceleration is None else told.acceleration.value


# -- what parameters say ------------------------------------------------------------------


def test_parameters_mean_the_same_under_their_new_and_their_old_names() -> None:
    new, old = arducopter_kinematics(NEW), arducopter_kinematics(OLD)
    for told in (new, old):
        assert acceleration_of(told) == 1.5
        assert told.jerk_m_s3 == 5.0
        assert told.speed is None
        assert told.absurd == ()
    assert new.leg_acceleration_m_s2(8.0) == old.leg_acceleration_m_s2(8.0)
    assert {"WP_ACC", "WPNAV_ACCEL"} <= {each.name for each in ArduCopter.limit_parameters}


def test_what_is_not_told_is_not_known() -> None:
    for told in (arducopter_kinematics({}), px4_kinematics({})):
        assert told.acceleration is None
        assert told.speed is None
        assert told.jerk_m_s3 is None
        assert told.leg_acceleration_m_s2(8.0) is None
    only = px4_kinematics({"MPC_ACC_HOR": 3.0})
    assert only.leg_acceleration_m_s2(8.0) == 3.0


@pytest.mark.parametrize("value", [-1.0, 0.01, math.nan, math.inf, -math.inf])
def test_absurd_values_are_dropped_and_named(value: float) -> None:
    told = px4_kinematics({**PX4, "MPC_ACC_HOR": value, "MPC_XY_VEL_MAX": value})
    assert told.acceleration is told.speed is None
    assert [each.name for each in told.absurd] == ["MPC_ACC_HOR", "MPC_XY_VEL_MAX"]


def test_an_arducopter_without_an_acceleration_flies_by_its_default() -> None:
    assert acceleration_of(arducopter_kinematics({**NEW, "WP_ACC": 0.0})) == 2.5
    assert acceleration_of(arducopter_kinematics({**OLD, "WPNAV_ACCEL": 0.0})) == 2.5


def test_an_acceleration_without_end_is_no_limit_and_a_small_angle_of_lean_is_one() -> None:
    upright = {"ATC_ANGLE_MAX": 80.0}
    assert acceleration_of(arducopter_kinematics({**NEW, **upright, "WP_ACC": 1e6})) is None
    leaning = arducopter_kinematics({**NEW, "ATC_ANGLE_MAX": 5.0}).acceleration
    assert leaning is not None
    assert leaning.name == "ATC_ANGLE_MAX"
    assert leaning.value == pytest.approx(9.80665 * math.tan(math.radians(5.0)))


# -- what the jerk costs ------------------------------------------------------------------


@pytest.mark.parametrize(("a_m_s2", "j_m_s3"), [(3.0, 20.0), (3.0, 4.0), (2.0, 10.0), (5.0, 20.0)])
def test_the_cost_of_jerk_is_that_of_the_firmwares_way_to_brake(
    a_m_s2: float, j_m_s3: float
) -> None:
    """Flown step by step: a ramp with jerk, then the speed that PX4 allows at each distance."""
    cruise_m_s, length_m, step_s = 8.0, 400.0, 1e-3
    b = 4.0 * a_m_s2**2 / j_m_s3
    flown_m = speed_m_s = change_m_s2 = time_s = 0.0
    while True:
        left_m = length_m - flown_m
        allowed_m_s = 0.5 * (math.sqrt(b * b + 8.0 * a_m_s2 * left_m) - b)
        if allowed_m_s < 0.5:
            break
        if speed_m_s < min(allowed_m_s, cruise_m_s) and flown_m < 0.5 * length_m:
            rest_m_s = cruise_m_s - speed_m_s
            easing = change_m_s2**2 / (2.0 * j_m_s3) >= rest_m_s
            change_m_s2 += (-j_m_s3 if easing else j_m_s3) * step_s
            change_m_s2 = min(a_m_s2, max(change_m_s2, 0.0))
            speed_m_s += change_m_s2 * step_s
        speed_m_s = min(speed_m_s, allowed_m_s, cruise_m_s)
        flown_m += speed_m_s * step_s
        time_s += step_s
    # Braking with a all along it would be as slow at d/v + v/a less the rest of that.
    ideal_s = length_m / cruise_m_s + (cruise_m_s - 0.5) / a_m_s2
    assert px4_jerk_s(cruise_m_s, a_m_s2, j_m_s3) == pytest.approx(time_s - ideal_s, abs=0.02)


def test_legs_take_as_long_with_the_acceleration_that_is_told_as_with_jerk() -> None:
    told = px4_kinematics(PX4).leg_acceleration_m_s2(8.0)
    assert told is not None
    assert 8.0 / told == pytest.approx(8.0 / 3.0 + px4_jerk_s(8.0, 3.0, 20.0))
    copter = arducopter_kinematics(NEW).leg_acceleration_m_s2(8.0)
    assert copter is not None
    assert 8.0 / copter == pytest.approx(8.0 / 1.5 + arducopter_jerk_s(8.0, 1.5, 5.0))


def test_a_limit_of_jerk_that_is_raised_in_flight_counts_as_raised() -> None:
    for found in (4.0, 20.004):  # its own one, and what an earlier life has set
        values = {**PX4, "MPC_JERK_AUTO": found}
        kept, raised = (
            LimitsReading(Px4Copter(), spec) for spec in (None, Px4Copter.override_spec)
        )
        for reading in (kept, raised):
            for name, value in values.items():
                reading.on_message(ParameterValue(name, value))
            assert reading.unread == ()
        assert kept.kinematics.jerk_m_s3 == found
        assert raised.kinematics.jerk_m_s3 == pytest.approx(20.004)


def test_a_name_is_asked_for_until_the_parameter_is_told_or_denied() -> None:
    reading = LimitsReading(ArduCopter(), None)
    assert set(reading.unread) == {each.name for each in ArduCopter.limit_parameters}
    reading.on_message(ParameterValue("WPNAV_ACCEL", 250.0))
    assert not {"WP_ACC", "WPNAV_ACCEL"} & set(reading.unread)
    reading.on_message(ParameterMissing("ANGLE_MAX"))
    assert "ATC_ANGLE_MAX" in reading.unread
    assert "ANGLE_MAX" not in reading.unread


# -- on a vehicle -------------------------------------------------------------------------


def limits_told(flight: BridgeFlight) -> list[FlightLimits]:
    return [each for each in flight.reports if isinstance(each, FlightLimits)]


@pytest.mark.parametrize("names", [NEW, OLD], ids=["new", "old"])
def test_it_is_told_once_before_the_vehicle_takes_off(names: dict[str, float]) -> None:
    copter = FakeCopter(ORIGIN)
    for name in NEW:
        del copter.parameters[name]
    copter.parameters.update(names)
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(FlightLimits)
    assert not copter.armed
    flight.run_until(VehicleReady())

    told = arducopter_kinematics(names).leg_acceleration_m_s2(START.speed_m_s)
    assert limits_told(flight) == [FlightLimits(told)]
    assert flight.cautions == []


def test_a_vehicle_that_tells_nothing_flies_all_the_same() -> None:
    copter = FakeCopter(ORIGIN)
    for name in NEW:
        del copter.parameters[name]
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(VehicleReady())
    assert limits_told(flight) == []
    assert flight.bridge.absurd_parameters == 0


def test_what_is_known_when_it_takes_off_is_told_though_some_is_never_answered() -> None:
    copter = FakeCopter(ORIGIN)
    del copter.parameters["ATC_ANGLE_MAX"]
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(VehicleReady())
    told = arducopter_kinematics({"WP_ACC": 2.5, "PSC_JERK_NE": 5.0})
    assert limits_told(flight) == [FlightLimits(told.leg_acceleration_m_s2(START.speed_m_s))]


@pytest.mark.parametrize("raises", [True, False])
def test_px4_tells_its_top_speed_and_legs_with_the_jerk_that_it_will_have(raises: bool) -> None:
    config = BridgeConfig(1, ORIGIN, raises_jerk=raises)
    flight = BridgeFlight(FakePx4(ORIGIN), config)
    flight.order(START)
    flight.run_until(VehicleReady())

    jerk_m_s3 = 20.004 if raises else 4.0
    told = px4_kinematics({**PX4, "MPC_JERK_AUTO": jerk_m_s3})
    (limits,) = limits_told(flight)
    assert limits.speed_m_s == 12.0
    assert limits.acceleration_m_s2 == pytest.approx(told.leg_acceleration_m_s2(START.speed_m_s))


@pytest.mark.parametrize(("planned_m_s2", "says"), [(2.3, False), (1.0, True), (5.0, True)])
def test_an_acceleration_other_than_the_missions_is_named(planned_m_s2: float, says: bool) -> None:
    flight = BridgeFlight()
    flight.order(replace(START, acceleration_m_s2=planned_m_s2))
    flight.run_until(VehicleReady())
    remark = f"its WP_ACC is 2.5 m/s², the plan counts on {planned_m_s2:g}"
    assert flight.cautions == [remark] * says


def test_a_speed_that_it_cannot_fly_is_named() -> None:
    copter = FakePx4(ORIGIN)
    copter.parameters["MPC_XY_VEL_MAX"] = 3.0
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(VehicleReady())
    assert flight.cautions == ["its MPC_XY_VEL_MAX is 3 m/s, asked for 4"]
    assert [each.speed_m_s for each in limits_told(flight)] == [3.0]


def test_an_absurd_value_is_named_and_counted() -> None:
    copter = FakeCopter(ORIGIN)
    copter.parameters["WP_ACC"] = -4.0
    flight = BridgeFlight(copter)
    flight.order(START)
    flight.run_until(VehicleReady())
    assert flight.cautions == ["its WP_ACC of -4 is not believed"]
    assert flight.bridge.absurd_parameters == 1
    assert limits_told(flight) == []
