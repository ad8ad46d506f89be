"""What given lists come to in the field: tasks and visits to bases, in the order of flight.

Leaves out: finding lists (coordinator.planner), and their schedule (coordinator.planner).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState
from swarm.kernels.field import FieldRefusal, FlownLists, fly_lists
from swarm.model import Evaluation, Mission, TaskId, UavId
from swarm.model.plan import at_base

_WHY = {
    FieldRefusal.INCAPABLE: "it cannot do that",
    FieldRefusal.NO_WAY: "there is no way to it, or home from it",
    FieldRefusal.WINDOW: "it comes after closes_s",
    FieldRefusal.DUE: "it would end after due_s",
    FieldRefusal.ENERGY: "its battery does not last for it and the way home",
}


def evaluate_in_field(mission: Mission, routes: Mapping[UavId, Sequence[str]]) -> Evaluation:
    """What lists are worth by eq. 1 under the mission's constraints.

    Args:
        mission: whose UAVs, tasks and bases.
        routes: ids of tasks, and of bases as `at_base` writes them, by UAV id; UAVs that are left
            out do nothing.

    Raises:
        ValueError: an id is unknown, a task is on the lists twice, or something on a list cannot
            be done there.
    """
    problem = FieldProblem.from_mission(mission)
    items = {str(task): 2 * column for column, task in enumerate(problem.task_ids)}
    items |= {at_base(base): -1 - number for number, base in enumerate(problem.base_ids)}
    named = [name for names in routes.values() for name in names]
    if lacking := [name for name in named if name not in items]:
        raise ValueError(f"no such task or base in {mission.name}: {', '.join(lacking)}")
    tasks = [name for name in named if items[name] >= 0]
    if twice := sorted({name for name in tasks if tasks.count(name) > 1}):
        raise ValueError(f"more than once on the lists: {', '.join(twice)}")
    lists = [[items[name] for name in routes.get(uav, ())] for uav in problem.uav_ids]
    flown = _best_ways(problem, lists)
    for row, uav in enumerate(problem.uav_ids):
        why = FieldRefusal(int(flown.refusal[row]))
        if why is not FieldRefusal.NONE:
            name = routes[uav][int(flown.done[row])]
            raise ValueError(f"{uav} cannot do {name} there: {_WHY[why]}")
    ends_s = flown.times_s[:, 3].tolist()
    order = [item for items_of in lists for item in items_of]
    done_s = {
        TaskId(problem.task_ids[item // 2]): end_s
        for item, end_s in zip(order, ends_s, strict=True)
        if item >= 0
    }
    return Evaluation(float(flown.value.sum()), done_s)


def _best_ways(problem: FieldProblem, lists: list[list[int]]) -> FlownLists:
    """The schedule of ``lists``, in which each line is turned if that is better, one by one."""
    state = FieldState.at_start(problem)
    flown = fly_lists(problem.kernel, state, lists)
    for items in lists:
        for place, item in enumerate(items):
            if item < 0 or not problem.is_line[item // 2]:
                continue
            items[place] = item ^ 1
            turned = fly_lists(problem.kernel, state, lists)
            if _rank(turned) > _rank(flown):
                flown = turned
            else:
                items[place] = item
    return flown


def _rank(flown: FlownLists) -> tuple[int, float]:
    """How good lists are: by what can be done of them, then by J."""
    return int(flown.done.sum()), float(flown.value.sum())
