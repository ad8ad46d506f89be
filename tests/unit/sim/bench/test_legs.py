"""Legs are read from a flight as they were flown, and other files are refused in one line."""

from __future__ import annotations

import io
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from agent.vehicle.config import CommandStyle
from coordinator.planner.plan_report import schedule_as_json
from sim.bench.flown_legs import (
    judge_flight,
    leg_times,
    legs_flown,
    limits_kept,
    load_run,
    makespan_frac,
    reckoned_makespan_s,
)
from sim.bench.leg_commands import legs as bench_legs
from sim.bench.leg_flights import LegFlight, LegFlights, autopilots_here, ways
from sim.bench.machine import this_machine
from sim.world.simulation import simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.model import TaskId, UavId
from swarm.runtime.errors import InputError
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario

MEADOW = load_scenario(resolve_scenario("meadow"))
RESERVOIR = load_scenario(resolve_scenario("reservoir-inspection"))
TASKS = {str(task.id) for task in RESERVOIR.tasks}
STARTS = {uav.id: uav.position_enu_m for uav in MEADOW.uavs}
PLACES = {task.id: task.position_enu_m for task in MEADOW.tasks}


def visit(go: str, from_m: tuple[float, ...], *times_s: float) -> dict[str, Any]:
    depart_s, begin_s, end_s = times_s
    times = {"depart_s": depart_s, "arrive_s": begin_s, "begin_s": begin_s, "end_s": end_s}
    via_m = [list(PLACES[TaskId(go)][:2])] if go in PLACES else [[0.0, 0.0]]
    return {"go": go, "from_m": list(from_m[:2]), "via_m": via_m, "reversed": False, **times}


FLOWN: dict[str, Any] = {
    "scenario": "meadow",
    "executed_schedule": {
        "uav1": [
            visit("west-near", STARTS[UavId("uav1")], 0.0, 12.0, 15.0),
            visit("west-far", PLACES[TaskId("west-near")], 15.0, 26.0, 29.0),
            visit("start", PLACES[TaskId("west-far")], 29.0, 40.0, 40.0),
        ],
        "uav2": [],
        "uav3": [visit("east-near", STARTS[UavId("uav3")], 1.0, 12.0, 15.0)],
    },
    "completion_s": {"west-near": 12.0, "west-far": 20.0, "east-near": 11.0},
    "makespan_s": 29.0,
}


def test_a_leg_lasts_from_departure_to_arrival() -> None:
    legs = legs_flown(MEADOW, FLOWN, "flight.json")

    assert [(leg.uav, leg.task, leg.flown_s) for leg in legs] == [
        ("uav1", "west-near", 12.0),
        ("uav1", "west-far", 11.0),
        ("uav3", "east-near", 11.0),
    ]
    assert legs[0].length_m == pytest.approx((60.0**2 + 30.0**2) ** 0.5)
    assert legs[0].excess_s == pytest.approx(12.0 - legs[0].length_m / 8.0)
    assert legs[0].planned_s == pytest.approx(legs[0].length_m / 8.0)


def test_planned_is_what_the_vehicles_said_of_their_acceleration_where_the_scenario_does_not() -> (
    None
):
    told = {**FLOWN, "calibration": {"uav1": {"time_frac": 1.1, "acceleration_m_s2": 2.0}}}
    first, _, other = legs_flown(MEADOW, told, "flight.json")
    assert first.planned_s == pytest.approx(first.length_m / 8.0 + 8.0 / 2.0)
    assert other.planned_s == pytest.approx(other.length_m / 8.0)


def test_medians_are_told_with_their_spread_and_beyond_the_ramps() -> None:
    legs = legs_flown(MEADOW, FLOWN, "flight.json")
    times = leg_times(legs, 2.0)

    excess_s = sorted(leg.excess_s for leg in legs)
    fracs = sorted(leg.flown_s / leg.planned_s for leg in legs)
    assert times is not None
    assert (times.legs, times.least_s, times.greatest_s) == (3, excess_s[0], excess_s[2])
    assert times.median_s == excess_s[1]
    assert (times.least_frac, times.flown_frac, times.greatest_frac) == tuple(fracs)
    assert times.beyond_ramps_s == pytest.approx(excess_s[1] - 4.0)
    assert leg_times([], 2.0) is None


