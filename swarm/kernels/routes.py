"""Route optimiser: good ordered task lists for a whole team, from any state it is in.

Large-neighbourhood search with annealing (slack induction by string removals, Christiaens and
Vanden Berghe 2020, doi:10.1287/trsc.2019.0914) and local search, on segments joined in O(1)
(Silva et al. 2012, doi:10.1016/j.ejor.2012.03.044; Vidal et al. 2014,
doi:10.1016/j.ejor.2013.09.045). Where nobody is expected to be lost and more than 80 tasks come on
a UAV: iterated local search by moves between near tasks (granular neighbourhoods, Toth and Vigo
2003, doi:10.1287/ijoc.15.4.333.24890), shaken by double bridges (Silva et al. 2012) or ruins. What
segments are worth is defined plainly in `tests.support.reference`.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelProblem

FloatArray = npt.NDArray[np.float64]
Routes = list[list[int]]
"""Task indices per UAV in order of execution."""

_MAX_SEED = 2**64 - 1
_SLICES = 64
"""At least so many steps of cooling, if that leaves each some iterations."""
_FEWEST_IN_SLICE = 20
_COOL_START = 0.3
"""Heat while it is unknown how long the search will be."""
_FIRST_POLISH_FRAC, _LAST_POLISH_FRAC = 0.3, 0.02
"""Of a limit in time, the most that local search may take before the annealing, and what is kept
for it afterwards."""


@dataclass(frozen=True, slots=True, eq=False)
class TeamArrays:
    """Where the team stands, checked against the mission.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
    """

    problem: KernelProblem
    """The prepared mission. The first kernel that is asked about it takes time in n_task² ·
    log n_task to lay it out, about 10 ms for 500 tasks."""
    free_s: npt.ArrayLike
    """(n_uav,) mission time at which each UAV is next free [s]; finite."""
    place_enu_m: npt.ArrayLike
    """(n_uav, 3) where it is then [m; east, north, up]."""
    survived: npt.ArrayLike
    """(n_uav,) S of eq. 1 so far, within 0..1."""
    active: npt.ArrayLike
    """(n_uav,) whether it may be given tasks."""
    open: npt.ArrayLike
    """(n_task,) tasks to be put on lists."""

    def __post_init__(self) -> None:
        n_uav, n_task = self.problem.n_uav, self.problem.n_task
        survived = _floats("survived", self.survived, (n_uav,))
        if ((survived < 0.0) | (survived > 1.0)).any():
            raise ValueError("survived must be within 0..1")
        arrays = {
            "free_s": _floats("free_s", self.free_s, (n_uav,)),
            "place_enu_m": _floats("place_enu_m", self.place_enu_m, (n_uav, 3)),
            "survived": survived,
            "active": _mask("active", self.active, n_uav),
            "open": _mask("open", self.open, n_task),
        }
        for name, array in arrays.items():
            object.__setattr__(self, name, array)

    def arguments(self) -> tuple[FloatArray, FloatArray, FloatArray, npt.NDArray[np.bool_]]:
        """Times, places, survival and activity as kernels take them."""
        return (
            np.asarray(self.free_s),
            np.asarray(self.place_enu_m),
            np.asarray(self.survived),
            np.asarray(self.active),
        )


@dataclass(frozen=True, slots=True, eq=False)
class GivenTimes:
    """Times that do not follow from places and speeds, the same for every UAV.

    Published instances round their distances, so that their values can be compared only so.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong, or says that UAVs of the
            mission may be lost.
    """

    first_s: npt.ArrayLike
    """(n_task,) completion as the first of a list [s]."""
    leg_s: npt.ArrayLike
    """(n_task, n_task) from completing one task to completing another [s]."""
    due_s: npt.ArrayLike | None = None
    """(n_task,) a task is worth p·m·(due - t) and may be left out; None: p·m·(D - t), none may."""

    def arguments(self, team: TeamArrays) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """As the kernel takes them, checked against the team."""
        if not team.problem.certain:
            raise ValueError("given times need a mission in which survival is 1 everywhere")
        if not np.asarray(team.open).all():
            raise ValueError("given times need a team to which all tasks are open")
        n = team.problem.n_task
        return (
            _floats("first_s", self.first_s, (n,)),
            _floats("leg_s", self.leg_s, (n, n)),
            None if self.due_s is None else _floats("due_s", self.due_s, (n,)),
        )


def optimise_routes(
    team: TeamArrays,
    *,
    seed: int = 0,
    iterations: int | None = None,
    spent_frac: Callable[[int], float] | None = None,
    lists: Sequence[Sequence[int]] | None = None,
    progress: Callable[[int, float], None] | None = None,
    threads: int | None = None,
    given: GivenTimes | None = None,
) -> tuple[Routes, float]:
    """Lists that hold every open task some active UAV is capable of, late ones too.

    With ``iterations`` the result follows from the arguments alone, on every machine and with
    any number of threads. With ``spent_frac`` it depends on how much work fits into what is
    spent, but for the same work and the fractions told it is again the same.
    The search works in slices of at most some 10 to 20 ms. An exception raised by a callable, such
    as KeyboardInterrupt, ends it without a result; to stop with the best lists, say 1.

    Args:
        team: mission and state.
        seed: 0..2**64 - 1.
        iterations: removals and re-insertions in all; >= 0. Give this or ``spent_frac``.
        spent_frac: given the iterations so far, the share of the time or work that is spent; the
            annealing cools along it and ends at 1. What it says of 0 iterations is spent by time
            alone, or by whoever wants an end: local search, before and after the annealing, keeps
            to that, asking every few milliseconds.
        lists: to begin with, disjoint; tasks that are not open are dropped, missing ones added.
        progress: told the iterations so far and the best J to go after each slice.
        threads: at most this many; as many as there are processors when None.
        given: times that do not follow from places; only where nobody is lost.

    Returns:
        Lists per UAV, and Σ p·S·m·(D − t) over them [value·s]; due - t with given due times.

    Raises:
        ValueError: names the argument that is wrong.
    """
    _check_options(iterations, spent_frac, seed, threads)
    search = _kernels.RouteSearch(
        team.problem,
        *team.arguments(),
        *open_lists(team, lists),
        np.asarray(team.open),
        seed,
        *(given.arguments(team) if given else ()),
    )

    def time_spent_frac() -> float:
        return 0.0 if spent_frac is None else float(spent_frac(0))

    full = int(np.sum(team.open)) * search.iterations_for_full_heat()
    if full > 0.0:
        search.polish(lambda: not time_spent_frac() < _FIRST_POLISH_FRAC)
    lanes = search.n_lane()
    most = search.most_iterations()
    done = 0
    while True:
        if spent_frac is not None:
            spent = max(float(spent_frac(done)), time_spent_frac() / (1.0 - _LAST_POLISH_FRAC))
        else:
            spent = done / iterations if iterations else 1.0
        if not spent < 1.0:
            break
        total = iterations if iterations is not None else done / spent if spent > 0.0 else 0.0
        now = max(_FEWEST_IN_SLICE, min(most, int(total / lanes / _SLICES)))
        if iterations is not None:
            now = min(now, -(-(iterations - done) // lanes))
        heat = _heat(max(0.0, spent), total, full)
        search.round(now, heat, threads or os.cpu_count() or 1, _ending(spent_frac))
        done += now * lanes
        if progress is not None:
            progress(done, search.best_value())
    search.polish(lambda: not time_spent_frac() < 1.0)
    return lists_of(*search.best()), search.best_value()


def _check_options(
    iterations: int | None,
    spent_frac: Callable[[int], float] | None,
    seed: int,
    threads: int | None,
) -> None:
    if (iterations is None) == (spent_frac is None):
        raise ValueError("iterations or spent_frac must be given, and not both")
    if iterations is not None and iterations < 0:
        raise ValueError(f"iterations must be >= 0, not {iterations}")
    if not 0 <= seed <= _MAX_SEED:
        raise ValueError(f"seed must be within 0..2**64 - 1, not {seed}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")


def _ending(spent_frac: Callable[[int], float] | None) -> Callable[[], bool] | None:
    """Whether all that is not kept for the last local search is spent by time."""
    if spent_frac is None:
        return None
    return lambda: not float(spent_frac(0)) < 1.0 - _LAST_POLISH_FRAC


def _heat(spent_frac: float, total: float, full: float) -> float:
    """Cool along what is spent, from a heat that ``total`` iterations can afford; ``full``, all.

    Where ``full`` is 0, any number of them can.
    """
    if total == 0.0:
        return _COOL_START
    # two square roots, not a power: their floats are the same everywhere
    share = total / max(1.0, full)
    return min(1.0, math.sqrt(math.sqrt(share))) * (1.0 - spent_frac)


def improve_routes(team: TeamArrays, lists: Sequence[Sequence[int]]) -> Routes:
    """Lists after local search, in which no move gains any more; tasks stay those on the lists."""
    arrays = open_lists(team, lists)
    return lists_of(*_kernels.improve_routes(team.problem, *team.arguments(), *arrays))


def flat_lists(
    lists: Sequence[Sequence[int]], n_uav: int, n_task: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Lists end to end, and where each begins.

    Raises:
        ValueError: a list too many or too few, an unknown task, or one task twice.
    """
    if len(lists) != n_uav:
        raise ValueError(f"lists must hold {n_uav} lists, not {len(lists)}")
    flat = np.array([task for route in lists for task in route], dtype=np.int64)
    if len(flat) and (flat.min() < 0 or flat.max() >= n_task):
        raise ValueError(f"lists name a task outside 0..{n_task - 1}")
    if len(flat) and np.bincount(flat).max() > 1:
        raise ValueError("lists name a task twice")
    offsets = np.zeros(n_uav + 1, dtype=np.int64)
    np.cumsum([len(route) for route in lists], out=offsets[1:])
    return flat, offsets


