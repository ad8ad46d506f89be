"""Flights with limited acceleration, wind and gusts, and how they are asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.vehicle.firmware.kinematics import arducopter_kinematics, px4_kinematics
from sim.autopilot.config import BatteryFailsafe, Physics, VehicleConfig, fleet_of
from sim.autopilot.faults import FaultKind, VehicleFault
from sim.autopilot.firmware.ardupilot import ArduCopterModel
from sim.autopilot.firmware.px4 import Px4Model
from sim.autopilot.options import check_wind, faults_by_uav, parse_wind, require_finite
from sim.world.wind import Wind, gusts_of
from swarm.model import UavId
from swarm.runtime.errors import InputError
from tests.support.ground_station import ACCEPTED, AUTO, RTL, GroundStation, ground_station, only
from tests.unit.sim.autopilot.test_fleet import mission

GUSTY = Wind((3.0, -2.0), gusts_of(4.0, np.random.default_rng(7)))


def real() -> GroundStation:
    return ground_station(acceleration_m_s2=2.5, wind=GUSTY)


def test_vehicle_in_wind_takes_off_reaches_its_target_returns_and_lands_at_home() -> None:
    ground = real()
    ground.take_off(10.0)
    ground.wait(5.0)
    assert math.dist(ground.position_enu_m, (0.0, 0.0, 10.0)) < 1.0
    ground.reposition(0.0, 80.0, 12.0)
    ground.wait(25.0)
    assert math.dist(ground.position_enu_m, (0.0, 80.0, 12.0)) < 1.0
    assert ground.set_mode(RTL) == ACCEPTED
    ground.wait(60.0)

    assert math.dist(ground.position_enu_m, (0.0, 0.0, 0.0)) < 0.02
    assert not ground.vehicle.pilot.armed


def test_mission_is_flown_item_by_item_with_limited_acceleration() -> None:
    ground = real()
    ground.take_off(10.0)
    take_off = ground.item(1, command=mavlink.MAV_CMD_NAV_TAKEOFF, height_m=12.0)
    assert (
        ground.upload(ground.item(0), take_off, ground.item(2, 0.0, 40.0), ground.item(3, 30.0))
        == 0
    )
    assert ground.set_mode(AUTO) == ACCEPTED
    ground.wait(40.0)

    assert [message.seq for message in only(ground.heard, "MISSION_ITEM_REACHED")] == [1, 2, 3]


def test_return_in_full_flight_first_brakes_and_climbs() -> None:
    ground = ground_station(acceleration_m_s2=2.0)
    ground.take_off(10.0)
    ground.reposition(0.0, 500.0, 10.0)
    ground.wait(20.0)
    _, north_m, _ = ground.position_enu_m
    ground.set_mode(RTL)
    assert ground.vehicle.pilot.flight.motion.target_enu_m == pytest.approx(
        (0.0, north_m + 25.0, 15.0), abs=0.01
    )
    ground.wait(150.0)
    assert math.dist(ground.position_enu_m, (0.0, 0.0, 0.0)) < 0.02


def test_flight_does_not_depend_on_how_often_the_vehicle_is_called() -> None:
    often, seldom = real(), real()
    for ground in (often, seldom):
        ground.take_off(10.0)
        ground.reposition(0.0, 40.0, 10.0)
        ground.set_mode(RTL)
    for _ in range(300):
        often.wait(0.1)
    seldom.wait(30.0)

    assert often.position_enu_m == pytest.approx(seldom.position_enu_m, abs=1e-6)


def test_vehicle_that_cannot_fly_against_the_wind_is_refused() -> None:
    with pytest.raises(ValueError, match="wind of 15 m/s is too much"):
        VehicleConfig(system_id=1, cruise_m_s=10.0, wind=Wind((9.0, 12.0)))


def test_fleet_has_the_physics_asked_for() -> None:
    physics = Physics(
        acceleration_m_s2=2.0,
        wind_enu_m_s=(1.0, 2.0),
        gust_m_s=3.0,
        seed=5,
        endurance_s=600.0,
        battery_failsafe=BatteryFailsafe(),
        position_failsafe_s=4.0,
    )
    first, second, _ = (member.config for member in fleet_of(mission(), physics=physics))

    assert (first.acceleration_m_s2, first.endurance_s) == (2.0, 600.0)
    assert (first.battery_failsafe, first.position_failsafe_s) == (BatteryFailsafe(), 4.0)
    assert first.wind is not None
    assert second.wind is not None
    assert first.wind.velocity_enu_m_s == (1.0, 2.0)
    assert first.wind.gusts != second.wind.gusts


def test_uav_has_the_same_gusts_whoever_else_is_simulated_with_it() -> None:
    physics = Physics(gust_m_s=3.0, seed=5)
    alone = fleet_of(mission(), [UavId("uav1")], physics=physics)

    assert alone[0].config.wind == fleet_of(mission(), physics=physics)[1].config.wind


def test_fleet_is_ideal_unless_told_otherwise() -> None:
    config = fleet_of(mission())[0].config

    assert (config.acceleration_m_s2, config.wind, config.endurance_s) == (None, None, None)
    assert config.battery_failsafe is None


def test_wind_is_read() -> None:
    assert parse_wind("3,-1.5") == (3.0, -1.5)
    assert parse_wind(None) == (0.0, 0.0)


@pytest.mark.parametrize("text", ["", "3", "1,2,3", "a,b", "nan,0", "0,inf"])
def test_wrong_wind_says_what_would_be_right(text: str) -> None:
    with pytest.raises(InputError, match="write EAST,NORTH"):
        parse_wind(text)


def test_wind_too_strong_for_some_names_them() -> None:
    fleet = fleet_of(mission())  # cruising at 4, 5, 6 m/s
    check_wind(5.9, fleet)

    with pytest.raises(InputError) as caught:
        check_wind(8.0, fleet)
    assert [fault.place for fault in caught.value.faults] == ["uav0", "uav1"]


def test_numbers_must_be_finite() -> None:
    require_finite(endurance_s=3.0, gust_m_s=None)

    with pytest.raises(InputError, match="--endurance-s: inf is no number"):
        require_finite(endurance_s=math.inf)


def test_faults_go_to_their_uavs() -> None:
    found = faults_by_uav(["uav1:silent@3+2", "uav2:stuck@1", "uav1:reboot@9"], ["uav1", "uav2"])

    assert found == {
        "uav1": (VehicleFault(FaultKind.SILENT, 3.0, 2.0), VehicleFault(FaultKind.REBOOT, 9.0)),
        "uav2": (VehicleFault(FaultKind.STUCK, 1.0),),
    }


def test_every_wrong_fault_is_told() -> None:
    with pytest.raises(InputError) as caught:
        faults_by_uav(["uav1:silent", "uav9:stuck@1", "uav1:stuck@1"], ["uav1"])

    lines = [str(fault) for fault in caught.value.faults]
    assert lines[0].startswith("--fault: uav1:silent: no fault; write UAV:KIND@T")
    assert lines[1].startswith("--fault: uav9:stuck@1: no UAV 'uav9'; did you mean 'uav1'? ")


# -- limits that are parameters -----------------------------------------------------------

NAMES = {
    "new": (ArduCopterModel(), "WP_ACC", 1.0, "PSC_JERK_NE"),
    "old": (ArduCopterModel(old_names=True), "WPNAV_ACCEL", 100.0, "PSC_JERK_XY"),
    "px4": (Px4Model(), "MPC_ACC_HOR", 1.0, "MPC_JERK_AUTO"),
}
"""Flavour, its acceleration with the unit, and its jerk."""


def leg_s(ground: GroundStation) -> float:
    """How long it flies to a place 80 m away, from rest to rest at 8 m/s."""
    motion = ground.vehicle.pilot.flight.motion
    ground.vehicle.pilot.flight.navigate((80.0, 0.0, 0.0), 100.0, 8.0)
    assert motion.arrives_s is not None
    return motion.arrives_s - 100.0


@pytest.mark.parametrize("which", NAMES)
def test_acceleration_and_jerk_are_those_of_the_parameters(which: str) -> None:
    flavour, acceleration, unit, jerk = NAMES[which]
    as_made, slower, smoother = (ground_station(flavour, acceleration_m_s2=2.5) for _ in range(3))
    assert as_made.vehicle.pilot.parameters.value(acceleration) == 2.5 * unit
    assert leg_s(as_made) == pytest.approx(80.0 / 8.0 + 8.0 / 2.5)

    set_real(slower, acceleration, 2.0 * unit)
    assert leg_s(slower) == pytest.approx(80.0 / 8.0 + 8.0 / 2.0)

    set_real(smoother, jerk, 10.0)
    costs_s = flavour.jerk_cost_s(8.0, 2.5, 10.0)
    assert costs_s > 0.05
    assert leg_s(smoother) == pytest.approx(80.0 / 8.0 + 8.0 / 2.5 + costs_s)


@pytest.mark.parametrize("which", NAMES)
def test_a_vehicle_whose_speed_changes_at_once_says_so_and_keeps_it(which: str) -> None:
    flavour, acceleration, unit, _ = NAMES[which]
    ground = ground_station(flavour)
    set_real(ground, acceleration, 2.0 * unit)
    values = {each.name: each.value for each in ground.vehicle.pilot.parameters}
    told = (px4_kinematics if which == "px4" else arducopter_kinematics)(values)
    assert told.acceleration is None
    assert told.absurd == ()
    assert leg_s(ground) == pytest.approx(10.0)


def test_px4_flies_no_faster_than_its_greatest_speed() -> None:
    ground = ground_station(Px4Model(), acceleration_m_s2=4.0)
    set_real(ground, "MPC_XY_VEL_MAX", 4.0)
    assert leg_s(ground) == pytest.approx(80.0 / 4.0 + 4.0 / 4.0)


def set_real(ground: GroundStation, name: str, value: float) -> None:
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    ground.send(mavlink.MAVLink_param_set_message(1, 1, name.encode(), value, kind))
