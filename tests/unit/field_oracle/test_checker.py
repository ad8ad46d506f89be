"""The checker praises the oracle's own plans and sees every kind of fault in them."""

from __future__ import annotations

import copy
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from tests.support.field_oracle.brute import best_plan
from tests.support.field_oracle.checker import (
    check_against_best,
    check_plan,
    check_simulation,
    value_of,
)
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import KINDS, made_up
from tests.support.field_oracle.scenario import FieldScenario, read
from tests.support.field_oracle.schedule import Item, Swap, Work
from tests.support.field_oracle.slots import fly_all, objective
from tests.support.field_oracle.telling import plan_json
from tests.unit.field_oracle.conftest import Make

Json = dict[str, Any]
LISTS = {
    "u1": (Swap("b0"), Work("line"), Work("late")),
    "u2": (Swap("b0"), Work("spot")),
}


@pytest.fixture
def scenario(make: Make) -> FieldScenario:
    """Two UAVs that want one slot, a line behind a wall, a task that opens late, one too far."""
    uav = {"endurance_s": 250.0, "reserve_frac": 0.0, "charge_frac": 0.3}
    plain = make(
        {
            "line": {"path_m": [[50, 0], [70, 0]], "closes_s": 150.0},
            "late": {"at": 60, "opens_s": 150.0, "service_s": 5.0},
            "spot": {"at": 20, "due_s": 150.0},
            "far": {"at": 900},
            "popup": {"at": 1, "appears_s": 9.0},
        },
        {"u1": uav, "u2": uav | {"position_m": [-4.0, 0.0]}},
        {"b0": {"at": 10, "swap_s": 20.0, "slots": 1}},
    )
    wall = {"id": "wall", "polygon_m": [[40, -30], [44, -30], [44, 30], [40, 30]]}
    table = {"schema": 2, "name": "w", "mission": {"horizon_s": 1.0}, "zone": [wall]}
    return replace(plain, zones=read(table).zones)


@pytest.fixture
def plan(scenario: FieldScenario) -> Json:
    times = FlightTimes(scenario)
    return plan_json(scenario, times, fly_all(scenario, times, LISTS))


def test_plan_of_the_oracle_is_praised(scenario: FieldScenario, plan: Json) -> None:
    assert check_plan(scenario, plan) == []
    assert [entry["go"] for entry in plan["schedule"]["u1"]] == [
        "base:b0",
        "line",
        "late",
        "base:b0",
    ]
    assert plan["left_out"] == {"far": "nobody can"}


@pytest.mark.parametrize("kind", KINDS)
def test_best_plans_of_every_kind_are_praised(kind: str) -> None:
    scenario = read(made_up(3, kind, n_tasks=3))
    times = FlightTimes(scenario)
    best = best_plan(scenario, times, in_a_row=1)
    told = plan_json(scenario, times, best.flights, optimum=best.objective)

    assert check_plan(scenario, told, times) == []
    assert check_against_best(scenario, told, best, exact=True) == []


@pytest.mark.parametrize("kind", KINDS)
def test_any_plan_of_any_kind_is_praised(kind: str) -> None:
    """Most lists by chance can't be flown; those that can need not be good."""
    rng = random.Random(kind)
    n_flown = 0
    for seed in range(3):
        scenario = read(made_up(seed, kind))
        times = FlightTimes(scenario)
        most = n_flown + 12
        for _ in range(90):
            if n_flown == most:
                break
            lists = lists_by_chance(rng, scenario)
            sequence = rng.sample(list(lists), len(lists))
            flights = fly_all(scenario, times, lists, sequence)
            if objective(flights) is not None:
                told = plan_json(scenario, times, flights, sequence=sequence)
                assert check_plan(scenario, told, times) == []
                n_flown += 1

    assert n_flown >= 10


def lists_by_chance(rng: random.Random, scenario: FieldScenario) -> dict[str, list[Item]]:
    lists: dict[str, list[Item]] = {uav.id: [] for uav in scenario.uavs}
    for task in rng.sample(scenario.known, len(scenario.known)):
        own = lists[rng.choice(list(lists))]
        if rng.random() < 0.5:
            continue
        if scenario.bases and rng.random() < 0.4:
            own.append(Swap(rng.choice(scenario.bases).id))
        own.append(Work(task.id, task.is_line and rng.random() < 0.5))
    return lists