def lists_of(flat: npt.NDArray[np.int64], offsets: npt.NDArray[np.int64]) -> Routes:
    """List k is flat[offsets[k]:offsets[k + 1]]."""
    tasks, ends = flat.tolist(), offsets.tolist()
    return [tasks[begin:end] for begin, end in pairwise(ends)]


@dataclass(frozen=True, slots=True, eq=False)
class ListArrays:
    """Lists end to end, for who continues from the same ones again and again."""

    task: npt.NDArray[np.int64]
    """(n,) of each entry."""
    uav: npt.NDArray[np.int64]
    """(n,) on whose list it is; ascending."""

    @classmethod
    def of(cls, lists: Sequence[Sequence[int]], n_uav: int, n_task: int) -> ListArrays:
        """The same lists.

        Raises:
            ValueError: a list too many or too few, an unknown task, or one task twice.
        """
        flat, offsets = flat_lists(lists, n_uav, n_task)
        return cls(flat, np.repeat(np.arange(n_uav), np.diff(offsets)))


def open_lists(
    team: TeamArrays, lists: Sequence[Sequence[int]] | ListArrays | None
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """The lists without what is closed, beyond the UAV or on the list of an inactive UAV."""
    problem = team.problem
    if lists is None:
        return flat_lists([[]] * problem.n_uav, problem.n_uav, problem.n_task)
    if not isinstance(lists, ListArrays):
        lists = ListArrays.of(lists, problem.n_uav, problem.n_task)
    task, uav = lists.task, lists.uav
    keep = np.asarray(team.open)[task] & np.asarray(team.active)[uav] & problem.capable[uav, task]
    kept_offsets = np.zeros(problem.n_uav + 1, dtype=np.int64)
    np.cumsum(np.bincount(uav[keep], minlength=problem.n_uav), out=kept_offsets[1:])
    return task[keep], kept_offsets


def _floats(name: str, value: npt.ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise ValueError(f"{name} must be numbers of one shape") from None
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {array.shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, not NaN or infinite")
    return array


def _mask(name: str, value: npt.ArrayLike, n: int) -> npt.NDArray[np.bool_]:
    array = np.array(value)
    if array.dtype != np.bool_ or array.shape != (n,):
        raise ValueError(f"{name} must be booleans of shape {(n,)}")
    return array
