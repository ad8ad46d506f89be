"""Search for good lists of a whole team under the field's constraints, from any state it is in.

Large-neighbourhood search with annealing (slack induction by string removals, Christiaens and
Vanden Berghe 2020, doi:10.1287/trsc.2019.0914) on orders of tasks; where batteries are swapped and
which way lines are flown follows from an order by label-setting. Lists are compared by (fewest
required tasks left out, then largest J), all of them flown together as slots make them wait.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelField
from swarm.kernels.field import FieldTeamArrays
from swarm.kernels.lower_level import default_threads

_MAX_SEED = 2**64 - 1
_SLICES = 64
"""At least so many steps of cooling, if that leaves each some iterations."""
_MOST_IN_SLICE = 500
_FEWEST_IN_SLICE = 10
_COOL_START = 0.3
"""Heat while it is unknown how long the search will be."""
_GATHER_FRACS = (0.5, 0.8)
"""Of the search, when all lanes go on from the best lists."""
_ITERATIONS_FOR_FULL_HEAT = 400.0
"""Per task; the annealing of a shorter search begins cooler, by the fourth root."""


@dataclass(frozen=True, slots=True)
class SearchedLists:
    """What a search found."""

    lists: tuple[tuple[int, ...], ...]
    """Items per UAV: 2k for task k forwards, 2k + 1 backwards, -1 - b for base b."""
    n_left_out: int
    """Open tasks without due_s that are on no list."""
    objective: float
    """J of eq. 1 of all lists flown together [value·s]."""
    iterations: int
    """Removals and re-insertions tried."""


@dataclass(frozen=True, slots=True)
class Effort:
    """How much work a search may take, whatever a processor makes of it: the same everywhere.

    An iteration takes some 0.03 ms with a dozen tasks, and more than 1 ms where lists of dozens of
    lines with several swaps are valued.
    """

    steps: int
    """Of all lanes, as kernels count them: some 20 to 60 ns each."""
    iterations: int = 0
    """So many are made even so, such as those that place what is on no list yet."""

    def spent_frac(self, steps: int, iterations: int) -> float:
        """The share that is spent; >= 1: all."""
        if self.iterations == 0:
            return steps / self.steps
        return min(steps / self.steps, iterations / self.iterations)


def optimise_lists(
    problem: KernelField,
    team: FieldTeamArrays,
    *,
    seed: int = 0,
    iterations: int | None = None,
    spent_frac: Callable[[int], float] | None = None,
    effort: Effort | None = None,
    lists: Sequence[Sequence[int]] | None = None,
    progress: Callable[[int, float], None] | None = None,
    threads: int | None = None,
) -> SearchedLists:
    """Lists of items for every UAV that is active; never worse than those it begins with.

    With ``iterations``, and with ``effort``, the result follows from the arguments alone, with any
    number of threads.
    With ``spent_frac`` it depends on how much work fits into what is spent.

    Args:
        problem: the mission's arrays.
        team: its state.
        seed: 0..2**64 - 1.
        iterations: removals and re-insertions in all; >= 0. Give this or ``spent_frac``.
        spent_frac: given the iterations so far, the share of the time or work that is spent; the
            annealing cools along it and ends at 1. What it says of 0 iterations is spent by time
            alone, or by whoever wants an end, and is asked every few milliseconds.
        effort: after which the search ends earlier, where iterations take long.
        lists: to begin with; tasks that are not open or can't be done there are dropped.
        progress: told the iterations so far and the best J after each slice.
        threads: at most this many; as many as there are processors when None.

    Raises:
        ValueError: names the argument that is wrong.
    """
    if (iterations is None) == (spent_frac is None):
        raise ValueError("iterations or spent_frac must be given, and not both")
    if iterations is not None and iterations < 0:
        raise ValueError(f"iterations must be >= 0, not {iterations}")
    if not 0 <= seed <= _MAX_SEED:
        raise ValueError(f"seed must be within 0..2**64 - 1, not {seed}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")
    n_uav = len(team.active)
    begin = [()] * n_uav if lists is None else lists
    search = _kernels.FieldListSearch(
        problem,
        team.free_s,
        team.sortie_end_s,
        team.first_s,
        team.survived,
        team.active,
        team.open,
        team.landed_at,
        team.rank,
        team.arrives_s,
        team.leaving,
        team.leaves_s,
        *_flat(begin, n_uav),
        seed,
    )
    kernel_threads = default_threads() if threads is None else threads
    limits = _Limits(iterations, spent_frac, effort)
    done = _anneal(search, int(np.sum(team.open)), limits, progress, kernel_threads)
    objective = search.best_worth()[1]
    flat, offsets = search.best()
    items = flat.tolist()
    found = tuple(tuple(items[a:b]) for a, b in pairwise(offsets.tolist()))
    listed = [item >> 1 for item in items if item >= 0]
    wanted = problem.required & team.open
    n_left_out = int(wanted.sum() - wanted[listed].sum())
    return SearchedLists(found, n_left_out, objective, done)


@dataclass(frozen=True, slots=True)
class _Limits:
    """What ends a search."""

    iterations: int | None
    spent_frac: Callable[[int], float] | None
    effort: Effort | None

    def spent(self, done: int, steps: int) -> tuple[float, float]:
        """The share that is spent of what is spent most, and the iterations that it allows in all.

        These are 0 where that is not known yet.
        """
        if self.iterations is not None:
            total = float(self.iterations)
            spent = done / self.iterations if self.iterations else 1.0
        else:
            spent = 0.0 if self.spent_frac is None else float(self.spent_frac(done))
            total = done / spent if spent > 0.0 else 0.0
        if self.effort is None:
            return spent, total
        worked = self.effort.spent_frac(steps, done)
        return (worked, done / worked) if worked > spent else (spent, total)

    def over(self) -> bool:
        """Whether time is up, or somebody wants an end."""
        return self.spent_frac is not None and not float(self.spent_frac(0)) < 1.0


def _anneal(
    search: _kernels.FieldListSearch,
    n_task: int,
    limits: _Limits,
    progress: Callable[[int, float], None] | None,
    threads: int,
) -> int:
    """Cool until all is spent; the iterations made."""
    lanes = search.n_lane()
    gathers = list(_GATHER_FRACS)
    done = 0
    while True:
        spent, total = limits.spent(done, search.work())
        if not spent < 1.0:
            return done
        if gathers and spent >= gathers[0]:
            gathers.pop(0)
            search.gather()
        now = max(_FEWEST_IN_SLICE, min(_MOST_IN_SLICE, int(total / lanes / _SLICES)))
        if limits.iterations is not None:
            now = min(now, -(-(limits.iterations - done) // lanes))
        search.round(now, _heat(max(0.0, spent), total, n_task), threads, limits.over)
        done += now * lanes
        if progress is not None:
            progress(done, search.best_worth()[1])


def _heat(spent_frac: float, total: float, n_task: int) -> float:
    """Cool along what is spent, from a heat that a run of ``total`` iterations can afford."""
    if total == 0.0:
        return _COOL_START
    # Two square roots, not a power: their floats are the same everywhere.
    share = total / max(1, n_task) / _ITERATIONS_FOR_FULL_HEAT
    return min(1.0, math.sqrt(math.sqrt(share))) * (1.0 - spent_frac)


def _flat(
    lists: Sequence[Sequence[int]], n_uav: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int64]]:
    """Lists end to end, and where each begins."""
    if len(lists) != n_uav:
        raise ValueError(f"lists must hold {n_uav} lists, not {len(lists)}")
    flat = np.array([item for items in lists for item in items], dtype=np.int32)
    offsets = np.zeros(n_uav + 1, dtype=np.int64)
    np.cumsum([len(items) for items in lists], out=offsets[1:])
    return flat, offsets
