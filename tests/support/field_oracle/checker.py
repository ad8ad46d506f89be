"""Holds the JSON of a plan or a simulation against its scenario, with readable complaints.

`check_plan` for every plan of every method; `check_simulation` has the plan's and what was
executed; `check_against_best` needs a brute force of `tests.support.field_oracle.brute`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from tests.support.field_oracle.brute import Best, reasons_left_out
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario, FieldUav
from tests.support.field_oracle.walk import ENTRY_KEYS, Slack, check_slots, intrusion_m, walk

Json = Mapping[str, Any]
Schedule = Mapping[str, Sequence[Json]]

PLAN_KEYS = (
    "scenario",
    "method",
    "objective",
    "sequence",
    "routes",
    "completion_s",
    "optimum",
    "gap",
    "schedule",
    "left_out",
)


def check_plan(
    scenario: FieldScenario,
    result: Json,
    times: FlightTimes | None = None,
    slack: Slack | None = None,
) -> list[str]:
    """All complaints about the plan in ``result``; an empty list praises it.

    Args:
        scenario: what was planned for.
        result: the JSON of plan, simulate or run.
        times: the scenario's legs, if they are at hand.
        slack: what is forgiven.
    """
    times = times or FlightTimes(scenario)
    slack = slack or Slack()
    ill_formed = [*_missing(result, PLAN_KEYS)]
    if not ill_formed:
        ill_formed = [*_form(scenario, result["schedule"]), *_names(scenario, result)]
    if ill_formed:
        return ill_formed
    schedule: Schedule = result["schedule"]
    found: list[str] = []
    for uav in scenario.uavs:
        found += walk(scenario, times, uav, schedule[uav.id], slack)
    found += check_slots(scenario, schedule, result["sequence"], slack)
    found += _totals(scenario, times, result, slack)
    return found


def check_simulation(
    scenario: FieldScenario,
    result: Json,
    times: FlightTimes | None = None,
    slack: Slack | None = None,
    *,
    as_planned: bool = False,
    exit_status: int | None = None,
) -> list[str]:
    """All complaints about the plan in ``result`` and about what was executed.

    Args:
        scenario: what was flown.
        result: the JSON of simulate or run.
        times: the scenario's legs, if they are at hand.
        slack: what is forgiven.
        as_planned: nothing was to disturb the plan: what was executed equals it.
        exit_status: the command's, if it is to be checked.
    """
    times = times or FlightTimes(scenario)
    slack = slack or Slack()
    found = check_plan(scenario, result, times, slack)
    more = ("executed_schedule", "executed_routes", "open", "done", "closest_approach_m")
    ill_formed = [*_missing(result, more)]
    if not ill_formed:
        ill_formed = [*_form(scenario, result["executed_schedule"])]
    if ill_formed:
        return found + ill_formed
    found += _closest_approach(scenario, result["closest_approach_m"])
    for uav in scenario.uavs:
        found += _executed(scenario, uav, result, result["executed_schedule"][uav.id], slack)
    # What is left out is open, unless something disturbed the plan and somebody got round to it.
    tried = () if as_planned else (*result["done"], *result.get("failed", ()))
    for name in result.get("left_out", {}):
        if name not in (*result["open"], *tried):
            found.append(f"{name} is left out, but not open")
    if as_planned:
        found += _same(result["schedule"], result["executed_schedule"], slack)
    if exit_status is not None:
        found += _exit_status(scenario, times, result, exit_status)
    return found


def check_against_best(
    scenario: FieldScenario, result: Json, best: Best, *, exact: bool
) -> list[str]:
    """Complaints about a plan that is better than the best, or is to be it and is not."""
    required = {task.id for task in scenario.known if task.due_s is None}
    n_left_out = len(required - {task for route in result["routes"].values() for task in route})
    allowed = 1e-9 * max(1.0, abs(best.objective))
    ahead = (best.n_left_out - n_left_out, result["objective"] - best.objective)
    found = []
    if ahead[0] > 0 or (ahead[0] == 0 and ahead[1] > allowed):
        found.append("it is better than the best of all")
    if exact and (ahead[0] < 0 or (ahead[0] == 0 and ahead[1] < -allowed)):
        found.append("it is not the best")
    if found:
        told = f"{n_left_out} left out, J {result['objective']}"
        return [f"{f}: {told}; best {best.n_left_out}, J {best.objective}" for f in found]
    optimum = result["optimum"]
    if optimum is not None and abs(optimum - best.objective) > allowed:
        return [f"optimum is {optimum}, not {best.objective}"]
    if n_left_out > best.n_left_out and result["gap"] is not None:
        return ["gap is not null, although more tasks are left out than in the optimum"]
    return []


def value_of(scenario: FieldScenario, schedule: Schedule) -> float:
    """J of eq. 1 of the ends that ``schedule`` tells."""
    total = 0.0
    for uav in scenario.uavs:
        survival = 1.0
        for entry in schedule[uav.id][:-1]:
            if entry["go"].startswith("base:"):
                continue
            task = scenario.task(entry["go"])
            left_s = scenario.worth_until_s(task) - entry["end_s"]
            total += scenario.success(uav, task) * survival * task.value * left_s
            survival *= scenario.survival(uav, task)
    return total


def _missing(result: Json, keys: Sequence[str]) -> Iterator[str]:
    yield from (f"there is no {key!r}" for key in keys if key not in result)


def _form(scenario: FieldScenario, schedule: Schedule) -> Iterator[str]:
    """Complaints about keys and types."""
    if sorted(schedule) != sorted(uav.id for uav in scenario.uavs):
        yield f"the schedule is of {sorted(schedule)}"
        return
    for name, entries in schedule.items():
        for index, entry in enumerate(entries):
            where = f"{name}[{index}]"
            if sorted(entry) != sorted(ENTRY_KEYS):
                yield f"{where} has the keys {sorted(entry)}, not {sorted(ENTRY_KEYS)}"
                continue
            if not isinstance(entry["go"], str) or not isinstance(entry["reversed"], bool):
                yield f"{where}: go is a name, reversed true or false"
            for key in ("depart_s", "arrive_s", "begin_s", "end_s"):
                if not _is_number(entry[key]):
                    yield f"{where}: {key} is {entry[key]!r}"
            for point in (entry["from_m"], *entry["via_m"]):
                if len(point) != 2 or not all(map(_is_number, point)):
                    yield f"{where}: {point!r} is not [x, y]"
            if not entry["via_m"]:
                yield f"{where}: via_m is empty, its last is where the work begins"


def _names(scenario: FieldScenario, result: Json) -> Iterator[str]:
    if result["scenario"] != scenario.name:
        yield f"it is of the scenario {result['scenario']!r}"
    if sorted(result["sequence"]) != sorted(uav.id for uav in scenario.uavs):
        yield f"the sequence {result['sequence']} is not of the UAVs"


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, float | int):
        return False
    return math.isfinite(value)


def _totals(
    scenario: FieldScenario, times: FlightTimes, result: Json, slack: Slack
) -> Iterator[str]:
    schedule: Schedule = result["schedule"]
    ends_s: dict[str, float] = {}
    routes: dict[str, list[str]] = {}
    known = {task.id for task in scenario.known}
    for name, entries in schedule.items():
        work = [entry for entry in entries[:-1] if not entry["go"].startswith("base:")]
        routes[name] = [entry["go"] for entry in work]
        for entry in work:
            if entry["go"] in ends_s:
                yield f"{entry['go']} is in two places"
            if entry["go"] not in known:
                yield f"{entry['go']} is no task that a plan knows"
                return
            ends_s[entry["go"]] = entry["end_s"]
    if {name: list(route) for name, route in result["routes"].items()} != routes:
        yield f"routes are {result['routes']}, by the schedule {routes}"
    told_s = result["completion_s"]
    if sorted(told_s) != sorted(ends_s):
        yield f"completion_s is of {sorted(told_s)}, done are {sorted(ends_s)}"
    elif any(abs(told_s[task] - end_s) > slack.time_s for task, end_s in ends_s.items()):
        yield f"completion_s is {told_s}, by the schedule {ends_s}"
    value = value_of(scenario, schedule)
    if abs(result["objective"] - value) > 1e-9 * max(1.0, abs(value)):
        yield f"objective is {result['objective']}, by the schedule {value}"
    reasons = reasons_left_out(scenario, times, frozenset(ends_s))
    if dict(result["left_out"]) != reasons:
        yield f"left_out is {dict(result['left_out'])}, not {reasons}"
    optimum, gap = result["optimum"], result["gap"]
    if optimum is not None and gap is not None and optimum != 0.0:
        right = (optimum - result["objective"]) / abs(optimum)
        if abs(gap - right) > 1e-9:
            yield f"gap is {gap}, not {right}"


def _executed(
    scenario: FieldScenario,
    uav: FieldUav,
    result: Json,
    entries: Sequence[Json],
    slack: Slack,
) -> Iterator[str]:
    """Complaints about what holds whatever happens: order, windows, due, zones, energy."""
    airborne_s, budget_s, since_s = 0.0, uav.first_budget_s, 0.0
    for index, entry in enumerate(entries):
        where = f"executed {uav.id}[{index}] {entry['go']}"
        stations = [entry[key] for key in ("depart_s", "arrive_s", "begin_s", "end_s")]
        if any(b < a - slack.time_s for a, b in itertools.pairwise(stations)):
            yield f"{where}: its times go back: {stations}"
        points = [entry["from_m"], *entry["via_m"]]
        for zone, (a, b) in itertools.product(scenario.zones, itertools.pairwise(points)):
            everywhere = zone.floor_m == -math.inf and zone.ceiling_m == math.inf
            deep_m = intrusion_m(zone, (a[0], a[1]), (b[0], b[1]), scenario.margin_m)
            if everywhere and deep_m > slack.place_m + slack.arc_frac * scenario.margin_m:
                yield f"{where}: flies {deep_m} m into zone {zone.id} or its margin"
        task = next((task for task in scenario.tasks if task.id == entry["go"]), None)
        if task is not None and task.id in result["done"]:
            if not task.opens_s - slack.time_s <= entry["begin_s"] <= task.closes_s + slack.time_s:
                yield f"{where}: began at {entry['begin_s']} s, not within its window"
            if task.due_s is not None and entry["end_s"] > task.due_s + slack.time_s:
                yield f"{where}: ended at {entry['end_s']} s, was due at {task.due_s} s"
        if index > 0 and _lands(entries[index - 1]):
            since_s = entry["depart_s"]
            if entries[index - 1]["go"] != "start":
                airborne_s, budget_s = 0.0, uav.full_budget_s
        until_s = entry["begin_s" if _lands(entry) else "end_s"]
        airborne_s, since_s = airborne_s + until_s - since_s, until_s
        if airborne_s > budget_s + slack.time_s:
            yield f"{where}: {airborne_s} s airborne, {budget_s} s allowed"


def _lands(entry: Json) -> bool:
    go: str = entry["go"]
    return go == "start" or go.startswith("base:")


def _closest_approach(scenario: FieldScenario, told_m: object) -> Iterator[str]:
    if len(scenario.uavs) == 1:
        if told_m is not None:
            yield f"closest_approach_m of a single UAV is {told_m}"
    elif told_m is not None and (not isinstance(told_m, float | int) or told_m < 0.0):
        yield f"closest_approach_m is {told_m}"


def _same(plan: Schedule, executed: Schedule, slack: Slack) -> Iterator[str]:
    for name, entries in plan.items():
        if [e["go"] for e in entries] != [e["go"] for e in executed[name]]:
            yield f"{name} went {[e['go'] for e in executed[name]]}, planned otherwise"
            continue
        for index, (told, flown) in enumerate(zip(entries, executed[name], strict=True)):
            for key in ("depart_s", "arrive_s", "begin_s", "end_s"):
                if abs(told[key] - flown[key]) > slack.time_s:
                    yield f"{name}[{index}]: {key} was {flown[key]}, planned {told[key]}"


def _exit_status(
    scenario: FieldScenario, times: FlightTimes, result: Json, status: int
) -> Iterator[str]:
    """1 only if a task without due_s that could be done was not."""
    reasons = reasons_left_out(scenario, times, frozenset(result["done"]))
    missed = [
        name
        for name, reason in reasons.items()
        if reason != "nobody can" and scenario.task(name).due_s is None
    ]
    if status == 1 and not missed:
        yield "exit status 1, but every task without due_s that can be done was"
    if status == 0 and missed:
        yield f"exit status 0, but {missed} could be done and were not"
