"""The schedule of lists in the field, and why tasks are on none of them.

Leaves out: which lists (coordinator.planner.field_plan).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from swarm.allocation.field.problem import FieldProblem
from swarm.kernels.field import FlownLists
from swarm.kernels.field_alone import earliest_alone
from swarm.model import TaskId, UavId
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
    return ScheduleEntry(
        go, places[0], tuple(places[1:]), depart_s, arrive_s, begin_s, end_s, is_reversed
    )


def left_out(problem: FieldProblem, done: Sequence[int]) -> Mapping[TaskId, LeftOut]:
    """Why each task that is not among those ``done`` is on no list."""
    missing = np.setdiff1d(np.arange(problem.n_task), np.asarray(done, dtype=np.int64))
    if not len(missing):
        return {}
    alone_s = earliest_alone(problem.kernel, problem.first_s)
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
