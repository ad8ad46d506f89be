"""Ways to fly from anywhere to a node, with their corners and their time.

A place in a zone is left by the nearest point of its border first. Leaves out: how legs are found
(swarm.allocation.legs), and who decides where to fly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarm.allocation.field.network import START
from swarm.allocation.field.problem import FieldProblem
from swarm.model import BaseId

PointEnu = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Way:
    """How a UAV flies to a node.

    Heights are those flown [m above the mission origin]: a UAV's layer is added wherever it keeps
    to it.
    """

    node: int
    """Where it ends."""
    base: BaseId | None
    """Which base that is; None: a start or a task."""
    duration_s: float
    """Time of the leg, with the landing where it ends on the ground [s]."""
    via_enu_m: tuple[PointEnu, ...]
    """Corners on the way, flown through without stopping [m; east, north, up]."""
    end_enu_m: PointEnu
    """Where it ends [m; alike]."""
    upright_s: float = 0.0
    """Of its time, how long landing takes, and climbing before it [s]."""


def way_to(
    problem: FieldProblem,
    uav: int,
    place_enu_m: Sequence[float],
    node: int,
    flown_m: float | None = None,
) -> Way | None:
    """The shortest way to ``node``; None: there is none.

    Args:
        problem: made of a mission, so that places are known.
        uav: its row.
        place_enu_m: where it is [m], without its height layer.
        node: where to: a row of its start, or see `base_node` and `task_nodes`.
        flown_m: height there [m above the origin]; in its layer above the place when None.
    """
    corners_m = problem.corners_from_m(uav, place_enu_m, node, flown_m)
    duration_s = float(problem.legs_from_s(uav, place_enu_m, flown_m)[node])
    if corners_m is None or not np.isfinite(duration_s):
        return None
    path_m = problem.flown_enu_m(uav, corners_m, node, out_of_layer=flown_m is not None)
    points = [(float(east), float(north), float(up)) for east, north, up in path_m]
    base = node - problem.n_uav
    return Way(
        node=node,
        base=problem.base_ids[base] if 0 <= base < problem.n_base else None,
        duration_s=duration_s,
        via_enu_m=tuple(points[1:-1]),
        end_enu_m=points[-1],
        upright_s=problem.landing_s(uav, node),
    )


def way_home(
    problem: FieldProblem, uav: int, place_enu_m: Sequence[float], flown_m: float | None = None
) -> Way | None:
    """The way to the nearest of all bases and the UAV's own start; None: there is none.

    Of those that are as near the start goes first, then the mission's order.
    """
    legs_s = problem.legs_from_s(uav, place_enu_m, flown_m)
    ends = [uav, *range(problem.n_uav, problem.n_uav + problem.n_base)]
    return way_to(problem, uav, place_enu_m, ends[int(np.argmin(legs_s[ends]))], flown_m)


def base_node(problem: FieldProblem, base: str) -> int:
    """Node of a base."""
    return problem.n_uav + problem.base_ids.index(BaseId(base))


def task_nodes(problem: FieldProblem, task: int, *, backwards: bool = False) -> tuple[int, int]:
    """Nodes where column ``task`` begins and ends in that direction; the same one of a place."""
    enter, leave = (int(node) for node in problem.enter[task])
    return (leave, enter) if backwards else (enter, leave)


def home_base(problem: FieldProblem, uav: int, node: int) -> BaseId | None:
    """Where the way home of row ``uav`` leads from ``node``: a base; None: its own start."""
    home = int(problem.home[uav, node])
    return None if home == START else problem.base_ids[home]
