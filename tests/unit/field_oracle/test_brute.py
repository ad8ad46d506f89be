"""Brute force: against one that skips nothing, against eq. 1, and for hand-made dilemmas."""

from __future__ import annotations

import itertools
import math
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.field_oracle.brute import best_plan, can_do_alone, reasons_left_out
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.made_up import made_up
from tests.support.field_oracle.scenario import FieldScenario, FieldTask, FieldUav, read
from tests.support.field_oracle.schedule import Item, Swap, Work
from tests.support.field_oracle.slots import fly_all, objective
from tests.unit.field_oracle.conftest import Make

SCENARIOS = Path(__file__).parents[3] / "sim" / "scenarios"


def test_optimum_without_constraints_is_that_of_eq_1() -> None:
    table = tomllib.loads((SCENARIOS / "table-1.toml").read_text(encoding="utf-8"))
    table["task"] = table["task"][:6]  # with all eight a minute goes by
    scenario = read(table)

    assert best_plan(scenario).objective == pytest.approx(plain_optimum(scenario), abs=1e-9)


def plain_optimum(scenario: FieldScenario) -> float:
    """Of eq. 1 without any constraint: by its words, with nothing of this oracle."""
    best = -math.inf
    names = [task.id for task in scenario.tasks]
    for owners in itertools.product(scenario.uavs, repeat=len(names)):
        total = 0.0
        for uav in scenario.uavs:
            own = [task for task, owner in zip(scenario.tasks, owners, strict=True) if owner is uav]
            total += max(plain_value(scenario, uav, order) for order in itertools.permutations(own))
        best = max(best, total)
    return best


def plain_value(scenario: FieldScenario, uav: FieldUav, order: tuple[FieldTask, ...]) -> float:
    value, time_s, here = 0.0, 0.0, uav.start.at
    for task in order:
        time_s += math.dist(here, task.stops[0].at) / uav.speed_m_s
        here = task.stops[0].at
        value += uav.success.get(task.id, 0.7) * task.value * (scenario.horizon_s - time_s)
    return value


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        *itertools.product(("energy", "slots", "windows", "due", "lines", "survival"), range(4)),
        *itertools.product(("all", "all-but-margin"), range(5)),
        ("slots", 4),
        ("slots", 5),
    ],
)
def test_skips_nothing_that_matters(kind: str, seed: int) -> None:
    scenario = read(made_up(seed, kind, n_tasks=3))
    times = FlightTimes(scenario)

    best = best_plan(scenario, times, in_a_row=1)

    n_left_out, value = everything(scenario, times)
    assert best.n_left_out == n_left_out
    assert best.objective == pytest.approx(value, abs=1e-9)


def everything(scenario: FieldScenario, times: FlightTimes) -> tuple[int, float]:
    """The best of all combinations of all lists, each flown to its end."""
    best = (len(scenario.known) + 1, 0.0)
    for owners in itertools.product((None, *scenario.uavs), repeat=len(scenario.known)):
        owned = list(zip(scenario.known, owners, strict=True))
        n_left_out = sum(owner is None and task.due_s is None for task, owner in owned)
        options = [
            list(all_lists(scenario, uav, [task for task, owner in owned if owner is uav]))
            for uav in scenario.uavs
        ]
        for lists in itertools.product(*options):
            plan = {uav.id: own for uav, own in zip(scenario.uavs, lists, strict=True)}
            value = objective(fly_all(scenario, times, plan))
            if value is not None:
                best = min(best, (n_left_out, -value))
    return best[0], -best[1]


def all_lists(
    scenario: FieldScenario, uav: FieldUav, tasks: list[FieldTask]
) -> Iterator[tuple[Item, ...]]:
    """All orders and directions, and before each task one base or none."""
    stays: list[tuple[Item, ...]] = [()]
    if uav.endurance_s < math.inf:
        stays += [(Swap(base.id),) for base in scenario.bases]
    for order in itertools.permutations(tasks):
        ways = [(False, True) if task.is_line else (False,) for task in order]
        for directions in itertools.product(*ways):
            for visits in itertools.product(stays, repeat=len(order)):
                steps = zip(visits, order, directions, strict=True)
                yield tuple(
                    item for visit, task, back in steps for item in (*visit, Work(task.id, back))
                )


def test_a_task_without_due_goes_before_any_value(make: Make) -> None:
    """The dull one and the golden one exclude each other."""
    dull, golden = {"at": -50, "value": 0.1, "closes_s": 50.0}, {"at": 50, "value": 9.0}
    scenario = make({"dull": dull, "golden": golden | {"due_s": 50.0}})

    best = best_plan(scenario)

    assert best.lists == {"u1": (Work("dull"),)}
    assert reasons_left_out(scenario, FlightTimes(scenario), frozenset({"dull"})) == {
        "golden": "due"
    }


def test_due_task_is_left_out_where_it_costs_more_than_it_gives(make: Make) -> None:
    scenario = make({"main": {"at": 50, "value": 9.0}, "aside": {"at": -1, "due_s": 2.0}})

    assert best_plan(scenario).lists == {"u1": (Work("main"),)}


def test_line_is_flown_whichever_way_is_better(make: Make) -> None:
    scenario = make({"t1": {"path_m": [[50, 0], [10, 0]]}, "t2": {"at": 60}})

    assert best_plan(scenario).lists == {"u1": (Work("t1", backwards=True), Work("t2"))}


def test_reasons_come_in_their_order(make: Make) -> None:
    uav = {"u1": {"endurance_s": 100.0, "reserve_frac": 0.0, "success": {"never": 0.0}}}
    tasks = {
        "far": {"at": 51, "due_s": 900.0},
        "never": {"at": 1},
        "due": {"at": 10, "due_s": 100.0, "closes_s": 90.0},
        "window": {"at": 10, "closes_s": 90.0},
        "energy": {"at": 50},
    }
    scenario = make(tasks, uav)

    assert reasons_left_out(scenario, FlightTimes(scenario), frozenset()) == {
        "far": "nobody can",
        "never": "nobody can",
        "due": "due",
        "window": "window",
        "energy": "energy",
    }


def test_task_alone_may_take_many_swaps(make: Make) -> None:
    uav = {"u1": {"endurance_s": 50.0, "reserve_frac": 0.0}}
    bases = {f"b{i}": {"at": 50 * i, "swap_s": 1.0} for i in (1, 2, 3)}
    scenario = make({"t1": {"at": 170, "opens_s": 900.0}, "t2": {"at": 180}}, uav, bases)
    times = FlightTimes(scenario)

    can = [can_do_alone(scenario, times, scenario.uavs[0], task) for task in scenario.tasks]

    assert can == [True, False]


def test_popups_are_in_no_plan(make: Make) -> None:
    scenario = make({"t1": {"at": 10}, "late": {"at": 1, "appears_s": 3.0}})

    assert best_plan(scenario).lists == {"u1": (Work("t1"),)}
