"""What is left undone at the end of a flown mission, by an independent reading of the rule.

In the end no task without due_s is open that some living UAV could still do, from its place and
charge when it was sent home, as its only task, with as many swaps as that takes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from sim.world.flight_log import LastSeen
from sim.world.virtual_world import World
from swarm.model import Mission
from tests.support.field_oracle.flight import FlightTimes
from tests.support.field_oracle.scenario import FieldScenario, FieldTask, FieldUav, Stop, read
from tests.support.field_oracle.schedule import (
    Flown,
    Refused,
    Work,
    do_task,
    reach_base,
    swap_there,
)

SAME_PLACE_M = 1.0


@dataclass(frozen=True, slots=True)
class Leftover:
    """A task that somebody could have done."""

    task: str
    uav: str
    at_s: float
    """When that UAV was sent home [s mission time]."""


def as_flown(draft: Mapping[str, Any], mission: Mission) -> FieldScenario:
    """The scenario of ``draft`` with tasks that appear when they did in ``mission``.

    A task that appears later than it says has its window and its due time as much later as it has
    been open without anybody's knowledge.
    """
    appears_s = {str(task.id): task.appears_s for task in mission.tasks}
    rows = [
        _as_it_appeared(row, appears_s[row["id"]])
        for row in draft["task"]
        if row["id"] in appears_s
    ]
    return read({**draft, "task": rows})


def _as_it_appeared(row: Mapping[str, Any], appears_s: float) -> dict[str, Any]:
    moved = {**row, "appears_s": appears_s}
    late_s = max(0.0, appears_s - row.get("opens_s", 0.0))
    if appears_s != row.get("appears_s", 0.0) and late_s > 0.0:
        if "closes_s" in row:
            moved |= {"opens_s": appears_s, "closes_s": row["closes_s"] + late_s}
        if "due_s" in row:
            moved["due_s"] = row["due_s"] + late_s
    return moved


def leftovers(
    scenario: FieldScenario, world: World, patience_s: float, times: FlightTimes | None = None
) -> list[Leftover]:
    """Open tasks, each with a UAV that could have done it when it was sent home.

    Args:
        scenario: what was flown, pop-ups as they came.
        world: the flight, which is over.
        patience_s: who could have done it only with less time to spare is not held to it.
        times: the scenario's legs, if they are at hand.
    """
    times = times or FlightTimes(scenario)
    state = world.mission_state
    open_tasks = [task for task in scenario.tasks if task.id in state.result().open]
    found = []
    for uav in scenario.uavs:
        seen = world.flight_log.last_seen.get(uav.id)
        if seen is None or uav.id not in world.finished:
            continue
        at_s = seen.at_s - (world.zero_s or 0.0)
        there = _without_blocked_bases(scenario, world, seen.at_s)
        for task in open_tasks:
            wanted = task.due_s is None and task.appears_s <= at_s
            if wanted and could_still_do(there, times, uav, task, seen, at_s, patience_s):
                found.append(Leftover(task.id, uav.id, at_s))
    return found


def _without_blocked_bases(scenario: FieldScenario, world: World, at_s: float) -> FieldScenario:
    """Only bases of which lost UAVs have left a slot free: those stand there for good."""
    standing: list[str] = [
        stay.base
        for stay in world.flight_log.stays
        if stay.begin_s <= at_s and stay.end_s == math.inf and stay.uav not in world.finished
    ]
    free = [b for b in scenario.bases if b.slots is None or standing.count(b.id) < b.slots]
    return replace(scenario, bases=tuple(free))


def could_still_do(
    scenario: FieldScenario,
    times: FlightTimes,
    uav: FieldUav,
    task: FieldTask,
    seen: LastSeen,
    at_s: float,
    patience_s: float,
) -> bool:
    """Whether ``uav`` could do ``task`` as its only one, as it was ``seen`` at ``at_s``."""
    ready: dict[str, Flown] = {}
    for flown in _begins(scenario, uav, seen, at_s, patience_s):
        ready[flown.here.name] = flown
    unseen = list(ready)
    while unseen:
        unseen.sort(key=lambda name: ready[name].time_s)
        flown = ready[unseen.pop(0)]
        for backwards in (False, True) if task.is_line else (False,):
            late = replace(task, closes_s=task.closes_s - patience_s)
            tasks = tuple(late if each is task else each for each in scenario.tasks)
            stricter = replace(scenario, tasks=tasks)
            if not isinstance(
                do_task(stricter, times, uav, flown, Work(task.id, backwards)), Refused
            ):
                return True
        if uav.endurance_s == math.inf:
            continue
        for base in scenario.bases:
            if flown.landed and base.stop.name == flown.here.name:
                continue
            reached = reach_base(times, uav, flown, base)
            if isinstance(reached, Refused):
                continue
            step = swap_there(uav, flown, *reached, base, reached[0].time_s)
            if isinstance(step, Refused):
                continue
            known = ready.get(base.stop.name)
            if known is None or step[0].time_s < known.time_s:
                ready[base.stop.name] = step[0]
                unseen.append(base.stop.name)
    return False


def _begins(
    scenario: FieldScenario, uav: FieldUav, seen: LastSeen, at_s: float, patience_s: float
) -> list[Flown]:
    """Where it was: in the air with what it had left, or ready on the ground of a base."""
    east_m, north_m, up_m = seen.place_enu_m
    if not seen.flies:
        for base in scenario.bases:
            if math.dist(base.stop.at, (east_m, north_m)) <= SAME_PLACE_M:
                full_s = uav.full_budget_s
                return [Flown(at_s + base.swap_s, base.stop, True, 0.0, full_s, 1.0, 0.0)]
        return []
    here = Stop(f"{uav.id} at {at_s} s", (east_m, north_m), up_m - uav.layer_m, in_layer=True)
    budget_s = math.inf
    if uav.endurance_s < math.inf and seen.battery_frac is not None:
        full_s = uav.endurance_s - uav.full_budget_s
        budget_s = seen.battery_frac * uav.endurance_s - full_s - patience_s
    return [Flown(at_s, here, False, 0.0, budget_s, 1.0, 0.0)]
