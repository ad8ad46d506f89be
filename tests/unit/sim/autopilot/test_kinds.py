"""Simulated rovers and QuadPlanes say and refuse what ArduPilot's code of theirs does."""

from __future__ import annotations

import itertools
import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from agent.core.interface import Runway
from agent.vehicle.firmware.arduplane import ArduPlane
from agent.vehicle.landing_pattern import RunwayLanding
from sim.autopilot.config import VehicleConfig, fleet_of
from sim.autopilot.firmware import SIMULATED, FirmwareModelName, check_simulated, firmware_model
from sim.autopilot.flight import FlightMode
from sim.autopilot.mission_item import StoredMissionItem
from swarm.model.vehicles import VehicleKind
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.support.ground_station import GroundStation, ground_station, only

ROVER, PLANE = VehicleKind.ROVER, VehicleKind.QUADPLANE
AUTO, GUIDED, HOLD, RTL, QRTL = 10, 15, 4, 11, 21
EXTENDED, HEARTBEAT = mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, mavlink.MAVLINK_MSG_ID_HEARTBEAT
ACCEPTED, UNSUPPORTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_UNSUPPORTED


def station(kind: VehicleKind) -> GroundStation:
    """With a vehicle that is ready."""
    flavour = firmware_model(FirmwareModelName.ARDUPILOT, kind)
    circle_m = 60.0 if kind is PLANE else None
    station = ground_station(flavour, vehicle=kind, circle_m=circle_m, cruise_m_s=10.0)
    station.wait(5.0)
    return station


def armed(kind: VehicleKind) -> GroundStation:
    """Armed, in GUIDED."""
    found = station(kind)
    assert found.set_mode(GUIDED) == ACCEPTED
    assert found.arm() == ACCEPTED
    return found


def landed_state(station: GroundStation) -> int:
    station.command(mavlink.MAV_CMD_REQUEST_MESSAGE, EXTENDED)
    return int(only(station.heard, "EXTENDED_SYS_STATE")[-1].landed_state)


@pytest.mark.parametrize(("kind", "vehicle_type"), [(ROVER, 10), (PLANE, 22)])
def test_it_says_what_it_is(kind: VehicleKind, vehicle_type: int) -> None:
    said = only(station(kind).heard, "HEARTBEAT")
    assert {beat.type for beat in said} == {vehicle_type}


def test_a_rover_has_no_landed_state_and_no_takeoff() -> None:
    rover = armed(ROVER)
    assert landed_state(rover) == mavlink.MAV_LANDED_STATE_UNDEFINED
    assert rover.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 10.0) == UNSUPPORTED


def test_a_rover_stands_by_in_hold_alone() -> None:
    rover = station(ROVER)
    assert only(rover.heard, "HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_ACTIVE
    assert rover.set_mode(HOLD) == ACCEPTED
    rover.wait(1.1)
    assert only(rover.heard, "HEARTBEAT")[-1].system_status == mavlink.MAV_STATE_STANDBY


def test_a_rover_drives_on_the_ground_and_stays_armed_at_home() -> None:
    rover = armed(ROVER)
    rover.wait(30.0)
    assert rover.vehicle.pilot.armed  # nothing disarms it
    assert rover.reposition(50.0, 0.0, 30.0) == ACCEPTED
    rover.wait(6.0)
    assert rover.position_enu_m == pytest.approx((50.0, 0.0, 0.0), abs=0.02)
    assert rover.set_mode(RTL) == ACCEPTED
    rover.wait(20.0)
    assert rover.position_enu_m == pytest.approx((0.0, 0.0, 0.0), abs=0.02)
    assert rover.vehicle.pilot.armed
    assert rover.vehicle.pilot.mode is FlightMode.RTL


def test_a_rover_is_disarmed_under_way_and_stands() -> None:
    rover = armed(ROVER)
    rover.reposition(50.0, 0.0, 0.0)
    rover.wait(2.0)
    assert rover.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0) == ACCEPTED
    here_m = rover.position_enu_m
    rover.wait(9.0)
    assert rover.position_enu_m == here_m
    assert here_m[2] == 0.0


def test_a_plane_rises_circles_and_lands_upright_at_home() -> None:
    plane = armed(PLANE)
    assert plane.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, 20.0) == ACCEPTED
    plane.wait(9.0)
    assert plane.position_enu_m == pytest.approx((0.0, 0.0, 20.0))
    assert landed_state(plane) == mavlink.MAV_LANDED_STATE_IN_AIR
    plane.reposition(300.0, 0.0, 20.0)
    for _ in range(4):
        plane.wait(35.0)
        assert math.dist(plane.position_enu_m[:2], (300.0, 0.0)) == pytest.approx(60.0, abs=0.02)
    assert plane.set_mode(QRTL) == ACCEPTED
    plane.wait(90.0)
    assert plane.position_enu_m == pytest.approx((0.0, 0.0, 0.0))
    assert not plane.vehicle.pilot.armed


