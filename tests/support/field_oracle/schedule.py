"""The schedule of a list: windows, due times, energy with swaps, what it is worth.

Leaves out: who waits for a slot (tests.support.field_oracle.slots) and which list is best
(tests.support.field_oracle.brute).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tests.support.field_oracle.flight import FlightTimes, Leg
from tests.support.field_oracle.scenario import (
    FieldBase,
    FieldScenario,
    FieldTask,
    FieldUav,
    Point,
    Stop,
)

TOLERANCE_S = 1e-6


@dataclass(frozen=True, slots=True)
class Work:
    """An item of a list: a task, and of a line the direction."""

    task: str
    backwards: bool = False


@dataclass(frozen=True, slots=True)
class Swap:
    """An item of a list: a visit to a base."""

    base: str


Item = Work | Swap


@dataclass(frozen=True, slots=True)
class Entry:
    """What the fixed JSON tells of one item of a schedule."""

    go: str
    from_m: Point
    via_m: tuple[Point, ...]
    depart_s: float
    arrive_s: float
    begin_s: float
    end_s: float
    reversed: bool

    def as_json(self) -> dict[str, Any]:
        """The JSON object."""
        return {
            "go": self.go,
            "from_m": list(self.from_m),
            "via_m": [list(point) for point in self.via_m],
            "depart_s": self.depart_s,
            "arrive_s": self.arrive_s,
            "begin_s": self.begin_s,
            "end_s": self.end_s,
            "reversed": self.reversed,
        }


@dataclass(frozen=True, slots=True)
class Flown:
    """How far a UAV has come in its list."""

    time_s: float
    here: Stop
    landed: bool
    """Since a swap, and not yet departed again."""
    airborne_s: float
    """In this sortie."""
    budget_s: float
    """What this sortie may take."""
    survival: float
    """S of eq. 1 of the next task."""
    value: float
    """Of eq. 1 so far."""


@dataclass(frozen=True, slots=True)
class Refused:
    """An item that can't be done there."""

    item: str
    reason: str


@dataclass(frozen=True, slots=True)
class Flight:
    """A list, flown: all of it, or up to what can't be done."""

    entries: tuple[Entry, ...]
    value: float
    refused: Refused | None = None


def take_off(uav: FieldUav) -> Flown:
    """Mission time 0: airborne at the start."""
    return Flown(0.0, uav.start, False, 0.0, uav.first_budget_s, 1.0, 0.0)


def departure_s(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, flown: Flown, item: Item
) -> float:
    """When the UAV departs to ``item``: at once, unless it waits on the ground after a swap."""
    if flown.landed and isinstance(item, Work):
        task = scenario.task(item.task)
        leg = times.leg(uav, flown.here, task.way(backwards=item.backwards)[0])
        if leg is not None:
            return max(flown.time_s, task.opens_s - leg.time_s)
    return flown.time_s


def do_task(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, flown: Flown, item: Work
) -> tuple[Flown, Entry] | Refused:
    """The next item is a task."""
    task = scenario.task(item.task)
    way = task.way(backwards=item.backwards)
    leg = times.leg(uav, flown.here, way[0])
    line_s = times.line_s(uav, task, backwards=item.backwards)
    success = scenario.success(uav, task)
    if success == 0.0:
        return Refused(task.id, "its p is 0")
    if leg is None or line_s is None:
        return Refused(task.id, "there is no way")
    depart_s = departure_s(scenario, times, uav, flown, item)
    arrive_s = depart_s + leg.time_s
    begin_s = max(arrive_s, task.opens_s)
    end_s = begin_s + line_s + task.service_s
    airborne_s = flown.airborne_s + (end_s - depart_s)
    if begin_s > task.closes_s + TOLERANCE_S:
        return Refused(task.id, f"begins at {begin_s} s, closes at {task.closes_s} s")
    if task.due_s is not None and end_s > task.due_s + TOLERANCE_S:
        return Refused(task.id, f"ends at {end_s} s, is due at {task.due_s} s")
    home = times.home(uav, way[-1])
    if home is None:
        return Refused(task.id, "there is no way home from it")
    if airborne_s + home[1].time_s > flown.budget_s + TOLERANCE_S:
        needed_s = airborne_s + home[1].time_s
        return Refused(task.id, f"energy: {needed_s} s airborne, {flown.budget_s} s allowed")
    gain = success * flown.survival * task.value * (scenario.worth_until_s(task) - end_s)
    entry = _entry(f"{task.id}", flown, leg, depart_s, (begin_s, end_s), item.backwards)
    after = Flown(
        time_s=end_s,
        here=way[-1],
        landed=False,
        airborne_s=airborne_s,
        budget_s=flown.budget_s,
        survival=flown.survival * scenario.survival(uav, task),
        value=flown.value + gain,
    )
    return after, entry


