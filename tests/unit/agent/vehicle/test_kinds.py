"""Which firmware drives or flies what, and what each kind of vehicle says of itself."""

from __future__ import annotations

import math

import pytest

from agent.core.interface import Prepare, Runway
from agent.vehicle.firmware import firmware_of, unsupported
from agent.vehicle.firmware.ardupilot import ArduCopter
from agent.vehicle.firmware.arduplane import ArduPlane
from agent.vehicle.firmware.ardurover import ArduRover
from agent.vehicle.firmware.px4 import Px4Copter
from agent.vehicle.firmware.px4_plane import Px4Plane
from agent.vehicle.firmware.quadplane import QuadPlane
from agent.vehicle.landing_pattern import RunwayLanding
from agent.vehicle.messages import AltitudeFrame, Heartbeat, MissionCurrent
from agent.vehicle.preflight import wrong_kind
from swarm.model.frames import Origin
from swarm.model.vehicles import TRAITS, VehicleKind

ARDUPILOT, PX4 = 3, 12
ROVER, PLANE, RUNWAY_PLANE = ArduRover(), QuadPlane(), ArduPlane()
LANDS = {"Q_ENABLE": 0.0, "RTL_AUTOLAND": 2.0, "WP_LOITER_RAD": 60.0}
FINE = {
    "FS_GCS_ENABL": 1.0,
    "FS_LONG_ACTN": 1.0,
    "FS_LONG_TIMEOUT": 5.0,
    "Q_RTL_MODE": 1.0,
    "MAV_GCS_SYSID": 255.0,
    "MAV_GCS_SYSID_HI": 0.0,
    "BATT_FS_LOW_ACT": 1.0,
}


def heartbeat(vehicle_type: int, autopilot: int = ARDUPILOT) -> Heartbeat:
    return Heartbeat(
        autopilot=autopilot,
        vehicle_type=vehicle_type,
        armed=False,
        custom_mode=0,
        system_status=3,
    )


@pytest.mark.parametrize(
    ("vehicle_type", "kind"),
    [
        (2, ArduCopter),
        (10, ArduRover),
        (11, ArduRover),
        (20, QuadPlane),
        (21, QuadPlane),
        (22, QuadPlane),
        (1, ArduPlane),
        (12, None),
    ],
)
def test_ardupilot_is_told_by_its_kind_of_vehicle(vehicle_type: int, kind: type | None) -> None:
    found = firmware_of(heartbeat(vehicle_type))
    assert (None if found is None else type(found)) is kind


@pytest.mark.parametrize(
    ("vehicle_type", "kind"), [(2, Px4Copter), (1, Px4Plane), (10, None), (20, None), (22, None)]
)
def test_px4_is_told_by_its_kind_of_vehicle(vehicle_type: int, kind: type | None) -> None:
    found = firmware_of(heartbeat(vehicle_type, PX4))
    assert (None if found is None else type(found)) is kind


def test_a_plane_that_tells_no_rotors_is_told_what_to_set() -> None:
    told = wrong_kind(Prepare((0.0, 0.0, 30.0), 20.0, vehicle=VehicleKind.QUADPLANE), RUNWAY_PLANE)
    assert told == (
        "the vehicle is a plane, the scenario has a quadplane (if it has rotors, set Q_MAV_TYPE 22)"
    )
    landing = RUNWAY_PLANE.runway_landing({**LANDS, "Q_ENABLE": 1.0})
    assert isinstance(landing, str)
    assert "set Q_MAV_TYPE 22" in landing


def test_what_nobody_flies_is_told() -> None:
    assert unsupported(heartbeat(12)) == (
        "autopilot 3 on vehicle type 12 (MAV_AUTOPILOT, MAV_TYPE) is not supported"
    )


def test_kinds_have_the_traits_that_missions_know() -> None:
    assert (ROVER.kind, PLANE.kind) == (VehicleKind.ROVER, VehicleKind.QUADPLANE)
    assert ROVER.traits is TRAITS[VehicleKind.ROVER]
    assert ROVER.traits.drives
    assert not PLANE.traits.stays


