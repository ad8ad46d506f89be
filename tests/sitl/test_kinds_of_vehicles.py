"""A rover, a QuadPlane and a plane behind the bridge, and in fleets with a copter.

In exact virtual time with the simulated autopilots; and whole runs of `roundup` and `airstrip`, in
which real firmware drives and flies where SWARM_SITL_ARDUCOPTER, SWARM_SITL_ROVER and
SWARM_SITL_PLANE, or SWARM_SITL_PX4, say where it is, else the simulated autopilots.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from agent.core.interface import (
    Arrived,
    GoTo,
    HandedOver,
    Held,
    Hold,
    Home,
    Landed,
    MotorsRun,
    Prepare,
    Refused,
    Return,
    ReturnBegun,
    Runway,
    Swap,
    Swapped,
    VehicleReady,
)
from agent.vehicle.config import CommandStyle
from sim.autopilot.config import ServedBase
from sim.autopilot.firmware import FirmwareModelName, firmware_model
from sim.autopilot.flight import FlightMode
from sim.fleet.ardupilot_vehicles import ARDUPILOT_VEHICLES
from sim.fleet.firmware import FirmwareKind
from swarm.model.vehicles import VehicleKind
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.process.mission import SwarmRun
from tests.process.pace import pace
from tests.sitl.test_bridge_autopilot import CONFIG, HOME_M, VEHICLE, JoinedFlight

pytestmark = pytest.mark.sitl

CIRCLE_M, ON_CIRCLE_M = 60.0, 60.0 * 1.15 + 0.1
EASTWARDS_RAD = math.pi / 2.0
ARDUPILOT, PX4 = FirmwareModelName.ARDUPILOT, FirmwareModelName.PX4
VEHICLES = {
    VehicleKind.ROVER: replace(VEHICLE, vehicle=VehicleKind.ROVER, acceleration_m_s2=1.0),
    VehicleKind.QUADPLANE: replace(VEHICLE, vehicle=VehicleKind.QUADPLANE, circle_m=CIRCLE_M),
    VehicleKind.PLANE: replace(
        VEHICLE,
        vehicle=VehicleKind.PLANE,
        cruise_m_s=20.0,
        circle_m=CIRCLE_M,
        heading_rad=EASTWARDS_RAD,
    ),
}
STARTS = {
    VehicleKind.ROVER: Prepare(HOME_M, 4.0, ground_up_m=0.0, vehicle=VehicleKind.ROVER),
    VehicleKind.QUADPLANE: Prepare(
        (*HOME_M[:2], 30.0), 20.0, ground_up_m=0.0, vehicle=VehicleKind.QUADPLANE
    ),
    VehicleKind.PLANE: Prepare(
        (*HOME_M[:2], 30.0),
        20.0,
        ground_up_m=0.0,
        vehicle=VehicleKind.PLANE,
        runway=Runway(HOME_M, EASTWARDS_RAD),
    ),
}
KINDS = pytest.mark.parametrize(
    ("kind", "flavour"),
    [
        (VehicleKind.ROVER, ARDUPILOT),
        (VehicleKind.QUADPLANE, ARDUPILOT),
        (VehicleKind.PLANE, PX4),
        (VehicleKind.PLANE, ARDUPILOT),
    ],
)
PLANES = pytest.mark.parametrize("flavour", [PX4, ARDUPILOT])
FAR = {
    VehicleKind.ROVER: (5.0, 80.0, 0.0),
    VehicleKind.QUADPLANE: (5.0, 900.0, 30.0),
    VehicleKind.PLANE: (5.0, 900.0, 30.0),
}


def joined(kind: VehicleKind, flavour: FirmwareModelName = ARDUPILOT) -> JoinedFlight:
    return JoinedFlight(CONFIG, firmware_model(flavour, kind), VEHICLES[kind])


def started(kind: VehicleKind, flavour: FirmwareModelName = ARDUPILOT) -> JoinedFlight:
    flight = joined(kind, flavour)
    flight.to_bridge(STARTS[kind])
    flight.run_until(VehicleReady())
    return flight


def away_m(flight: JoinedFlight, place: tuple[float, float, float]) -> float:
    return math.dist(flight.vehicle.pilot.position_enu_m(flight.now_s)[:2], place[:2])


def test_a_rover_drives_without_takeoff_or_landing_and_is_disarmed_at_home() -> None:
    flight = started(VehicleKind.ROVER)
    assert flight.now_s < 6.0
    pilot = flight.vehicle.pilot
    for leg, target in enumerate([(5.0, 30.0, 0.0), (30.0, 30.0, 0.0)], start=1):
        flight.to_bridge(GoTo(leg, target))
        flight.run_until(Arrived(leg))
        assert away_m(flight, target) <= 1.0
        flight.wait(20.0)
        assert away_m(flight, target) <= 0.01
    assert {up_m for _, _, up_m in flight.track_enu_m} == {0.0}
    flight.to_bridge(Return("done", via_enu_m=HOME_M))
    flight.run_until(Home())
    assert not pilot.armed
    assert away_m(flight, HOME_M) <= 1.0


def test_a_rover_takes_as_long_as_its_parameters_say() -> None:
    flight = started(VehicleKind.ROVER)
    began_s = flight.now_s
    flight.to_bridge(GoTo(1, (5.0, 80.0, 0.0)))
    arrived_s = flight.run_until(Arrived(1))
    assert arrived_s - began_s == pytest.approx(80.0 / 4.0 + 4.0 / 1.0, abs=0.5)


def test_a_plane_passes_its_target_and_waits_on_a_circle() -> None:
    flight = started(VehicleKind.QUADPLANE)
    for leg, target in enumerate([(5.0, 400.0, 30.0), (700.0, 400.0, 45.0)], start=1):
        began_s, length_m = flight.now_s, away_m(flight, target)
        flight.to_bridge(GoTo(leg, target))
        arrived_s = flight.run_until(Arrived(leg))
        assert arrived_s - began_s <= (length_m + math.pi * CIRCLE_M) / 20.0
        seen = len(flight.track_enu_m)
        flight.wait(40.0)
        assert all(math.dist(at[:2], target[:2]) <= ON_CIRCLE_M for at in flight.track_enu_m[seen:])
        assert flight.track_enu_m[-1][2] == pytest.approx(target[2])
    flight.to_bridge(Return("done", via_enu_m=(*HOME_M[:2], 30.0), land=True))
    flight.run_until(Home())
    assert not flight.vehicle.pilot.armed
    assert away_m(flight, HOME_M) <= 0.01


@KINDS
def test_it_is_stopped_and_goes_on(kind: VehicleKind, flavour: FirmwareModelName) -> None:
    flight = started(kind, flavour)
    flight.to_bridge(GoTo(1, FAR[kind]))
    flight.wait(6.0)
    here_m = flight.vehicle.pilot.position_enu_m(flight.now_s)
    flight.to_bridge(Hold("the operator says so"))
    flight.run_until(Held())
    flight.wait(60.0)
    stays_m = 10.0 if kind is VehicleKind.ROVER else ON_CIRCLE_M
    assert away_m(flight, here_m) <= stays_m
    flight.to_bridge(replace(STARTS[kind], resume=True))
    flight.run_until(VehicleReady())
    flight.to_bridge(GoTo(2, FAR[kind]))
    flight.run_until(Arrived(2))
    assert not any(isinstance(report, HandedOver) for _, report in flight.reports)


@KINDS
def test_killed_on_its_way_and_started_anew_it_goes_on(
    kind: VehicleKind, flavour: FirmwareModelName
) -> None:
    flight = started(kind, flavour)
    flight.to_bridge(GoTo(3, FAR[kind]))
    flight.wait(5.0)
    flight.restart_bridge(dead_s=4.0)
    flight.to_bridge(replace(STARTS[kind], resume=True))
    flight.run_until(VehicleReady())
    flight.to_bridge(GoTo(1, FAR[kind]))
    flight.run_until(Arrived(1))


@pytest.mark.parametrize(
    ("kind", "flavour"),
    [(VehicleKind.QUADPLANE, ARDUPILOT), (VehicleKind.PLANE, PX4), (VehicleKind.PLANE, ARDUPILOT)],
)
def test_started_anew_it_knows_how_wide_its_circle_is(
    kind: VehicleKind, flavour: FirmwareModelName
) -> None:
    wide = replace(VEHICLES[kind], circle_m=2.0 * CIRCLE_M)
    flight = JoinedFlight(CONFIG, firmware_model(flavour, kind), wide)
    flight.to_bridge(STARTS[kind])
    flight.run_until(VehicleReady())
    flight.restart_bridge(dead_s=4.0)
    flight.to_bridge(replace(STARTS[kind], resume=True))
    flight.run_until(VehicleReady())
    flight.to_bridge(GoTo(1, FAR[kind]))
    flight.run_until(Arrived(1))


@KINDS
def test_its_pilot_takes_it_over(kind: VehicleKind, flavour: FirmwareModelName) -> None:
    flight = started(kind, flavour)
    flight.to_bridge(GoTo(1, FAR[kind]))
    flight.wait(3.0)
    flight.vehicle.pilot.set_mode(FlightMode.MANUAL, flight.now_s)
    flight.run_until(HandedOver("its pilot switched it to MANUAL"))


@KINDS
def test_another_kind_than_the_scenarios_is_not_started(
    kind: VehicleKind, flavour: FirmwareModelName
) -> None:
    flight = joined(kind, flavour)
    flight.to_bridge(replace(STARTS[kind], vehicle=VehicleKind.COPTER))
    flight.wait(20.0)
    assert flight.waits_for == f"the vehicle is a {kind}, the scenario has a copter"
    assert not flight.vehicle.pilot.armed


@KINDS
def test_it_is_not_commanded_by_missions(kind: VehicleKind, flavour: FirmwareModelName) -> None:
    config, model = replace(CONFIG, command=CommandStyle.MISSION), firmware_model(flavour, kind)
    flight = JoinedFlight(config, model, VEHICLES[kind])
    flight.to_bridge(STARTS[kind])
    flight.wait(20.0)
    assert flight.waits_for.startswith(f"a {kind} is not commanded by missions")
    assert not flight.vehicle.pilot.armed


def test_a_rover_that_somebody_else_has_armed_is_left_alone() -> None:
    flight = joined(VehicleKind.ROVER)
    flight.wait(5.0)
    flight.vehicle.pilot.set_mode(FlightMode.GUIDED, flight.now_s)
    assert flight.vehicle.pilot.arm(flight.now_s, forced=False)
    flight.wait(2.0)  # until its heartbeat says so
    flight.to_bridge(STARTS[VehicleKind.ROVER])
    flight.wait(20.0)
    assert flight.waits_for == "armed by somebody else: disarm it"
    assert flight.vehicle.pilot.position_enu_m(flight.now_s) == HOME_M
    flight.vehicle.pilot.disarm(flight.now_s, forced=True)
    flight.run_until(Refused)
    assert not flight.vehicle.pilot.armed


def test_a_rover_changes_its_battery_at_a_base() -> None:
    base_m = (40.0, 20.0, 0.0)
    vehicle = replace(VEHICLES[VehicleKind.ROVER], bases=(ServedBase(base_m, 5.0),))
    flavour = firmware_model(FirmwareModelName.ARDUPILOT, VehicleKind.ROVER)
    flight = JoinedFlight(replace(CONFIG, ready_by_itself=True), flavour, vehicle)
    flight.to_bridge(STARTS[VehicleKind.ROVER])
    flight.run_until(VehicleReady())
    flight.to_bridge(Swap(1, base_m, swap_s=5.0))
    flight.run_until(Landed(1))
    assert not flight.vehicle.pilot.armed
    assert away_m(flight, base_m) <= 1.0
    flight.run_until(Swapped(1))
    flight.to_bridge(GoTo(2, (5.0, 60.0, 0.0)))
    flight.run_until(Arrived(2))
    assert away_m(flight, (5.0, 60.0, 0.0)) <= 1.0


# -- a plane that needs a runway ---------------------------------------------------------


@PLANES
def test_a_plane_takes_off_the_way_it_stands_and_lands_along_its_runway(
    flavour: FirmwareModelName,
) -> None:
    flight = started(VehicleKind.PLANE, flavour)
    low_m = [at for at in flight.track_enu_m if 0.0 < at[2] < 29.0]
    assert all(at[1] == pytest.approx(HOME_M[1]) and at[0] > HOME_M[0] for at in low_m)
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.run_until(Arrived(1))
    seen = len(flight.track_enu_m)
    flight.to_bridge(Return("done", via_enu_m=(*HOME_M[:2], 30.0)))
    flight.run_until(Home())
    assert not flight.vehicle.pilot.armed
    assert away_m(flight, HOME_M) <= 0.1
    *_, before, _ = (at for at in flight.track_enu_m[seen:] if 1.0 < at[2] < 20.0)
    assert before[1] == pytest.approx(HOME_M[1], abs=0.1)
    assert before[0] < HOME_M[0]


@PLANES
def test_the_landing_stands_on_a_plane_whatever_becomes_of_its_agent(
    flavour: FirmwareModelName,
) -> None:
    flight = started(VehicleKind.PLANE, flavour)
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.run_until(Arrived(1))
    pilot = flight.vehicle.pilot
    pilot.set_mode(FlightMode.RTL, flight.now_s)
    flight.wait(240.0)
    assert not pilot.armed
    assert away_m(flight, HOME_M) <= 0.1


@pytest.mark.parametrize(
    ("flavour", "name", "lands"), [(PX4, "RTL_TYPE", 1.0), (ARDUPILOT, "RTL_AUTOLAND", 2.0)]
)
def test_a_plane_that_would_circle_over_home_for_good_is_not_started(
    flavour: FirmwareModelName, name: str, lands: float
) -> None:
    flight = joined(VehicleKind.PLANE, flavour)
    flight.wait(5.0)
    table = flight.vehicle.pilot.parameters
    table.write(name, 0.0)
    flight.to_bridge(STARTS[VehicleKind.PLANE])
    flight.wait(20.0)
    table.write(name, 3.0)
    flight.wait(20.0)
    said = f"{name} is 3, so it may circle over home for good: set {name} {lands:g}"
    assert flight.waits_for == said
    assert not flight.vehicle.pilot.armed
    table.write(name, lands)
    flight.run_until(VehicleReady())


# -- ArduPlane: take-off and landing are items of a mission, flown in AUTO ----------------


def taking_off(seconds: float) -> JoinedFlight:
    """So long after its motors were started."""
    flight = joined(VehicleKind.PLANE)
    flight.to_bridge(STARTS[VehicleKind.PLANE])
    flight.run_until(MotorsRun(ours=True))
    flight.wait(seconds)
    pilot = flight.vehicle.pilot
    assert pilot.mode is FlightMode.AUTO
    assert 0.0 < pilot.position_enu_m(flight.now_s)[2] < 30.0
    return flight


def test_its_pilots_auto_is_told_from_ours() -> None:
    flight = started(VehicleKind.PLANE)
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.wait(3.0)
    flight.vehicle.pilot.set_mode(FlightMode.AUTO, flight.now_s)
    flight.run_until(HandedOver("its pilot switched it to AUTO (after its take-off)"))


def test_its_pilots_landing_is_told_from_ours() -> None:
    flight = started(VehicleKind.PLANE)
    pilot = flight.vehicle.pilot
    pilot.run.set_current(3, flight.now_s)
    pilot.set_mode(FlightMode.AUTO, flight.now_s)
    told = "its pilot or a failsafe switched it to AUTO (landing)"
    flight.run_until(HandedOver(told))


def test_a_pilot_who_breaks_its_landing_off_has_it() -> None:
    flight = started(VehicleKind.PLANE)
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.run_until(Arrived(1))
    flight.to_bridge(Return("done"))
    flight.run_until(ReturnBegun())
    flight.wait(5.0)
    flight.vehicle.pilot.run.set_current(2, flight.now_s)
    flight.run_until(HandedOver("its pilot switched it to AUTO (after its take-off)"))


def test_killed_while_it_takes_off_and_started_anew_it_goes_on() -> None:
    flight = taking_off(5.0)
    flight.restart_bridge(dead_s=2.0)
    flight.to_bridge(replace(STARTS[VehicleKind.PLANE], resume=True))
    flight.run_until(VehicleReady())
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.run_until(Arrived(1))


def test_killed_while_it_takes_off_for_good_it_lands() -> None:
    flight = taking_off(5.0)
    flight.restart_bridge(dead_s=300.0)
    assert not flight.vehicle.pilot.armed
    assert away_m(flight, HOME_M) <= 0.1


def test_killed_while_it_lands_and_started_anew_it_lets_it_land() -> None:
    flight = started(VehicleKind.PLANE)
    flight.to_bridge(GoTo(1, FAR[VehicleKind.PLANE]))
    flight.run_until(Arrived(1))
    flight.to_bridge(Return("done"))
    flight.run_until(ReturnBegun())
    flight.restart_bridge(dead_s=2.0)
    flight.to_bridge(Return("done", resume=True))
    flight.run_until(Home())
    assert away_m(flight, HOME_M) <= 0.1


@pytest.mark.parametrize("order", [Hold("wait"), Return("no part in it")])
def test_it_rises_before_it_is_turned(order: Hold | Return) -> None:
    flight = taking_off(5.0)
    flight.to_bridge(order)
    seen = len(flight.track_enu_m)
    flight.run_until(Held() if isinstance(order, Hold) else Home())
    low_m = [at for at in flight.track_enu_m[seen:] if at[2] < 29.0]
    rising_m = low_m[: next(i for i, at in enumerate(low_m) if at[2] > 28.0)]
    assert all(at[1] == pytest.approx(HOME_M[1]) for at in rising_m)


def test_its_mission_is_put_on_it_before_its_checks_pass() -> None:
    flight = joined(VehicleKind.PLANE)
    flight.vehicle.pilot.readiness.lose_gps(HOME_M, flight.now_s)
    flight.to_bridge(STARTS[VehicleKind.PLANE])
    flight.wait(20.0)
    assert len(flight.vehicle.pilot.store.items) == 7
    assert flight.vehicle.pilot.run.told == 1
    assert not flight.vehicle.pilot.armed


def test_it_takes_off_again_after_it_has_landed() -> None:
    flight = started(VehicleKind.PLANE)
    flight.to_bridge(Return("done"))
    flight.run_until(Home())
    flight.to_bridge(STARTS[VehicleKind.PLANE])
    flight.run_until(VehicleReady())
    assert flight.vehicle.pilot.mode is FlightMode.GUIDED


# -- a fleet of all kinds ---------------------------------------------------------------


def flown(scenario: Path, autopilot: str, speedup: float, tmp_path: Path) -> dict[str, list[str]]:
    """Who has done what of a scenario, all of which must have been done."""
    words = [str(scenario), "--speedup", f"{speedup:g}", "--autopilot", autopilot]
    with SwarmRun(words, tmp_path) as run:
        status, told = run.result(timeout_s=590.0)
        run.assert_nothing_left()
        story = run.story()
    assert status == 0, story
    assert sorted(told["done"]) == sorted(task.id for task in load_scenario(scenario).tasks), story
    assert told["lost_uavs"] == [], story
    assert told["processes"] == [], story
    return {
        uav: sorted({task.partition("-")[0] for task in tasks})
        for uav, tasks in told["executed_routes"].items()
    }


def test_copter_rover_and_plane_share_a_mission(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    real = all(os.environ.get(vehicle.variable) for vehicle in ARDUPILOT_VEHICLES.values())
    record_property("flown", "real" if real else "simulated")
    autopilot, speedup = ("ardupilot", 2.0) if real else ("sim", pace(10.0))
    did = flown(resolve_scenario("roundup"), autopilot, speedup, tmp_path)
    assert did["rover"] == ["trough"]
    assert did["plane"] == ["herd"]


@pytest.mark.parametrize(
    ("kind", "variables", "simulated", "speedup"),
    [
        (FirmwareKind.PX4, ["SWARM_SITL_PX4"], "sim-px4", 1.0),
        (FirmwareKind.ARDUPILOT, ["SWARM_SITL_ARDUCOPTER", "SWARM_SITL_PLANE"], "sim", 2.0),
    ],
)
def test_copter_and_plane_share_a_mission_and_the_plane_lands_on_its_strip(
    kind: FirmwareKind,
    variables: list[str],
    simulated: str,
    speedup: float,
    tmp_path: Path,
    record_property: Callable[[str, object], None],
) -> None:
    real = all(os.environ.get(variable) for variable in variables)
    record_property("flown", "real" if real else "simulated")
    autopilot, speedup = (str(kind), speedup) if real else (simulated, pace(10.0))
    did = flown(resolve_scenario("airstrip"), autopilot, speedup, tmp_path)
    assert did == {"copter": ["roof"], "plane": ["field"]}