@pytest.mark.parametrize(
    ("kind", "has", "lacks"),
    [
        (ROVER, {"WP_SPEED", "WP_ACCEL", "ATC_ACCEL_MAX", "FS_ACTION"}, {"WP_SPD", "RTL_ALT_M"}),
        (PLANE, {"WP_LOITER_RAD", "Q_RTL_MODE", "FS_LONG_ACTN"}, {"FS_GCS_ENABLE", "WP_SPD"}),
    ],
)
def test_its_parameters_have_the_names_of_its_kind(
    kind: VehicleKind, has: set[str], lacks: set[str]
) -> None:
    config = VehicleConfig(1, vehicle=kind, circle_m=60.0 if kind is PLANE else None)
    names = {
        each.name for each in firmware_model(FirmwareModelName.ARDUPILOT, kind).parameters(config)
    }
    assert has <= names
    assert not lacks & names


def test_only_what_cannot_stay_has_a_circle_and_flies_in_still_air() -> None:
    with pytest.raises(ValueError, match="has a circle only where it cannot stay"):
        VehicleConfig(1, circle_m=60.0)
    with pytest.raises(ValueError, match="has a circle only where it cannot stay"):
        VehicleConfig(1, vehicle=PLANE)


def test_vehicles_of_a_fleet_are_what_the_scenario_says() -> None:
    fleet = fleet_of(load_scenario(resolve_scenario("roundup")))
    assert [each.config.vehicle for each in fleet] == [VehicleKind.COPTER, ROVER, PLANE]
    assert [each.config.circle_m for each in fleet][:2] == [None, None]
    assert fleet[2].config.circle_m == pytest.approx(60.0)
    assert fleet[2].config.acceleration_m_s2 is None


def test_a_plane_on_a_strip_stands_in_the_direction_of_its_landing() -> None:
    fleet = fleet_of(load_scenario(resolve_scenario("airstrip")))
    assert [each.config.vehicle for each in fleet] == [VehicleKind.COPTER, VehicleKind.PLANE]
    assert fleet[1].config.heading_rad == 0.0


def test_each_kind_is_simulated_with_some_firmware() -> None:
    assert SIMULATED[FirmwareModelName.PX4] == {VehicleKind.COPTER, VehicleKind.PLANE}
    assert frozenset().union(*SIMULATED.values()) == frozenset(VehicleKind)
    assert SIMULATED[FirmwareModelName.ARDUPILOT] == frozenset(VehicleKind)
    with pytest.raises(ValueError, match="no rover is simulated with px4"):
        firmware_model(FirmwareModelName.PX4, ROVER)
    with pytest.raises(InputError, match="--flavour: px4: no quadplane is simulated"):
        check_simulated(FirmwareModelName.PX4, [VehicleKind.COPTER, PLANE], "--flavour")


# -- a plane that needs a runway --------------------------------------------------------


def plane_on_a_strip(**more: float) -> GroundStation:
    flavour = firmware_model(FirmwareModelName.PX4, VehicleKind.PLANE)
    found = ground_station(
        flavour, vehicle=VehicleKind.PLANE, circle_m=80.0, cruise_m_s=12.0, **more
    )
    found.wait(12.0)
    return found


def test_a_plane_says_that_it_is_one() -> None:
    plane = plane_on_a_strip()
    assert {beat.type for beat in only(plane.heard, "HEARTBEAT")} == {1}


def test_its_parameters_are_those_of_planes_in_their_order() -> None:
    config = VehicleConfig(1, vehicle=VehicleKind.PLANE, circle_m=80.0)
    names = [
        each.name
        for each in firmware_model(FirmwareModelName.PX4, VehicleKind.PLANE).parameters(config)
    ]
    assert names == sorted(names)
    assert {"FW_AIRSPD_TRIM", "NAV_LOITER_RAD", "RTL_TYPE", "FW_LND_ANG"} <= set(names)
    assert not [name for name in names if name.startswith("MPC_")]