def test_the_makespan_is_set_beside_the_plans() -> None:
    assert makespan_frac(FLOWN) == pytest.approx(29.0 / 20.0)
    assert makespan_frac({**FLOWN, "completion_s": {}}) is None


def test_in_virtual_time_the_fields_legs_take_what_the_model_says() -> None:
    """Bases, zones, wind, lines and a window: legs round zones from task to task, and no others."""
    mission = RESERVOIR
    flown = simulate_mission(mission, method="guided", seed=0, uncertainty=Uncertainty())
    schedule: dict[str, Any] = schedule_as_json(flown.world.executed_schedule())
    run = {"executed_schedule": schedule, "completion_s": {}, "makespan_s": 0.0}
    ended_s = [each["end_s"] for e in schedule.values() for each in e if each["go"] in TASKS]

    assert reckoned_makespan_s(mission, run) == pytest.approx(max(ended_s), abs=0.05)
    legs = legs_flown(mission, run, "flight.json")

    went = [(before["go"], at["go"]) for e in schedule.values() for before, at in pairwise(e)]
    between = [(before, at) for before, at in went if at in {t.id for t in mission.tasks}]
    from_bases = sum(":" in before for before, _ in between)
    assert from_bases > 0
    assert 5 <= len(legs) <= len(mission.uavs) + len(between) - from_bases
    for leg in legs:
        assert leg.flown_s == pytest.approx(leg.planned_s, abs=0.05)


def test_lists_are_reckoned_with_landing_and_climbing_as_found() -> None:
    """A swap for a window of two minutes later takes so much longer; what cannot be is not told."""
    lists = {"uav2": ["base:dam-yard", "spillway"]}
    run = {"executed_schedule": scheduled(lists)}
    slower = {"uav2": {"land_s": 20.0, "climb_s": 10.0}}

    by_brief_s = reckoned_makespan_s(RESERVOIR, run)
    found_s = reckoned_makespan_s(RESERVOIR, {**run, "calibration": slower})

    assert by_brief_s is not None
    assert found_s == pytest.approx(by_brief_s + 30.0)
    all_at_once = {"uav2": sorted(TASKS)}
    assert reckoned_makespan_s(RESERVOIR, {"executed_schedule": scheduled(all_at_once)}) is None


def scheduled(lists: dict[str, list[str]]) -> dict[str, Any]:
    return {
        uav: [{"go": name, "reversed": False} for name in (*names, "start")]
        for uav, names in lists.items()
    }


@pytest.mark.parametrize(
    ("change", "kept"),
    [
        ({}, True),
        ({"done": sorted(TASKS - {"weir"})}, False),
        ({"done": sorted(TASKS - {"weir"}), "left_out": {"weir": "energy"}}, True),
        ({"nearest_zone_m": 19.9}, False),
        ({"nearest_zone_m": None}, True),
        ({"lowest_charge_frac": {"uav1": 0.3, "uav2": 0.19}}, False),
        ({"lowest_charge_frac": {}}, True),
    ],
)
def test_a_flight_keeps_its_limits_or_does_not(change: dict[str, Any], kept: bool) -> None:
    run: dict[str, Any] = {
        "done": sorted(TASKS),
        "nearest_zone_m": 20.0,
        "lowest_charge_frac": {"uav1": 0.3, "uav2": 0.21},
    } | change

    found = limits_kept(RESERVOIR, run)

    assert found.kept is kept
    assert (found.margin_m, found.done) == (20.0, len(run["done"]))
    lowest = min(run["lowest_charge_frac"].values(), default=None)
    assert (found.charge_frac, found.reserve_frac) == (lowest, 0.0 if lowest is None else 0.2)


