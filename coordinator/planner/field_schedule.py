"""The schedule of lists, straight or in the field, and why tasks are on none of them.

Leaves out: which lists (coordinator.planner.plan, coordinator.planner.field_plan).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.problem import FloatArray, Problem
from swarm.kernels.field import FlownLists
from swarm.kernels.field_alone import earliest_alone
from swarm.model import Plan, TaskId, UavId
from swarm.model.plan import START, LeftOut, ScheduleEntry, at_base


def schedule_of(
    problem: FieldProblem, lists: Sequence[Sequence[int]], flown: FlownLists
) -> dict[UavId, tuple[ScheduleEntry, ...]]:
    """Every UAV's legs in the order of flight, with the ways that they take round zones.

    Args:
        problem: the mission, whose places are known.
        lists: items per UAV, all of which can be done.
        flown: their times.
    """
    schedule = {}
    row = 0
    for uav, items in enumerate(lists):
        here, entries = uav, []
        for item in items:
            there, after, go = _target(problem, item)
            times_s = flown.times_s[row].tolist()
            is_reversed = item >= 0 and item % 2 == 1
            entries.append(_entry(problem, uav, (here, there), go, times_s, is_reversed))
            here = after
            row += 1
        if items:
            base = int(flown.home[uav])
            there = uav if base < 0 else problem.n_uav + base
            go = START if base < 0 else at_base(problem.base_ids[base])
            depart_s, arrive_s = flown.home_s[uav].tolist()
            times_s = [depart_s, arrive_s, arrive_s, arrive_s]
            entries.append(_entry(problem, uav, (here, there), go, times_s))
        schedule[problem.uav_ids[uav]] = tuple(entries)
    return schedule


def _target(problem: FieldProblem, item: int) -> tuple[int, int, str]:
    """Nodes where an item begins and ends, and its name in a schedule."""
    if item < 0:
        node = problem.n_uav - 1 - item
        return node, node, at_base(problem.base_ids[-1 - item])
    task, way = divmod(item, 2)
    enter, leave = problem.enter[task, [way, 1 - way]].tolist()
    return enter, leave, problem.task_ids[task]


def _entry(
    problem: FieldProblem,
    uav: int,
    nodes: tuple[int, int],
    go: str,
    times_s: Sequence[float],
    is_reversed: bool = False,
) -> ScheduleEntry:
    corners_m = problem.corners_m(uav, *nodes)
    if corners_m is None:
        raise ValueError(f"{problem.uav_ids[uav]} has no way to {go}")
    places = [(east_m, north_m) for east_m, north_m in corners_m[:, :2].tolist()]
    depart_s, arrive_s, begin_s, end_s = times_s
    flown_m = None if problem.network is None else problem.network.flown_between_m(uav, *nodes)
    up_m = () if flown_m is None else tuple(flown_m[:, 2].tolist())
    return ScheduleEntry(
        go, places[0], tuple(places[1:]), depart_s, arrive_s, begin_s, end_s, is_reversed, up_m
    )


def with_straight_schedule(plan: Plan, problem: Problem) -> Plan:
    """A ``plan`` of the planner for the paper's missions with its schedule.

    Legs are straight, work begins at once and each list ends with the way home to the start, so
    nothing is worked out but the legs that are flown.
    """
    columns = {task: column for column, task in enumerate(problem.task_ids)}
    schedule = {}
    for uav, name in enumerate(problem.uav_ids):
        route = [columns[task] for task in plan.routes[name]]
        start_m = problem.start_enu_m[uav]
        legs_s = problem.travel_along_s(uav, start_m, route).tolist()
        here, now_s, entries = _on_map(start_m), 0.0, []
        for task, leg_s in zip(route, legs_s, strict=True):
            there, arrive_s = _on_map(problem.task_enu_m[task]), now_s + leg_s
            end_s = arrive_s + float(problem.service_s[task])
            go = problem.task_ids[task]
            entries.append(
                ScheduleEntry(go, here, (there,), now_s, arrive_s, arrive_s, end_s, False)
            )
            here, now_s = there, end_s
        if route:
            home_s = now_s + float(problem.travel_along_s(uav, start_m, route[-1:])[0])  # both ways
            way = (_on_map(start_m),)
            entries.append(ScheduleEntry(START, here, way, now_s, home_s, home_s, home_s, False))
        schedule[name] = tuple(entries)
    missing = [task for task in problem.task_ids if task not in plan.completion_s]
    return replace(
        plan,
        sequence=problem.uav_ids if plan.sequence is None else plan.sequence,
        schedule=schedule,
        left_out=dict.fromkeys(missing, LeftOut.NOBODY_CAN),
        required_left_out=len(missing),
        fewest_left_out=len(missing),
    )


def _on_map(place_enu_m: FloatArray) -> tuple[float, float]:
    east_m, north_m, _ = place_enu_m.tolist()
    return east_m, north_m


def left_out(
    problem: FieldProblem, state: FieldState, listed: Sequence[int]
) -> dict[TaskId, LeftOut]:
    """Why each task that is open in ``state`` and not ``listed`` is on no list."""
    missing = np.setdiff1d(np.flatnonzero(state.open), np.asarray(listed, dtype=np.int64))
    if not len(missing):
        return {}
    alone_s = earliest_alone(problem.kernel, state)
    somebody_can = np.any(np.isfinite(alone_s), axis=0)
    reasons = {}
    for task in missing.tolist():
        if not somebody_can[task]:
            reason = LeftOut.NOBODY_CAN
        elif not problem.required[task]:
            reason = LeftOut.DUE
        elif np.isfinite(problem.closes_s[task]):
            reason = LeftOut.WINDOW
        else:
            reason = LeftOut.ENERGY
        reasons[problem.task_ids[task]] = reason
    return reasons
