"""A survey shared out before it begins: each UAV flies strips of its own, side by side.

What ground stations do today with several vehicles: the lines of an area, in the order in which one
vehicle would mow them, are cut into as many pieces of equal length as there are vehicles. Nobody
takes anybody else's; when a vehicle is lost, whoever is the first to be through with the own strips
flies what is left of the lost one's, in the same order: straight on, which no ground station has a
way to order, or from home with a new battery and a mission that begins where the lost one's ended.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import fly_lists
from swarm.kernels.field_search import optimise_lists
from swarm.model import Task

_SAME_STRIP_M = 0.05
"""Lines that lie that near to each other across their direction are one behind another."""

Lists = Sequence[Sequence[int]]
"""Items of `FieldProblem` per UAV."""


def mowing_order(lines: Sequence[Task]) -> list[int]:
    """Items of the lines of an area as one vehicle mows them: strip by strip, to and fro.

    Args:
        lines: line tasks, columns 0, 1, … of a problem; their direction is that of the first. Where
            others lie across it, their middles count.
    """
    ends = np.array([[line.path_enu_m[0][:2], line.path_enu_m[-1][:2]] for line in lines])
    along = ends[0, 1] - ends[0, 0]
    along /= np.hypot(*along)
    across_m = ends.mean(axis=1) @ np.array([-along[1], along[0]])
    middle_m = ends.mean(axis=1) @ along
    onward = (ends[:, 1] - ends[:, 0]) @ along > 0.0
    by_place = np.argsort(across_m, kind="stable")
    strip = np.empty(len(lines), dtype=np.int64)
    strip[by_place] = np.cumsum(np.diff(across_m[by_place], prepend=across_m.min()) > _SAME_STRIP_M)
    order = np.lexsort((middle_m, strip)).tolist()
    items: list[int] = []
    for number, (_, lying) in enumerate(groupby(order, key=lambda line: strip[line])):
        to = number % 2 == 0
        items += [2 * line + int(onward[line] != to) for line in list(lying)[:: 1 if to else -1]]
    return items


def strips(problem: FieldProblem, areas: Sequence[Sequence[Task]]) -> Lists:
    """Lists of a survey that is shared out before it begins, with visits to bases.

    Pieces are of equal length; each is flown from the end that lets its UAV be through sooner.
    Visits, and the ways in which lines are flown, are those that are best for that order by itself:
    where bases have few slots, others may be in the way.

    Args:
        problem: of a mission that has these tasks and no others.
        areas: the lines of each area, in the order of its tasks; areas are mown one after another.
    """
    lines = [line for area in areas for line in area]
    order = list[int]()
    first = 0
    for area in areas:
        order += [2 * first + item for item in mowing_order(area)]
        first += len(area)
    length_m = np.array([_length_m(lines[item >> 1]) for item in order])
    middle_m = np.cumsum(length_m) - length_m / 2.0
    whose = np.minimum(middle_m * problem.n_uav / length_m.sum(), problem.n_uav - 1).astype(int)
    pieces = [
        [item for item, uav in zip(order, whose.tolist(), strict=True) if uav == number]
        for number in range(problem.n_uav)
    ]
    for uav, piece in enumerate(pieces):
        back = [item ^ 1 for item in reversed(piece)]
        both = [_alone(problem, uav, items) for items in (piece, back)]
        ends_s = [_ends_s(problem, lists)[uav][-1:] for lists in both]
        pieces[uav] = list(both[ends_s.index(min(ends_s))][uav])
    return pieces


def taken_over(problem: FieldProblem, lists: Lists, lost: int, lost_s: float) -> tuple[Lists, int]:
    """Lists as they are flown if a UAV is lost, and who flies the rest of its, straight on.

    In their favour visits of whoever takes it over are chosen as if it had known of that from the
    beginning.

    Args:
        problem: the mission.
        lists: of `strips`.
        lost: the UAV.
        lost_s: when it is lost [s mission time]; what it is at then does not count.
    """
    flown, rest, heir = _inherited(problem, lists, lost, lost_s)
    flown[heir] = list(_alone(problem, heir, [*flown[heir], *rest])[heir])
    return flown, heir


def relaunched(problem: FieldProblem, lists: Lists, lost: int, lost_s: float) -> tuple[Lists, int]:
    """The same, but the heir lands first, as its mission ends: it gets a full battery and sets out.

    At the base from which it is through soonest. Nothing is counted for whoever writes that new
    mission.

    Args:
        problem: the mission; it has a base.
        lists: of `strips`.
        lost: the UAV.
        lost_s: when it is lost [s mission time]; what it is at then does not count.
    """
    flown, rest, heir = _inherited(problem, lists, lost, lost_s)
    if not rest:
        return flown, heir
    found = [_set_out_anew(problem, flown, heir, rest, base) for base in range(problem.n_base)]
    return min(found, key=lambda after: _ends_s(problem, after)[heir][-1]), heir


def _inherited(
    problem: FieldProblem, lists: Lists, lost: int, lost_s: float
) -> tuple[list[list[int]], list[int], int]:
    """Lists without what a lost UAV has not done, that in its order, and who is through first."""
    ends_s = _ends_s(problem, lists)
    done = sum(end_s <= lost_s for end_s in ends_s[lost])
    rest = [item for item in lists[lost][done:] if item >= 0]
    heir = min((uav for uav in range(problem.n_uav) if uav != lost), key=lambda u: ends_s[u][-1:])
    flown = [list(own) for own in lists]
    flown[lost] = flown[lost][:done]
    while flown[lost] and flown[lost][-1] < 0:
        flown[lost].pop()
    return flown, rest, heir


def _set_out_anew(
    problem: FieldProblem, lists: Lists, heir: int, rest: Sequence[int], base: int
) -> Lists:
    """Lists in which one more sortie, or several, from a base do the ``rest``."""
    landed = [[*own, -1 - base] if uav == heir else own for uav, own in enumerate(lists)]
    ready_s = _ends_s(problem, landed)[heir][-1]
    if not np.isfinite(ready_s):  # no slot in time: as if there were one, in its favour
        ready_s = _through_s(problem, lists, heir, base) + float(problem.swap_s[base])
    state = FieldState.at_start(problem)
    mine = np.arange(problem.n_uav) == heir
    first_s = state.first_s.copy()
    first_s[heir] = problem.leg_s[problem.kind[heir], problem.n_uav + base]
    ready = replace(
        state,
        free_s=np.where(mine, ready_s, state.free_s),
        first_s=first_s,
        active=mine,
        landed_at=np.where(mine, base, -1),
    )
    return [
        [*own, *_alone(problem, heir, rest, ready)[heir]] if uav == heir else own
        for uav, own in enumerate(landed)
    ]


def _through_s(problem: FieldProblem, lists: Lists, uav: int, base: int) -> float:
    """When a UAV that has done its list is above a base [s mission time]."""
    node, end_s = uav, 0.0
    if lists[uav]:
        item = lists[uav][-1]
        node, end_s = (
            int(problem.enter[item >> 1, 1 - (item & 1)]),
            _ends_s(problem, lists)[uav][-1],
        )
    return end_s + float(problem.leg_s[problem.kind[uav], node, problem.n_uav + base])


def _ends_s(problem: FieldProblem, lists: Lists) -> list[list[float]]:
    """When each item ends if the lists are flown together [s mission time]; infinite: never."""
    flown = fly_lists(problem.kernel, FieldState.at_start(problem), lists)
    ends_s = iter(np.nan_to_num(flown.times_s[:, 3], nan=np.inf).tolist())
    return [[next(ends_s) for _ in own] for own in lists]


def _alone(
    problem: FieldProblem, uav: int, items: Sequence[int], state: FieldState | None = None
) -> Lists:
    """Lists in which a UAV does those tasks in that order, all else as is best for it.

    From the start, unless a ``state`` says where it stands.
    """
    orders: list[Sequence[int]] = [()] * problem.n_uav
    orders[uav] = [item for item in items if item >= 0]
    state = FieldState.at_start(problem) if state is None else state
    return optimise_lists(problem.kernel, state, iterations=0, lists=orders, threads=1).lists


def _length_m(line: Task) -> float:
    return float(np.hypot(*np.diff([point[:2] for point in line.path_enu_m], axis=0).T).sum())