def test_modes_have_the_numbers_of_their_kind() -> None:
    assert [ROVER.mode_name(mode) for mode in (4, 11, 15)] == ["HOLD", "RTL", "GUIDED"]
    assert [PLANE.mode_name(mode) for mode in (15, 20, 21)] == ["GUIDED", "QLAND", "QRTL"]
    assert ROVER.is_commanded(15)
    assert not ROVER.is_commanded(4)
    assert all(PLANE.is_returning(mode) for mode in (11, 20, 21))


def test_a_rover_has_no_takeoff_to_tell() -> None:
    with pytest.raises(ValueError, match="does not take off"):
        ROVER.takeoff(10.0, 0.0)


def test_a_plane_is_told_a_speed_through_the_air() -> None:
    assert PLANE.change_speed(20.0).params[:2] == (0.0, 20.0)
    assert ROVER.change_speed(3.0).params[:2] == (1.0, 3.0)


# -- along a runway --------------------------------------------------------------------


def test_a_plane_lands_as_its_parameters_say() -> None:
    landing = Px4Plane().runway_landing(
        {"RTL_TYPE": 1.0, "FW_LND_ANG": 5.0, "NAV_LOITER_RAD": -80.0}
    )
    assert landing == RunwayLanding(80.0, math.radians(5.0))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, "RTL_TYPE is not known, so it may circle over home for good: set RTL_TYPE 1"),
        ({"RTL_TYPE": 3.0}, "RTL_TYPE is 3, so it may circle"),
        ({"RTL_TYPE": 1.0, "NAV_LOITER_RAD": 80.0}, "FW_LND_ANG is not known"),
        ({"RTL_TYPE": 1.0, "NAV_LOITER_RAD": 80.0, "FW_LND_ANG": 60.0}, "not within 1..15"),
        ({"RTL_TYPE": 1.0, "FW_LND_ANG": 5.0}, "NAV_LOITER_RAD is not known, or 0"),
    ],
)
def test_a_plane_of_which_it_is_not_known_how_it_lands_has_no_landing(
    values: dict[str, float], says: str
) -> None:
    told = Px4Plane().runway_landing(values)
    assert isinstance(told, str)
    assert says in told


def test_what_lands_upright_has_no_runway() -> None:
    assert PLANE.runway_landing(FINE) == "a quadplane lands upright"


def test_a_px4_plane_circles_without_its_agent_unless_it_is_set_to_return() -> None:
    circles = Px4Plane().failsafes({"NAV_DLL_ACT": 0.0, "COM_LOW_BAT_ACT": 3.0}, 255)
    assert circles.agent_lost == "circles (NAV_DLL_ACT is 0)"
    assert Px4Plane().failsafes({"NAV_DLL_ACT": 2.0, "COM_LOW_BAT_ACT": 3.0}, 255).comes_home


def test_a_px4_plane_turns_on_its_circle_and_is_no_faster_than_it_can() -> None:
    limits = Px4Plane().kinematics({"NAV_LOITER_RAD": 80.0, "FW_AIRSPD_MAX": 20.0})
    acceleration_m_s2 = limits.leg_acceleration_m_s2(12.0)
    assert acceleration_m_s2 is not None
    assert 12.0 / acceleration_m_s2 == pytest.approx(80.0 / 12.0)
    assert limits.speed is not None
    assert limits.speed.value == 20.0