def test_the_command_tells_what_is_found_and_fails_where_a_limit_is_not_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, done = tmp_path / "flight.json", sorted(task.id for task in MEADOW.tasks)
    scenario = resolve_scenario("meadow")
    path.write_text(json.dumps(FLOWN | {"done": done}))

    assert bench_legs(scenario, [path], 2.0, json=True) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["scenario"], len(found["legs"])) == ("meadow", 3)
    assert found["makespan_frac"] == [pytest.approx(29.0 / 20.0)]
    assert found["flown_lists_frac"][0] > 1.0
    assert (found["limits"][0]["done"], found["limits"][0]["kept"]) == (6, True)

    path.write_text(json.dumps(FLOWN | {"done": done[1:]}))
    assert bench_legs(scenario, [path], None, json=False) == 1
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "meadow: 3 legs"
    assert lines[3:] == [
        "  makespan flown / planned: 1.45",
        f"  makespan flown / planned, of the lists as flown: {found['flown_lists_frac'][0]:.2f}",
        "  5 of 6 tasks done: not kept",
    ]


def test_everything_that_is_there_is_flown_in_both_ways_and_firmware_at_wall_speed() -> None:
    assert autopilots_here({}) == ("sim", "sim-px4")
    here = autopilots_here({"SWARM_SITL_PX4": "/opt/px4", "SWARM_SITL_ARDUCOPTER": ""})
    assert here == ("sim", "sim-px4", "px4")
    flown = ways(here, list(CommandStyle), 4.0)
    assert {(way.autopilot, way.speedup, way.real) for way in flown} == {
        ("sim", 4.0, False),
        ("sim-px4", 4.0, False),
        ("px4", 1.0, True),
    }
    assert len(set(flown)) == 6


def test_flights_are_told_with_their_legs_and_what_was_not_flown() -> None:
    done = sorted(task.id for task in MEADOW.tasks)
    late = {**FLOWN, "done": done[1:]}
    by_targets, by_missions = ways(["sim"], [CommandStyle.REPOSITION, CommandStyle.MISSION], 4.0)
    flights = [
        LegFlight(way, judge_flight(MEADOW, run, "here", None), 0.5)
        for way, run in ((by_targets, {**FLOWN, "done": done}), (by_missions, late))
    ]
    kept = LegFlights(this_machine(), "meadow", 0, (flights[0],), ("px4",))
    broken = LegFlights(this_machine(), "meadow", 0, tuple(flights))

    assert kept.kept
    assert not broken.kept
    told = json.loads(json.dumps(broken.as_json(), allow_nan=False))["flights"][1]
    assert (told["autopilot"], told["command"], told["real"]) == ("sim", "mission", False)
    assert [leg["flown_s"] for leg in told["legs"]] == [12.0, 11.0, 11.0]
    assert (told["limits"]["done"], told["limits"]["kept"]) == (5, False)
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(kept, kept.leg_table())
    shown = " ".join(console.export_text().split())
    times = flights[0].judged.times
    assert times is not None
    assert f"sim, reposition {times.flown_frac:.2f}" in shown
    assert f"{0.5 * times.flown_frac:.2f}" in shown
    assert "6/6" in shown
    assert "Not flown: px4; not set: SWARM_SITL_PX4." in shown
    assert "west-far" in shown


@pytest.mark.parametrize(
    ("option", "problem"),
    [
        ({"autopilot": "sim,arduplane"}, "no such autopilot"),
        ({"command": "guided"}, "no such way to command"),
        ({"runs": [Path("flight.json")], "command": "mission"}, "nothing is flown"),
    ],
)
def test_what_cannot_be_flown_is_refused_at_once(option: dict[str, Any], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        bench_legs(resolve_scenario("meadow"), **option)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("no json", "it is not JSON"),
        ("[]", "is missing"),
        (json.dumps({"scenario": "meadow", "executed_routes": {}}), "executed_schedule"),
    ],
)
def test_what_is_no_flight_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    path = tmp_path / "flight.json"
    path.write_text(text)
    with pytest.raises(InputError, match=problem):
        load_run(path)


def test_a_flight_of_another_scenario_is_refused() -> None:
    other = {**FLOWN, "executed_schedule": {"uav1": [visit("nowhere", (0.0, 0.0), 0.0, 1.0, 2.0)]}}
    with pytest.raises(InputError, match="'nowhere' is not in the scenario meadow"):
        legs_flown(MEADOW, other, "flight.json")
