"""What the doctor says of batteries, bases, zones and tasks."""

from __future__ import annotations

from dataclasses import replace

from sim.fleet.doctor.field import check_field
from sim.fleet.doctor.finding import CheckFinding, CheckState
from swarm.model import Base, BaseId, Mission, Zone, ZoneId
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario
from tests.support.builders import mission, task, uav

AROUND = Zone(ZoneId("moat"), ((-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)))


def fleet(endurance_s: float | None = 100.0, charge_frac: float = 1.0) -> Mission:
    """One UAV at the origin, two tasks 20 m and 30 m away, a base between."""
    uavs = [replace(uav("u0"), endurance_s=endurance_s, charge_frac=charge_frac)]
    flown = mission(uavs, [task("near", 20.0), task("far", 30.0)])
    return replace(flown, bases=(Base(BaseId("b0"), (10.0, 0.0, 0.0)),))


def said(flown: Mission) -> dict[str, CheckFinding]:
    return {each.check: each for each in check_field(flown)}


def test_of_a_plain_mission_nothing_is_said() -> None:
    assert check_field(mission([uav("u0")], [task("t0", 5.0)])) == []


def test_a_mission_that_can_be_flown_is_fine() -> None:
    found = said(fleet())

    assert {each.state for each in found.values()} == {CheckState.OK}
    assert found["energy"].text == "u0 has the least: 80 s of flight, 80 s on a full battery"
    assert found["bases"].text == "b0 (any number at a time, 0 s)"


def test_a_battery_without_charge_to_fly_with_fails_and_one_with_little_is_a_warning() -> None:
    empty, little = said(fleet(charge_frac=0.2)), said(fleet(charge_frac=0.5))

    assert empty["energy"].state is CheckState.FAILS
    assert empty["energy"].text.startswith("u0 may not fly at all")
    assert little["energy"].state is CheckState.WARNING


def test_a_base_that_nobody_reaches_and_batteries_without_any_base_are_told() -> None:
    distant = replace(fleet(), bases=(Base(BaseId("b0"), (500.0, 0.0, 0.0)),))
    none = replace(fleet(), bases=())

    assert "nobody gets to b0" in " ".join(each.text for each in check_field(distant))
    assert "lands for good" in said(none)["bases"].text
    assert said(replace(fleet(None), bases=(), zones=(replace(AROUND, floor_m=90.0),))).keys() == {
        "zones",
        "tasks",
    }


def test_zones_that_shut_a_start_in_fail_and_those_that_concern_nobody_are_told() -> None:
    ring = replace(AROUND, holes_enu_m=(((-5.0, -5.0), (5.0, -5.0), (5.0, 5.0), (-5.0, 5.0)),))
    shut, high = said(replace(fleet(), zones=(ring,))), replace(AROUND, floor_m=90.0)

    assert shut["zones"].state is CheckState.FAILS
    assert shut["tasks"].text.startswith("nobody can do near, far")
    assert "as high, or as low, as moat" in said(replace(fleet(), zones=(high,)))["zones"].text


def test_a_task_that_nobody_can_do_is_named() -> None:
    flown = fleet()
    late = replace(flown.tasks[1], closes_s=3.0)

    found = said(replace(flown, tasks=(flown.tasks[0], late)))["tasks"]

    assert found.state is CheckState.WARNING
    assert found.text == "nobody can do far, not even as the only task"


def test_of_areas_it_is_told_what_lines_cover_and_what_pictures_are_worth() -> None:
    hayfield = load_scenario(resolve_scenario("hayfield"))
    fast = replace(hayfield.uavs[0], speed_m_s=30.0)

    (told,) = (each for each in check_field(hayfield) if each.check == "areas")
    _, blurred = (
        each for each in check_field(replace(hayfield, uavs=(fast,))) if each.check == "areas"
    )

    assert told.state is CheckState.OK
    assert told.text.startswith("hay covers 99.9")
    assert "1.6 cm a pixel, blur 0.61 px" in told.text
    assert blurred.state is CheckState.WARNING
    assert blurred.text == "hay: pictures are blurred by 1.8 px"


def test_legs_over_hills_that_take_longer_than_planned_are_told() -> None:
    ridge = load_scenario(resolve_scenario("ridge"))
    slow = replace(ridge, uavs=tuple(replace(each, speed_m_s=5.0) for each in ridge.uavs))

    found, calm = said(ridge)["ground"], said(slow)["ground"]

    assert found.state is CheckState.WARNING
    assert found.text == (
        "ways to tasks and back slope by up to 17°: vehicles that climb at 2.5 and sink at 1.5 m/s "
        "take up to 1.40 times as long as planned"
    )
    assert found.remedy == "give a speed_m_s of 5.8, or set them faster"
    assert calm.state is CheckState.OK
    assert "ground" not in said(replace(ridge, terrain=None))
    as_told = tuple(replace(each, speed_m_s=5.8) for each in ridge.uavs)
    assert said(replace(ridge, uavs=as_told))["ground"].state is CheckState.OK