def test_an_arduplane_lands_where_its_return_leads_to_that() -> None:
    assert RUNWAY_PLANE.runway_landing(LANDS) == RunwayLanding(60.0, math.radians(5.0))
    assert RUNWAY_PLANE.runway_landing({**LANDS, "RTL_AUTOLAND": 1.0, "WP_LOITER_RAD": -80.0}) == (
        RunwayLanding(80.0, math.radians(5.0))
    )


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({}, "RTL_AUTOLAND is not known, so it may circle over home for good: set RTL_AUTOLAND 2"),
        ({"RTL_AUTOLAND": 0.0}, "RTL_AUTOLAND is 0, so it may circle"),
        ({"RTL_AUTOLAND": 3.0}, "RTL_AUTOLAND is 3, so it may circle"),
        ({"RTL_AUTOLAND": 4.0}, "RTL_AUTOLAND is 4, so it may circle"),
        ({"RTL_AUTOLAND": 2.0}, "WP_LOITER_RAD is not known, or 0"),
    ],
)
def test_an_arduplane_of_which_it_is_not_known_how_it_lands_has_no_landing(
    values: dict[str, float], says: str
) -> None:
    told = RUNWAY_PLANE.runway_landing(values)
    assert isinstance(told, str)
    assert says in told


def test_an_arduplane_takes_off_circles_and_lands_by_one_mission() -> None:
    origin, runway = Origin(48.2, 7.5, 170.0), Runway((10.0, 20.0, 2.0), 0.0)
    landing = RunwayLanding(60.0, math.radians(5.0))
    items = RUNWAY_PLANE.runway_mission(landing, runway, 40.0, origin)
    assert [item.command for item in items] == [16, 22, 19, 189, 31, 16, 21]
    assert [item.seq for item in items] == list(range(7))
    home, take_off, waits, _, circle, _, ground = items
    assert (take_off.lat_deg, take_off.lon_deg) == (0.0, 0.0)  # straight ahead
    assert [take_off.alt_m, waits.alt_m] == pytest.approx([210.0, 210.0])
    assert {item.frame for item in items if item.command != 189} == {AltitudeFrame.MEAN_SEA_LEVEL}
    # As ArduPlane gives them back: of a circle and a landing it keeps no more.
    assert take_off.params == (15.0, 0.0, 0.0, 0.0)
    assert waits.params == (60.0, 0.0, 1.0, 0.0)
    assert circle.params == (0.0, 60.0, 0.0, 1.0)
    assert ground.params == (0.0, 0.0, 0.0, 1.0)
    assert (home.lat_deg, home.lon_deg) == (ground.lat_deg, ground.lon_deg)


@pytest.mark.parametrize(
    ("item", "name"),
    [
        (MissionCurrent(0, 6), "AUTO (taking off)"),
        (MissionCurrent(1, 6), "AUTO (taking off)"),
        (MissionCurrent(2, 6), "AUTO (after its take-off)"),
        (MissionCurrent(3, 6), "AUTO (landing)"),
        (MissionCurrent(6), "AUTO (landing)"),
        (MissionCurrent(6, 9), "AUTO"),
        (None, "AUTO"),
    ],
)
def test_auto_is_told_by_what_it_flies_of_which_mission(
    item: MissionCurrent | None, name: str
) -> None:
    told = RUNWAY_PLANE.told_mode(10, item)
    assert RUNWAY_PLANE.mode_name(told) == name
    assert RUNWAY_PLANE.is_returning(told) is (name == "AUTO (landing)")
    assert RUNWAY_PLANE.is_taking_off(told) is (item is None or "off" in name)
    assert RUNWAY_PLANE.has_taken_off(told) is ("after" in name)
    assert RUNWAY_PLANE.must_rise(told) is ("taking" in name)
    assert not RUNWAY_PLANE.is_commanded(told)


def test_other_modes_are_told_by_their_numbers_whatever_bits_stand_above() -> None:
    assert RUNWAY_PLANE.told_mode(15, MissionCurrent(3, 6)) == 15
    assert RUNWAY_PLANE.told_mode(11 | 3 << 24, None) == 11
    assert RUNWAY_PLANE.is_commanded(15)
    assert RUNWAY_PLANE.is_returning(11)


