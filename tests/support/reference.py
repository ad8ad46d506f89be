"""Plain-loop definitions that fast code is tested against; nothing else calls them.

First those of the lower level and of eq. 1, then those of the route kernels: what a move is
worth, by evaluating whole lists.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import FloatArray, Problem
from swarm.kernels.routes_bound import Timetable

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
    """The lower level of Fig. 1 from the starts, for a priority sequence of UAV indices."""
    return lists_from(problem, TeamState.at_start(problem), sequence, rule)[0]


def lists_from(
    problem: Problem, state: TeamState, sequence: Sequence[int], rule: str
) -> tuple[Lists, float]:
    """The same from any state, and Σ of eq. 1 over the decisions taken, in their order."""
    state = state.copy()
    routes: Lists = [[] for _ in range(problem.n_uav)]
    total = 0.0
    while True:
        able = [
            uav
            for uav in range(problem.n_uav)
            if state.active[uav] and math.isfinite(state.free_s[uav]) and _able(problem, state, uav)
        ]
        if not able:
            return routes, total
        uav = min(able, key=lambda u: (float(state.free_s[u]), list(sequence).index(u), u))
        task = choice(problem, state, uav, rule)[0]
        survived = float(state.survived[uav])
        state.free_s[uav], there = _arrive(problem, uav, *_stand(state, uav), task)
        state.place_enu_m[uav] = there
        weight = float(problem.success[uav, task]) * float(problem.value[task])
        total += survived * weight * (problem.horizon_s - float(state.free_s[uav]))
        state.survived[uav] = survived * float(problem.survival[uav, task])
        state.open[task] = False
        routes[uav].append(task)


def choice(
    problem: Problem, state: TeamState, uav: int, rule: str
) -> tuple[int, float, float | None]:
    """The task ``uav`` takes if it is its turn, its worth, and that of the best other task.

    Greedy looks at single tasks, lookahead at all tours. Something must be open to it.
    """
    tasks = _able(problem, state, uav)
    tours: list[tuple[int, ...]] = (
        [(task,) for task in tasks] if rule == "greedy" else list(permutations(tasks))
    )
    survived = float(state.survived[uav])
    best: dict[int, float] = {}
    for tour in tours:
        value = _tour_value(problem, uav, *_stand(state, uav), survived, tour)
        best[tour[0]] = max(best.get(tour[0], -math.inf), value)
    task = min(best, key=lambda t: (-best[t], t))
    return task, best[task], max((best[t] for t in best if t != task), default=None)


def certificate(problem: Problem, state: TeamState, uav: int) -> bool:
    """Whether Theorem 5 proves that greedy and lookahead agree on the decision of ``uav``.

    With λ = Z2/Z1 (second best over best greedy score) and p̄ the largest survival probability,
    p̄ ≤ (1 − λ)/(2 − λ) is sufficient. Why: a tour that begins with another task is worth at most
    Z2 + Z1·(p̄ + p̄² + …) < Z1 then, because a later task earns at most its greedy score times the
    survival of all before it; and some tour that begins with the greedy task is worth at least
    Z1. The second half fails if the rest of that tour comes so late that it costs more than it
    earns, so it is checked on one tour, the greedy one; finding that one to earn less than 0
    proves nothing. Nothing is claimed where a premise fails.
    """
    tasks = _able(problem, state, uav)
    if len(tasks) == 1:
        return True  # one tour only
    first, best, second = choice(problem, state, uav, "greedy")
    if not best > 0.0 or second is None:
        return False
    ratio = max(0.0, second / best)  # a negative second best is left to the check of the rest
    highest = max(float(problem.survival[uav, task]) for task in tasks)
    if highest * (2.0 - ratio) > 1.0 - ratio:
        return False
    free_s, place = _arrive(problem, uav, *_stand(state, uav), first)
    left = [task for task in tasks if task != first]
    earned, survived = 0.0, 1.0
    while left and survived > 0.0:
        scores = [_tour_value(problem, uav, free_s, place, 1.0, (task,)) for task in left]
        task = left[scores.index(max(scores))]
        earned += survived * max(scores)
        survived *= float(problem.survival[uav, task])
        free_s, place = _arrive(problem, uav, free_s, place, task)
        left.remove(task)
    return earned >= 0.0


def first_round(
    problem: Problem, state: TeamState, sequence: Sequence[int], rule: str
) -> list[int]:
    """What each UAV takes if all active ones decide once in the order of the sequence; else -1."""
    state = state.copy()
    tasks = [-1] * problem.n_uav
    for uav in sequence:
        if state.active[uav] and math.isfinite(state.free_s[uav]) and _able(problem, state, uav):
            tasks[uav] = choice(problem, state, uav, rule)[0]
            state.open[tasks[uav]] = False
    return tasks


def tour_worth(
    tour: Sequence[int],
    completion_s: FloatArray,
    weight: FloatArray,
    survival: FloatArray,
    leg_s: FloatArray,
    horizon_s: float,
) -> float:
    """Worth of a tour of positions, S = 1 before it; other arguments: `swarm.kernels.tours`."""
    total, survived, time_s, last = 0.0, 1.0, 0.0, -1
    for task in tour:
        time_s = float(completion_s[task]) if last < 0 else time_s + float(leg_s[last, task])
        total += survived * float(weight[task]) * (horizon_s - time_s)
        survived *= float(survival[task])
        last = task
    return total


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


def _able(problem: Problem, state: TeamState, uav: int) -> list[int]:
    """Open tasks that ``uav`` is capable of, ascending."""
    return [t for t in range(problem.n_task) if state.open[t] and problem.success[uav, t] > 0.0]


def _stand(state: TeamState, uav: int) -> tuple[float, list[float]]:
    """When and where ``uav`` is next free [s], [m]."""
    return float(state.free_s[uav]), [float(c) for c in state.place_enu_m[uav]]


def _arrive(
    problem: Problem, uav: int, free_s: float, place: list[float], task: int
) -> tuple[float, list[float]]:
    """Completion time [s] and place after flying to ``task`` and serving it."""
    there = [float(c) for c in problem.task_enu_m[task]]
    east_m, north_m, up_m = (there[axis] - place[axis] for axis in range(3))
    distance_m = math.sqrt(east_m * east_m + north_m * north_m + up_m * up_m)
    travel_s = _flown_s(problem, uav, distance_m)
    return free_s + travel_s + float(problem.service_s[task]), there


def _flown_s(problem: Problem, uav: int, distance_m: float) -> float:
    """Time over that distance from rest to rest [s]."""
    v_m_s = float(problem.speed_m_s[uav])
    if problem.acceleration_m_s2 is None:
        return distance_m / v_m_s
    a_m_s2 = float(problem.acceleration_m_s2[uav])
    if distance_m < v_m_s * v_m_s / a_m_s2:
        return 2.0 * math.sqrt(distance_m / a_m_s2)
    return distance_m / v_m_s + v_m_s / a_m_s2


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


RouteLists = list[list[int]]


_MOST_MOVED = 3


def list_worth(problem: Problem, state: TeamState, uav: int, route: Sequence[int]) -> float:
    """Σ p·S·m·(D − t) over one list flown from the state on [value·s]."""
    free_s, survived = float(state.free_s[uav]), float(state.survived[uav])
    place, worth = state.place_enu_m[uav], 0.0
    for task in route:
        free_s += float(problem.travel_s(uav, place)[task]) + float(problem.service_s[task])
        weight = float(problem.success[uav, task]) * float(problem.value[task])
        worth += survived * weight * (problem.horizon_s - free_s)
        survived *= float(problem.survival[uav, task])
        place = problem.task_enu_m[task]
    return worth


def team_worth(problem: Problem, state: TeamState, lists: Sequence[Sequence[int]]) -> float:
    """The same summed over the team."""
    return sum(list_worth(problem, state, uav, route) for uav, route in enumerate(lists))


def repaired(problem: Problem, state: TeamState, lists: Sequence[Sequence[int]]) -> RouteLists:
    """``lists`` with each open task that is on none put where J gains most, most valuable first.

    Of up to 150 tasks all places count. Beyond, those beside the ten nearest tasks on lists, and
    the fronts of UAVs that are no farther away than the last of these; all UAVs can do all tasks.
    """
    now = [list(route) for route in lists]
    listed = {task for route in now for task in route}
    missing = [int(task) for task in np.flatnonzero(state.open) if int(task) not in listed]
    uavs = [int(uav) for uav in np.flatnonzero(state.active)]
    most = {task: max(float(problem.weight[uav, task]) for uav in uavs) for task in missing}
    for task in sorted(missing, key=lambda task: (-most[task], task)):
        here = problem.task_enu_m[task]
        near = sorted(
            (float(np.linalg.norm(problem.task_enu_m[other] - here)), uav, place)
            for uav in uavs
            for place, other in enumerate(now[uav])
        )[:10]
        places = {(uav, before) for _, uav, place in near for before in (place, place + 1)}
        for uav in uavs:
            if problem.n_task <= 150:
                places |= {(uav, before) for before in range(len(now[uav]) + 1)}
            elif float(np.linalg.norm(state.place_enu_m[uav] - here)) <= near[-1][0]:
                places.add((uav, 0))

        def gain(at: tuple[int, int], task: int = task) -> float:
            uav, before = at
            longer = [*now[uav][:before], task, *now[uav][before:]]
            return list_worth(problem, state, uav, longer) - list_worth(
                problem, state, uav, now[uav]
            )

        uav, before = max(places, key=gain)
        now[uav].insert(before, task)
    return now


def timed_list_worth(
    problem: Problem, timetable: Timetable, uav: int, route: Sequence[int]
) -> float | None:
    """Σ p·S·m·(D − t)⁺ over one list flown from mission time 0 by a timetable [value·s].

    None if a task could only be completed too late.
    """
    first_s, leg_s, earliest_s, latest_s = (
        np.asarray(getattr(timetable, name))
        for name in ("first_s", "leg_s", "earliest_s", "latest_s")
    )
    done_s, survived, worth, before = 0.0, 1.0, 0.0, -1
    for task in route:
        done_s += float(leg_s[uav, before, task] if before >= 0 else first_s[uav, task])
        done_s = max(done_s, float(earliest_s[uav, task]))
        if done_s > latest_s[uav, task]:
            return None
        weight = float(problem.success[uav, task]) * float(problem.value[task])
        worth += survived * weight * max(0.0, problem.horizon_s - done_s)
        survived *= float(problem.survival[uav, task])
        before = task
    return worth


def neighbourhood(problem: Problem, lists: RouteLists) -> Iterator[RouteLists]:
    """Every set of lists that one move of the local search makes of ``lists``."""
    for uav, route in enumerate(lists):
        for changed in _within(route):
            yield [*lists[:uav], changed, *lists[uav + 1 :]]
    for a in range(len(lists)):
        for b in range(len(lists)):
            if a == b:
                continue
            for first, second in _between(lists[a], lists[b]):
                able = problem.capable[a, first].all() and problem.capable[b, second].all()
                if able:
                    changed_lists = list(lists)
                    changed_lists[a], changed_lists[b] = first, second
                    yield changed_lists


def best_of_neighbourhood(problem: Problem, state: TeamState, lists: RouteLists) -> float:
    """The best worth that one move can reach; that of ``lists`` if no move gains."""
    worths = (team_worth(problem, state, changed) for changed in neighbourhood(problem, lists))
    return max(team_worth(problem, state, lists), max(worths, default=float("-inf")))


def _within(route: list[int]) -> Iterator[list[int]]:
    n = len(route)
    for low in range(n):
        for high in range(low + 2, n + 1):
            yield route[:low] + route[low:high][::-1] + route[high:]
    for a in range(n):
        for b in range(a + 1, n):
            for c in range(b + 1, n + 1):
                first, second = route[a:b], route[b:c]
                if min(len(first), len(second)) > _MOST_MOVED:
                    continue
                yield route[:a] + second + first + route[c:]
                if len(first) <= _MOST_MOVED:
                    yield route[:a] + second + first[::-1] + route[c:]
                if len(second) <= _MOST_MOVED:
                    yield route[:a] + second[::-1] + first + route[c:]


def _between(first: list[int], second: list[int]) -> Iterator[tuple[list[int], list[int]]]:
    for low in range(len(first)):
        for high in range(low + 1, min(len(first), low + _MOST_MOVED) + 1):
            part, rest = first[low:high], first[:low] + first[high:]
            for at in range(len(second) + 1):
                yield rest, second[:at] + part + second[at:]
                yield rest, second[:at] + part[::-1] + second[at:]
    for i in range(len(first)):
        for k in range(len(second)):
            yield (
                [*first[:i], second[k], *first[i + 1 :]],
                [*second[:k], first[i], *second[k + 1 :]],
            )
    for i in range(len(first) + 1):
        for k in range(len(second) + 1):
            yield first[:i] + second[k:], second[:k] + first[i:]