def test_without_a_landing_it_circles_over_home_for_good() -> None:
    plane = plane_on_a_strip()
    pilot = plane.vehicle.pilot
    assert pilot.arm(plane.now_s, forced=False)
    assert pilot.take_off(40.0, plane.now_s)
    plane.wait(60.0)
    assert pilot.mode is FlightMode.LOITER
    pilot.set_mode(FlightMode.RTL, plane.now_s)
    plane.wait(300.0)
    assert pilot.armed
    home_enu_m, place_enu_m = pilot.flight.home_enu_m, pilot.position_enu_m(plane.now_s)
    assert math.dist(home_enu_m[:2], place_enu_m[:2]) == pytest.approx(80.0, abs=0.1)
    assert place_enu_m[2] == pytest.approx(100.0)


def test_it_lands_where_it_is_round_a_circle() -> None:
    plane = plane_on_a_strip()
    pilot = plane.vehicle.pilot
    assert pilot.arm(plane.now_s, forced=False)
    assert pilot.take_off(40.0, plane.now_s)
    plane.wait(60.0)
    here_enu_m = pilot.position_enu_m(plane.now_s)
    pilot.set_mode(FlightMode.LAND, plane.now_s)
    plane.wait(90.0)
    assert not pilot.armed
    lies_enu_m = pilot.position_enu_m(plane.now_s)
    assert lies_enu_m[2] == pytest.approx(0.0, abs=1e-6)
    assert math.dist(here_enu_m[:2], lies_enu_m[:2]) <= 160.0


# -- ArduPlane on a runway ----------------------------------------------------------------


def arduplane() -> GroundStation:
    """With its mission on it, in GUIDED."""
    flavour = firmware_model(FirmwareModelName.ARDUPILOT, VehicleKind.PLANE)
    plane = ground_station(flavour, vehicle=VehicleKind.PLANE, circle_m=80.0, cruise_m_s=12.0)
    plane.wait(12.0)
    runway, landing = Runway((0.0, 0.0, 0.0), 0.0), RunwayLanding(80.0, math.radians(5.0))
    plane.vehicle.pilot.store.items = tuple(
        StoredMissionItem(
            mavlink.MAV_FRAME_GLOBAL,
            item.command,
            item.params,
            round(item.lat_deg * 1e7),
            round(item.lon_deg * 1e7),
            item.alt_m,
        )
        for item in ArduPlane().runway_mission(landing, runway, 40.0, plane.vehicle.config.origin)
    )
    assert plane.set_mode(GUIDED) == ACCEPTED
    return plane


def items_told(plane: GroundStation, duration_s: float) -> list[int]:
    """The items that it flew meanwhile, looked at each second."""
    told = []
    for _ in range(round(duration_s)):
        plane.wait(1.0)
        told.append(plane.vehicle.pilot.run.told)
    return [seq for seq, _ in itertools.groupby(told)]


def test_arduplane_takes_off_waits_and_lands_by_its_mission() -> None:
    plane = arduplane()
    pilot = plane.vehicle.pilot
    assert plane.arm() == ACCEPTED
    plane.wait(5.0)
    assert pilot.flight.on_ground  # GUIDED does not start it
    assert plane.set_mode(AUTO) == ACCEPTED
    assert items_told(plane, 400.0) == [1, 2, 4, 6, 0]
    assert not pilot.armed
    assert math.dist(pilot.position_enu_m(plane.now_s), (0.0, 0.0, 0.0)) <= 0.1


@pytest.mark.parametrize(("autoland", "mode"), [(0.0, FlightMode.RTL), (2.0, FlightMode.AUTO)])
def test_its_return_leads_to_the_landing_where_it_is_set_so(
    autoland: float, mode: FlightMode
) -> None:
    plane = arduplane()
    pilot = plane.vehicle.pilot
    pilot.parameters.write("RTL_AUTOLAND", autoland)
    assert plane.arm() == ACCEPTED
    assert plane.set_mode(AUTO) == ACCEPTED
    plane.wait(30.0)
    assert plane.set_mode(RTL) == ACCEPTED
    plane.wait(1.1)
    assert pilot.mode is mode
    plane.wait(400.0)
    assert pilot.armed is (mode is FlightMode.RTL)


def test_arduplane_has_the_parameters_of_planes() -> None:
    config = VehicleConfig(1, vehicle=VehicleKind.PLANE, circle_m=80.0)
    flavour = firmware_model(FirmwareModelName.ARDUPILOT, VehicleKind.PLANE)
    names = [each.name for each in flavour.parameters(config)]
    assert len(names) == len(set(names))
    assert set(ArduPlane.landing_names) <= set(names)
    assert not [name for name in names if name.startswith("Q_") and name != "Q_ENABLE"]
