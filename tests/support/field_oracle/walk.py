"""Goes through the schedules of a plan's JSON, entry by entry, and complains.

Each entry is held against the one before it as the JSON tells it, so that one fault makes one
complaint. Leaves out: totals of the plan (tests.support.field_oracle.checker).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tests.support.field_oracle.flight import FlightTimes, Leg
from tests.support.field_oracle.rounded import distance_m
from tests.support.field_oracle.scenario import (
    FieldBase,
    FieldScenario,
    FieldTask,
    FieldUav,
    FieldZone,
    Point,
    Stop,
)

ENTRY_KEYS = (
    "go",
    "from_m",
    "via_m",
    "depart_s",
    "arrive_s",
    "begin_s",
    "end_s",
    "reversed",
)


@dataclass(frozen=True, slots=True)
class Slack:
    """What is forgiven."""

    time_s: float = 2e-6
    """The text's tolerance of limits, and as much for roundings."""
    place_m: float = 1e-6
    arc_frac: float = 1e-3
    """With a margin: of lengths, times and the margin, for chains in the place of arcs."""

    def leg_s(self, scenario: FieldScenario, leg: Leg) -> float:
        """Of the time of a leg."""
        return self.time_s + (self.arc_frac * leg.time_s if scenario.margin_m > 0.0 else 0.0)


@dataclass(slots=True)
class _Here:
    """Where the walk stands."""

    stop: Stop
    time_s: float
    airborne_s: float
    budget_s: float
    landed: bool = False
    after_task: bool = False


def walk(
    scenario: FieldScenario,
    times: FlightTimes,
    uav: FieldUav,
    entries: Sequence[Mapping[str, Any]],
    slack: Slack,
) -> Iterator[str]:
    """Complaints about the schedule of ``uav``; slots are not looked at."""
    here = _Here(uav.start, 0.0, 0.0, uav.first_budget_s)
    for index, entry in enumerate(entries):
        where = f"{uav.id}[{index}] {entry['go']}"
        target = _target(scenario, uav, entry, is_last=index == len(entries) - 1)
        if isinstance(target, str):
            yield f"{where}: {target}"
            return
        stop, place = target
        if index == len(entries) - 1 and not here.after_task:
            yield f"{where}: the way home does not follow a task"
        leg = times.leg(uav, here.stop, stop)
        if leg is None:
            yield f"{where}: there is no way from {here.stop.name}"
            return
        for complaint in (
            *_way(scenario, times, uav, here, stop, leg, entry, slack),
            *_departure(scenario, here, leg, entry, place, slack),
        ):
            yield f"{where}: {complaint}"
        if isinstance(place, FieldTask):
            complaints = _task(scenario, times, uav, here, entry, place, slack)
        elif isinstance(place, FieldBase):
            complaints = _swap(uav, here, entry, place, slack)
        else:
            complaints = _home(times, uav, here, leg, entry, slack)
        for complaint in complaints:
            yield f"{where}: {complaint}"


def _target(
    scenario: FieldScenario, uav: FieldUav, entry: Mapping[str, Any], *, is_last: bool
) -> tuple[Stop, FieldTask | FieldBase | None] | str:
    """Where an entry goes, and what is there; nothing at the way home; or a complaint."""
    go = entry["go"]
    bases = {f"base:{base.id}": base for base in scenario.bases}
    if entry["reversed"] and (is_last or go in bases):
        return "only lines are reversed"
    if is_last:
        if go == "start":
            return uav.start, None
        return (bases[go].stop, None) if go in bases else "a list ends with the way home"
    if go in bases:
        return bases[go].stop, bases[go]
    task = next((task for task in scenario.tasks if task.id == go), None)
    if task is None:
        return "there is no such task or base"
    if entry["reversed"] and not task.is_line:
        return "only lines are reversed"
    if scenario.success(uav, task) == 0.0:
        return "its p is 0"
    return task.way(backwards=entry["reversed"])[0], task


def _way(
    scenario: FieldScenario,
    times: FlightTimes,
    uav: FieldUav,
    here: _Here,
    stop: Stop,
    leg: Leg,
    entry: Mapping[str, Any],
    slack: Slack,
) -> Iterator[str]:
    points: list[Point] = [(x, y) for x, y in (entry["from_m"], *entry["via_m"])]
    if math.dist(points[0], here.stop.at) > slack.place_m:
        yield f"from_m is {points[0]}, not {here.stop.at}"
    if len(points) < 2 or math.dist(points[-1], stop.at) > slack.place_m:
        yield f"via_m ends at {points[-1]}, not at {stop.at}"
    length_m = math.fsum(math.dist(a, b) for a, b in itertools.pairwise(points))
    allowed_m = slack.place_m * len(points)
    if scenario.margin_m > 0.0:
        allowed_m += slack.arc_frac * leg.way.length_m
    if abs(length_m - leg.way.length_m) > allowed_m:
        yield f"its way is {length_m} m long, the shortest {leg.way.length_m} m"
    for zone in times.zones_of(uav, here.stop, stop):
        for a, b in itertools.pairwise(points):
            deep_m = intrusion_m(zone, a, b, scenario.margin_m)
            if deep_m > slack.place_m + slack.arc_frac * scenario.margin_m:
                yield f"from {a} to {b} it flies {deep_m} m into zone {zone.id} or its margin"


def _departure(
    scenario: FieldScenario,
    here: _Here,
    leg: Leg,
    entry: Mapping[str, Any],
    place: FieldTask | FieldBase | None,
    slack: Slack,
) -> Iterator[str]:
    depart_s = here.time_s
    if here.landed and isinstance(place, FieldTask):
        depart_s = max(depart_s, place.opens_s - leg.time_s)
    allowed_s = slack.leg_s(scenario, leg)
    yield from _differs("depart_s", entry["depart_s"], depart_s, allowed_s)
    yield from _differs("arrive_s", entry["arrive_s"], entry["depart_s"] + leg.time_s, allowed_s)


