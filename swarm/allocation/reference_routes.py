"""Plain definitions for the route kernels: what moves are worth, by evaluating whole lists.

Slow on purpose. Leaves out: how kernels find moves (`swarm.kernels.routes`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import Problem
from swarm.kernels.routes_bound import Timetable

__all__ = [
    "best_of_neighbourhood",
    "list_worth",
    "neighbourhood",
    "team_worth",
    "timed_list_worth",
]

Lists = list[list[int]]

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


def neighbourhood(problem: Problem, lists: Lists) -> Iterator[Lists]:
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


def best_of_neighbourhood(problem: Problem, state: TeamState, lists: Lists) -> float:
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