def reach_base(
    times: FlightTimes, uav: FieldUav, flown: Flown, base: FieldBase
) -> tuple[Flown, Leg] | Refused:
    """The next item is a base: up to the arrival above it."""
    leg = times.leg(uav, flown.here, base.stop)
    if leg is None:
        return Refused(f"base:{base.id}", "there is no way")
    arrived = replace(
        flown,
        time_s=flown.time_s + leg.time_s,
        here=base.stop,
        landed=False,
        airborne_s=flown.airborne_s + leg.time_s,
    )
    return arrived, leg


def swap_there(
    uav: FieldUav, before: Flown, arrived: Flown, leg: Leg, base: FieldBase, begin_s: float
) -> tuple[Flown, Entry] | Refused:
    """The swap of a UAV that has arrived at ``base`` and touches down at ``begin_s``."""
    airborne_s = arrived.airborne_s + (begin_s - arrived.time_s)
    if airborne_s > arrived.budget_s + TOLERANCE_S:
        return Refused(
            f"base:{base.id}", f"energy: {airborne_s} s airborne, {arrived.budget_s} s allowed"
        )
    end_s = begin_s + base.swap_s
    entry = _entry(f"base:{base.id}", before, leg, before.time_s, (begin_s, end_s), False)
    ready = replace(arrived, time_s=end_s, landed=True, airborne_s=0.0, budget_s=uav.full_budget_s)
    return ready, entry


def go_home(times: FlightTimes, uav: FieldUav, flown: Flown) -> Entry | Refused:
    """The way home that ends a list; the energy for it was checked at the last item."""
    home = times.home(uav, flown.here)
    if home is None:
        return Refused("home", "there is no way")
    stop, leg = home
    arrive_s = flown.time_s + leg.time_s
    go = "start" if stop is uav.start else stop.name
    return _entry(go, flown, leg, flown.time_s, (arrive_s, arrive_s), False)


def fly_alone(
    scenario: FieldScenario, times: FlightTimes, uav: FieldUav, items: Sequence[Item]
) -> Flight:
    """The schedule of a list as if every base had a slot free."""
    flown = take_off(uav)
    entries: list[Entry] = []
    for item in items:
        if isinstance(item, Work):
            step = do_task(scenario, times, uav, flown, item)
        else:
            base = scenario.base(item.base)
            reached = reach_base(times, uav, flown, base)
            if isinstance(reached, Refused):
                return Flight(tuple(entries), flown.value, reached)
            step = swap_there(uav, flown, *reached, base, reached[0].time_s)
        if isinstance(step, Refused):
            return Flight(tuple(entries), flown.value, step)
        flown, entry = step
        entries.append(entry)
    if items:
        last = go_home(times, uav, flown)
        if isinstance(last, Refused):
            return Flight(tuple(entries), flown.value, last)
        entries.append(last)
    return Flight(tuple(entries), flown.value)


def tasks_of(lists: Mapping[str, Sequence[Item]]) -> list[str]:
    """All tasks of some lists."""
    return [item.task for items in lists.values() for item in items if isinstance(item, Work)]


def left_behind(scenario: FieldScenario, lists: Mapping[str, Sequence[Item]]) -> list[FieldTask]:
    """The known tasks that are in no list."""
    done = set(tasks_of(lists))
    return [task for task in scenario.known if task.id not in done]


def _entry(
    go: str,
    flown: Flown,
    leg: Leg,
    depart_s: float,
    work_s: tuple[float, float],
    backwards: bool,
) -> Entry:
    return Entry(
        go=go,
        from_m=flown.here.at,
        via_m=leg.way.points[1:],
        depart_s=depart_s,
        arrive_s=depart_s + leg.time_s,
        begin_s=work_s[0],
        end_s=work_s[1],
        reversed=backwards,
    )