def _task(
    scenario: FieldScenario,
    times: FlightTimes,
    uav: FieldUav,
    here: _Here,
    entry: Mapping[str, Any],
    task: FieldTask,
    slack: Slack,
) -> Iterator[str]:
    backwards = entry["reversed"]
    line_s = times.line_s(uav, task, backwards=backwards)
    if line_s is None:
        yield "the line can't be flown"
        return
    begin_s = max(entry["arrive_s"], task.opens_s)
    end_s = entry["begin_s"] + line_s + task.service_s
    yield from _differs("begin_s", entry["begin_s"], begin_s, slack.time_s)
    yield from _differs("end_s", entry["end_s"], end_s, slack.time_s)
    if entry["begin_s"] > task.closes_s + slack.time_s:
        yield f"begins at {entry['begin_s']} s, closes at {task.closes_s} s"
    if task.due_s is not None and entry["end_s"] > task.due_s + slack.time_s:
        yield f"ends at {entry['end_s']} s, is due at {task.due_s} s"
    last = task.way(backwards=backwards)[-1]
    here.airborne_s += entry["end_s"] - entry["depart_s"]
    here.stop, here.time_s, here.landed, here.after_task = last, entry["end_s"], False, True
    home = times.home(uav, last)
    if home is None:
        yield "there is no way home from it"
    elif here.airborne_s + home[1].time_s > here.budget_s + slack.time_s:
        needed_s = here.airborne_s + home[1].time_s
        yield f"{needed_s} s airborne with the flight to {home[0].name}, {here.budget_s} s allowed"


def _swap(
    uav: FieldUav, here: _Here, entry: Mapping[str, Any], base: FieldBase, slack: Slack
) -> Iterator[str]:
    if base.slots is None:
        yield from _differs("begin_s", entry["begin_s"], entry["arrive_s"], slack.time_s)
    elif entry["begin_s"] < entry["arrive_s"] - slack.time_s:
        yield f"begin_s {entry['begin_s']} is before arrive_s {entry['arrive_s']}"
    yield from _differs("end_s", entry["end_s"], entry["begin_s"] + base.swap_s, slack.time_s)
    airborne_s = here.airborne_s + entry["begin_s"] - entry["depart_s"]
    if airborne_s > here.budget_s + slack.time_s:
        yield f"{airborne_s} s airborne at touch-down, {here.budget_s} s allowed"
    here.stop, here.time_s, here.landed, here.after_task = base.stop, entry["end_s"], True, False
    here.airborne_s, here.budget_s = 0.0, uav.full_budget_s


def _home(
    times: FlightTimes,
    uav: FieldUav,
    here: _Here,
    leg: Leg,
    entry: Mapping[str, Any],
    slack: Slack,
) -> Iterator[str]:
    quickest = times.home(uav, here.stop)
    if quickest is not None and leg.time_s > quickest[1].time_s + slack.time_s:
        yield f"takes {leg.time_s} s, but {quickest[0].name} is {quickest[1].time_s} s away"
    yield from _differs("begin_s", entry["begin_s"], entry["arrive_s"], slack.time_s)
    yield from _differs("end_s", entry["end_s"], entry["arrive_s"], slack.time_s)


def _differs(what: str, told: float, right: float, allowed: float) -> Iterator[str]:
    if abs(told - right) > allowed:
        yield f"{what} is {told}, not {right}"


def check_slots(
    scenario: FieldScenario,
    schedule: Mapping[str, Sequence[Mapping[str, Any]]],
    sequence: Sequence[str],
    slack: Slack,
) -> Iterator[str]:
    """Complaints about who holds which slot when."""
    for base in scenario.bases:
        if base.slots is None:
            continue
        visits = sorted(
            (entry["arrive_s"], sequence.index(name), name, entry["begin_s"], after["depart_s"])
            for name, entries in schedule.items()
            for entry, after in itertools.pairwise(entries)
            if entry["go"] == f"base:{base.id}"
        )
        free_from_s = [0.0] * base.slots
        for arrive_s, _, name, told_s, leaves_s in visits:
            begin_s = max(arrive_s, min(free_from_s))
            if abs(told_s - begin_s) > slack.time_s:
                yield f"{name} at base {base.id}: begin_s is {told_s}, a slot is free at {begin_s}"
            free_from_s[free_from_s.index(min(free_from_s))] = leaves_s


def intrusion_m(zone: FieldZone, a: Point, b: Point, margin_m: float) -> float:
    """How deep the straight piece reaches into ``zone`` or its margin, from below.

    Sampled every 2 m: a check that says how bad a way is, by other means than the search.
    """
    deepest_m = 0.0
    n = 2 + math.floor(math.dist(a, b) / 2.0)
    for index in range(n + 1):
        share = index / n
        point = (a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]))
        border_m = min(
            distance_m(point, point, c, d)
            for ring in zone.rings
            for c, d in zip(ring, [*ring[1:], ring[0]], strict=True)
        )
        signed_m = border_m if _is_within(zone, point) is zone.inclusive else -border_m
        deepest_m = max(deepest_m, margin_m - signed_m)
    return deepest_m


def _is_within(zone: FieldZone, point: Point) -> bool:
    """By the crossings of a ray to the east; near the border either way, as depth is 0 there."""
    x, y = point
    n_crossings = 0
    for ring in zone.rings:
        for (ax, ay), (bx, by) in zip(ring, [*ring[1:], ring[0]], strict=True):
            if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
                n_crossings += 1
    return n_crossings % 2 == 1
