"""One online decision of the rule `guided`: a fortified rollout of the published lists.

The base policy is "every UAV keeps to its list; tasks on no living UAV's list are inserted where
J gains most". Since that policy leaves nothing to chance, simulating the whole team to its end
with another first task is a change of at most two lists, valued in microseconds. Rollout of a
sequentially consistent base policy never does worse than it (Bertsekas, Tsitsiklis and Wu 1997,
doi:10.1023/A:1009635226865); fortified: the plan is left only for what is strictly better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from swarm.kernels import _kernels
from swarm.kernels.routes import ListArrays, TeamArrays, open_lists


@dataclass(frozen=True, slots=True)
class GuidedChoice:
    """What one UAV should take next, and why."""

    task: int | None
    """Index of the task; None: the team is better off if this UAV takes none."""
    worth: float
    """J to go of the whole team with this choice [value·s]."""
    second_worth: float | None
    """The same for the best other candidate; None without one."""
    planned: int | None
    """What the lists, repaired, had the UAV take."""
    valued: tuple[tuple[int, float], ...]
    """Candidates and J to go with each [value·s]: the chosen one, then the others, best first."""


def guided_choice(
    team: TeamArrays,
    lists: Sequence[Sequence[int]] | ListArrays,
    uav: int,
    *,
    iterations: int = 0,
) -> GuidedChoice:
    """Compare the planned task with the ten best by p·m / (travel + service).

    With ``iterations`` 0 the planned task is left only for one that makes the team's lists worth
    more; so, over a sequence of decisions in which nothing unforeseen happens, J never falls below
    that of the lists. With more, the lists of the UAVs around, some 80 tasks in all, are improved
    first by that many steps of the route optimiser, with a bounded number of steps of local search
    before and after; the choice is the first task of the UAV's improved list. A UAV that idles, as
    `count_idle` has it, is not searched for.

    Of up to 150 tasks those on no list are inserted where J gains most. Beyond, only places beside
    the ten nearest tasks on lists, and fronts as near, are compared.

    Args:
        team: mission and state; all lists continue from it.
        lists: published, per UAV; closed tasks and those of inactive UAVs are skipped.
        uav: index of the deciding UAV; active.
        iterations: >= 0.

    Raises:
        ValueError: names the argument that is wrong.
    """
    if not 0 <= uav < team.problem.n_uav or not np.asarray(team.active)[uav]:
        raise ValueError(f"uav must be the index of an active UAV, not {uav}")
    if iterations < 0:
        raise ValueError(f"iterations must be >= 0, not {iterations}")
    task, worth, second, planned, valued = _kernels.guided_choice(
        team.problem,
        *team.arguments(),
        *open_lists(team, lists),
        np.asarray(team.open),
        uav,
        iterations,
    )
    return GuidedChoice(
        task if task >= 0 else None,
        worth,
        None if np.isnan(second) else second,
        planned if planned >= 0 else None,
        tuple(valued),
    )


def count_idle(
    team: TeamArrays, lists: Sequence[Sequence[int]] | ListArrays, uavs: Sequence[int]
) -> int:
    """How many UAVs idle, asked one after the other, before the first that may not.

    A UAV idles if, with all missing tasks inserted, it has none on its list, and no single task
    would be worth more there than where it is. `guided_choice` then finds nothing for it, and since
    no task was to be its own, the choices of the others are the same without it. So one placing of
    tasks tells of all of them. Of the last 12 UAVs that are counted upon nobody idles: a search
    takes in all of them.

    Args:
        team: mission and state.
        lists: as for `guided_choice`.
        uavs: indices in the order of their turns; active, and free at one time.

    Raises:
        ValueError: names the argument that is wrong.
    """
    active = np.asarray(team.active)
    if not all(0 <= uav < team.problem.n_uav and active[uav] for uav in uavs):
        raise ValueError(f"uavs must be indices of active UAVs, not {list(uavs)}")
    return _kernels.count_idle(
        team.problem,
        *team.arguments(),
        *open_lists(team, lists),
        np.asarray(team.open),
        list(uavs),
    )