def test_an_arduplane_comes_home_where_all_is_set() -> None:
    told = RUNWAY_PLANE.failsafes({k: v for k, v in FINE.items() if k != "Q_RTL_MODE"}, 255)
    assert told.comes_home
    assert told.agent_lost == "returns after 5 s"
    assert RUNWAY_PLANE.failsafes({**FINE, "FS_LONG_ACTN": 0.0}, 255).remedy == "set FS_LONG_ACTN 1"


# -- without an agent ------------------------------------------------------------------


def test_a_rover_stands_where_it_was_sent_whatever_is_set() -> None:
    told = ROVER.failsafes({"BATT_FS_LOW_ACT": 2.0}, 255)
    assert told.comes_home
    assert told.battery is None
    assert ROVER.failsafes({}, 255).battery is not None


def test_a_plane_comes_home_where_all_is_set() -> None:
    told = PLANE.failsafes(FINE, 255)
    assert told.comes_home
    assert told.agent_lost == "returns after 5 s"


@pytest.mark.parametrize(
    ("name", "value", "remedy"),
    [
        ("FS_GCS_ENABL", 0.0, "set FS_GCS_ENABL 1"),
        ("FS_GCS_ENABL", 3.0, "set FS_GCS_ENABL 1"),
        ("FS_LONG_ACTN", 0.0, "set FS_LONG_ACTN 1"),
        ("Q_RTL_MODE", 0.0, "set Q_RTL_MODE 1"),
        ("MAV_GCS_SYSID", 7.0, "set MAV_GCS_SYSID 255"),
        ("FS_LONG_ACTN", None, "set FS_LONG_ACTN 1"),
    ],
)
def test_a_plane_circles_where_one_of_them_is_not(
    name: str, value: float | None, remedy: str
) -> None:
    values = {key: each for key, each in FINE.items() if key != name}
    if value is not None:
        values[name] = value
    told = PLANE.failsafes(values, 255)
    assert not told.comes_home
    assert told.remedy == remedy
    assert "circle" in told.agent_lost


# -- how long legs take ----------------------------------------------------------------


def test_a_rover_speeds_up_by_the_least_of_its_limits_and_an_s_curve() -> None:
    limits = ROVER.kinematics({"WP_ACCEL": 0.0, "ATC_ACCEL_MAX": 1.0, "WP_JERK": 0.0})
    assert limits.acceleration is not None
    assert (limits.acceleration.name, limits.acceleration.value) == ("ATC_ACCEL_MAX", 1.0)
    acceleration_m_s2 = limits.leg_acceleration_m_s2(3.0)
    assert acceleration_m_s2 is not None
    assert 3.0 / acceleration_m_s2 == pytest.approx(3.0 / 1.0 + 1.0 / 1.0)

    slower = ROVER.kinematics({"WP_ACCEL": 0.5, "ATC_ACCEL_MAX": 1.0, "WP_JERK": 2.0})
    acceleration_m_s2 = slower.leg_acceleration_m_s2(3.0)
    assert acceleration_m_s2 is not None
    assert 3.0 / acceleration_m_s2 == pytest.approx(3.0 / 0.5 + 0.5 / 2.0)


def test_a_rover_that_tells_nothing_has_no_limit() -> None:
    assert ROVER.kinematics({}).leg_acceleration_m_s2(3.0) is None


@pytest.mark.parametrize("radius_m", [60.0, -60.0])
def test_a_plane_turns_on_its_circle(radius_m: float) -> None:
    limits = PLANE.kinematics({"WP_LOITER_RAD": radius_m})
    acceleration_m_s2 = limits.leg_acceleration_m_s2(20.0)
    assert acceleration_m_s2 is not None
    assert 20.0 / acceleration_m_s2 == pytest.approx(60.0 / 20.0)


def test_a_circle_that_nobody_would_believe_is_named() -> None:
    limits = PLANE.kinematics({"WP_LOITER_RAD": 0.0})
    assert limits.circle is None
    assert [each.name for each in limits.absurd] == ["WP_LOITER_RAD"]
    assert math.isfinite(limits.absurd[0].value)
