"""Plain-loop definitions that fast code is tested against; nothing else calls them.

Written from DESIGN.md section 2 with floats and lists only, sharing no code with the
modules they check. Far too slow for real missions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import permutations

from swarm.allocation.problem import Problem

__all__ = ["completion_s", "extreme_values", "lists", "objective", "ordered_partitions"]

Lists = list[list[int]]


def completion_s(problem: Problem, routes: Sequence[Sequence[int]]) -> dict[int, float]:
    """t_i of every task on the lists [s]."""
    times_s: dict[int, float] = {}
    for uav, route in enumerate(routes):
        free_s = 0.0
        place = [float(c) for c in problem.start_enu_m[uav]]
        for task in route:
            free_s, place = _arrive(problem, uav, free_s, place, task)
            times_s[task] = free_s
    return times_s


def objective(problem: Problem, routes: Sequence[Sequence[int]]) -> float:
    """J of eq. 1 [value·s]."""
    times_s = completion_s(problem, routes)
    total = 0.0
    for uav, route in enumerate(routes):
        survived = 1.0
        for task in route:
            p, m = float(problem.success[uav, task]), float(problem.value[task])
            total += p * survived * m * (problem.horizon_s - times_s[task])
            survived *= float(problem.survival[uav, task])
    return total


def lists(problem: Problem, sequence: Sequence[int], rule: str) -> Lists:
    """The lower level of Fig. 1 for a priority sequence of UAV indices."""
    n_uav = problem.n_uav
    free_s = [0.0] * n_uav
    place = [[float(c) for c in problem.start_enu_m[uav]] for uav in range(n_uav)]
    survived = [1.0] * n_uav
    open_tasks = list(range(problem.n_task))
    routes: Lists = [[] for _ in range(n_uav)]
    while True:
        able = [
            uav for uav in range(n_uav) if any(problem.success[uav, t] > 0.0 for t in open_tasks)
        ]
        if not able:
            return routes
        uav = min(able, key=lambda u: (free_s[u], list(sequence).index(u), u))
        tasks = [task for task in open_tasks if problem.success[uav, task] > 0.0]
        tours: list[tuple[int, ...]] = (
            [(task,) for task in tasks] if rule == "greedy" else list(permutations(tasks))
        )
        best_value, best_first = -math.inf, -1
        for tour in tours:
            value = _tour_value(problem, uav, free_s[uav], place[uav], survived[uav], tour)
            if value > best_value or (value == best_value and tour[0] < best_first):
                best_value, best_first = value, tour[0]
        free_s[uav], place[uav] = _arrive(problem, uav, free_s[uav], place[uav], best_first)
        survived[uav] *= float(problem.survival[uav, best_first])
        routes[uav].append(best_first)
        open_tasks.remove(best_first)


def ordered_partitions(problem: Problem) -> Iterator[Lists]:
    """Every way to put all tasks on ordered lists of UAVs capable of them.

    Tasks that no UAV is capable of are left out.
    """
    tasks = [t for t in range(problem.n_task) if any(problem.success[:, t] > 0.0)]

    def place(index: int, routes: Lists) -> Iterator[Lists]:
        if index == len(tasks):
            yield [list(route) for route in routes]
            return
        task = tasks[index]
        for uav, route in enumerate(routes):
            if problem.success[uav, task] > 0.0:
                for position in range(len(route) + 1):
                    route.insert(position, task)
                    yield from place(index + 1, routes)
                    route.pop(position)

    yield from place(0, [[] for _ in range(problem.n_uav)])


def extreme_values(problem: Problem) -> tuple[float, float]:
    """J of the best and of the worst ordered partition, by trying all."""
    values = [objective(problem, routes) for routes in ordered_partitions(problem)]
    return max(values), min(values)


def _arrive(
    problem: Problem, uav: int, free_s: float, place: list[float], task: int
) -> tuple[float, list[float]]:
    """Completion time [s] and place after flying to ``task`` and serving it."""
    there = [float(c) for c in problem.task_enu_m[task]]
    east_m, north_m, up_m = (there[axis] - place[axis] for axis in range(3))
    distance_m = math.sqrt(east_m * east_m + north_m * north_m + up_m * up_m)
    travel_s = distance_m / float(problem.speed_m_s[uav])
    return free_s + travel_s + float(problem.service_s[task]), there


def _tour_value(
    problem: Problem,
    uav: int,
    free_s: float,
    place: list[float],
    survived: float,
    tour: Sequence[int],
) -> float:
    total = 0.0
    for task in tour:
        free_s, place = _arrive(problem, uav, free_s, place, task)
        p, m = float(problem.success[uav, task]), float(problem.value[task])
        total += p * survived * m * (problem.horizon_s - free_s)
        survived *= float(problem.survival[uav, task])
    return total