def test_plans_in_which_uavs_wait_for_slots_are_praised() -> None:
    rng = random.Random(1)
    n_waits = 0
    for seed in range(6):
        scenario = read(made_up(seed, "slots", n_uavs=3))
        uavs = [replace(uav, charge_frac=1.0, endurance_s=300.0) for uav in scenario.uavs]
        mild = replace(scenario, uavs=tuple(uavs))
        times = FlightTimes(mild)
        for _ in range(60):
            flights = fly_all(mild, times, lists_by_chance(rng, mild))
            if objective(flights) is not None:
                assert check_plan(mild, plan_json(mild, times, flights), times) == []
                entries = [entry for flight in flights.values() for entry in flight.entries[:-1]]
                n_waits += any(e.begin_s > e.arrive_s for e in entries)

    assert n_waits >= 10


def entry(plan: Json, uav: str, index: int) -> Json:
    found: Json = plan["schedule"][uav][index]
    return found


def later(plan: Json, uav: str, first: int, by_s: float) -> None:
    for each in plan["schedule"][uav][first:]:
        for key in ("depart_s", "arrive_s", "begin_s", "end_s"):
            each[key] += by_s


FAULTS: dict[str, tuple[Callable[[Json], object], str]] = {
    "missing key": (lambda p: p.pop("left_out"), "there is no 'left_out'"),
    "unknown key": (lambda p: entry(p, "u1", 0).update(extra=1), "u1[0] has the keys"),
    "no via": (lambda p: entry(p, "u1", 0).update(via_m=[]), "via_m is empty"),
    "third number": (lambda p: entry(p, "u1", 0)["from_m"].append(0.0), "is not [x, y]"),
    "not a number": (lambda p: entry(p, "u1", 0).update(end_s=None), "end_s is None"),
    "no way home": (lambda p: p["schedule"]["u1"].pop(), "a list ends with the way home"),
    "other start": (lambda p: entry(p, "u2", 0).update(from_m=[0.0, 0.0]), "from_m is"),
    "other end": (lambda p: entry(p, "u1", 1)["via_m"].pop(), "via_m ends at"),
    "through the wall": (
        lambda p: entry(p, "u1", 1).update(via_m=entry(p, "u1", 1)["via_m"][-1:]),
        "into zone wall",
    ),
    "roundabout": (lambda p: entry(p, "u2", 1)["via_m"].insert(0, [15.0, 9.0]), "the shortest"),
    "late departure": (lambda p: later(p, "u2", 1, 1.0), "depart_s is"),
    "too quick": (lambda p: entry(p, "u2", 1).update(arrive_s=1.0), "arrive_s is"),
    "too early": (lambda p: entry(p, "u1", 2).update(begin_s=149.0, end_s=154.0), "begin_s is"),
    "too short": (lambda p: entry(p, "u1", 2).update(end_s=151.0), "end_s is"),
    "short swap": (lambda p: entry(p, "u2", 0).update(end_s=31.0), "end_s is"),
    "slot taken": (lambda p: entry(p, "u2", 0).update(begin_s=14.0), "a slot is free at 30.0"),
    "reversed spot": (lambda p: entry(p, "u2", 1).update(reversed=True), "only lines"),
    "farther home": (
        lambda p: entry(p, "u1", 3).update(
            go="start", via_m=[[44.0, 30.0], [40.0, 30.0], [0.0, 0.0]]
        ),
        "but base:b0 is",
    ),
    "other task": (lambda p: entry(p, "u1", 2).update(go="nothing"), "no such task"),
    "pop-up": (lambda p: entry(p, "u1", 2).update(go="popup"), "no task that a plan knows"),
    "twice": (lambda p: entry(p, "u2", 1).update(go="late"), "is in two places"),
    "routes": (lambda p: p["routes"]["u1"].reverse(), "routes are"),
    "completion": (lambda p: p["completion_s"].update(late=1.0), "completion_s is"),
    "objective": (lambda p: p.update(objective=p["objective"] + 1e-3), "objective is"),
    "reason": (lambda p: p["left_out"].update(far="energy"), "left_out is"),
    "sequence": (lambda p: p.update(sequence=["u1"]), "the sequence"),
    "other scenario": (lambda p: p.update(scenario="other"), "it is of the scenario"),
    "gap": (lambda p: p.update(optimum=2.0 * p["objective"], gap=0.1), "gap is"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_fault_is_seen(scenario: FieldScenario, plan: Json, fault: str) -> None:
    spoil, complaint = FAULTS[fault]
    spoil(plan)

    assert any(complaint in found for found in check_plan(scenario, plan))


@pytest.mark.parametrize(
    ("task", "changed", "complaint"),
    [
        ("line", {"closes_s": 60.0}, "closes at 60.0 s"),
        ("spot", {"due_s": 50.0}, "is due at 50.0 s"),
    ],
)
def test_window_and_due_that_are_missed_are_seen(
    scenario: FieldScenario, plan: Json, task: str, changed: Json, complaint: str
) -> None:
    """A plan for a milder scenario."""
    tasks = [replace(each, **changed) if each.id == task else each for each in scenario.tasks]
    harder = replace(scenario, tasks=tuple(tasks))

    assert any(complaint in found for found in check_plan(harder, plan))


def test_battery_that_is_too_small_is_seen(scenario: FieldScenario, plan: Json) -> None:
    harder = replace(scenario, uavs=tuple(replace(u, endurance_s=200.0) for u in scenario.uavs))

    complaints = check_plan(harder, plan)

    assert len(complaints) == 1
    assert "s airborne with the flight to base:b0, 200.0 s allowed" in complaints[0]


def test_better_than_the_best_and_worse_are_told(make: Make) -> None:
    scenario = make({"t1": {"at": 10}, "t2": {"at": 20}})
    times = FlightTimes(scenario)
    best = best_plan(scenario, times)
    worse = plan_json(scenario, times, fly_all(scenario, times, {"u1": (Work("t2"), Work("t1"))}))
    better = copy.deepcopy(worse) | {"objective": best.objective + 1.0}

    assert check_against_best(scenario, worse, best, exact=False) == []
    assert "not the best" in check_against_best(scenario, worse, best, exact=True)[0]
    assert "better than the best" in check_against_best(scenario, better, best, exact=False)[0]


def test_value_is_recounted_from_the_ends(scenario: FieldScenario, plan: Json) -> None:
    assert value_of(scenario, plan["schedule"]) == pytest.approx(plan["objective"], rel=1e-12)


@pytest.fixture
def simulation(plan: Json) -> Json:
    return plan | {
        "executed_schedule": copy.deepcopy(plan["schedule"]),
        "executed_routes": copy.deepcopy(plan["routes"]),
        "done": ["line", "late", "spot", "popup"],
        "open": ["far"],
        "closest_approach_m": 3.0,
    }


def test_simulation_as_planned_is_praised(scenario: FieldScenario, simulation: Json) -> None:
    assert check_simulation(scenario, simulation, as_planned=True, exit_status=0) == []


def test_what_is_left_out_may_be_done_where_the_plan_is_disturbed(
    scenario: FieldScenario, simulation: Json
) -> None:
    simulation["open"].remove("far")
    (nowhere,) = check_simulation(scenario, simulation)
    simulation["done"].append("far")

    assert nowhere == "far is left out, but not open"
    assert check_simulation(scenario, simulation) == []
    assert check_simulation(scenario, simulation, as_planned=True) == [nowhere]


FLOWN: dict[str, tuple[Callable[[Json], object], str]] = {
    "left out and not open": (lambda s: s.update(open=[]), "but not open"),
    "no distance of two": (lambda s: s.update(closest_approach_m=-1.0), "closest_approach_m"),
    "times go back": (lambda s: flown(s, "u2", 1).update(arrive_s=900.0), "its times go back"),
    "before it opened": (lambda s: flown(s, "u1", 2).update(begin_s=140.0), "within its window"),
    "after it was due": (lambda s: flown(s, "u2", 1).update(end_s=151.0), "was due at"),
    "through the wall": (lambda s: flown(s, "u1", 1).update(via_m=[[50.0, 0.0]]), "into zone"),
    "out of energy": (lambda s: flown(s, "u1", 3).update(begin_s=999.0), "s airborne"),
    "status": (lambda s: s["done"].remove("late"), "could be done and were not"),
}


def flown(simulation: Json, uav: str, index: int) -> Json:
    found: Json = simulation["executed_schedule"][uav][index]
    return found


@pytest.mark.parametrize("fault", FLOWN)
def test_fault_in_flight_is_seen(scenario: FieldScenario, simulation: Json, fault: str) -> None:
    spoil, complaint = FLOWN[fault]
    spoil(simulation)

    found = check_simulation(scenario, simulation, as_planned=True, exit_status=0)

    assert any(complaint in each for each in found)
