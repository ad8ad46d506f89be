"""Best lists against prices where times do not follow from places; see `coordinator.planner.bound`.

`swarm.kernels.routes_pricing` is closer where they do. For one UAV and a price per task, the best
list of Σ p·S₀·m·(D − t)⁺ − price, with times in whole buckets, each leg rounded down, S taken as
that of the start, and tasks allowed more than once.
From that relaxation a search among real lists may go on, with exact times, S as eq. 1 has it, and
every task once: best-first, by what a list is worth so far and what the relaxation can still add.
Where it is cut short, the most that is left counts, so what is found is never below the best
list's worth. `worthy_timed_lists` names all real ones that are good enough.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.routes import FloatArray, TeamArrays, lists_of
from swarm.kernels.routes_pricing import PricedLists, WorthyLists, checked_most

MOST_BUCKETS = 100_000


@dataclass(frozen=True, slots=True, eq=False)
class Timetable:
    """When each UAV can complete what, where places, speeds and the horizon do not say it all.

    Rows are UAVs, columns tasks; times are mission times, or lengths of time.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
    """

    first_s: npt.ArrayLike
    """(n_uav, n_task) from when the UAV is free to completing its first task [s]; >= 0."""
    leg_s: npt.ArrayLike
    """(n_uav, n_task, n_task) from completing one task to completing another [s]; >= 0."""
    earliest_s: npt.ArrayLike
    """(n_uav, n_task) a UAV that could complete the task sooner waits [s]; >= 0."""
    latest_s: npt.ArrayLike
    """(n_uav, n_task) what is not complete by then never will be [s]; >= 0, may be infinite."""
    shape: tuple[int, int] = field(init=False)
    kernel: _kernels.Timetable = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if np.ndim(self.first_s) != 2:
            raise ValueError(f"first_s must have 2 axes, not {np.ndim(self.first_s)}")
        n_uav, n_task = shape = np.shape(self.first_s)
        first_s = _times("first_s", self.first_s, shape)
        leg_s = _times("leg_s", self.leg_s, (n_uav, n_task, n_task))
        earliest_s = _times("earliest_s", self.earliest_s, shape)
        latest_s = _times("latest_s", self.latest_s, shape, endless=True)
        object.__setattr__(self, "shape", shape)
        kernel = _kernels.Timetable(first_s, leg_s, earliest_s, latest_s)
        object.__setattr__(self, "kernel", kernel)


def relaxed_lists(
    team: TeamArrays,
    price: FloatArray,
    bucket_s: float,
    *,
    timetable: Timetable | None = None,
    expansions: int = 0,
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> PricedLists | None:
    """Best lists of all active UAVs, each for itself, over the open tasks; relaxed ones at first.

    Time grows with active UAVs · tasks² · buckets, memory per thread with tasks ·
    (tasks + buckets). Legs shorter than a bucket make the relaxation weaker, not wrong.

    Args:
        team: mission and state.
        price: (n_task,) to pay for each visit [value·s]; >= 0.
        bucket_s: width of a bucket [s]; > 0.
        timetable: of flights, in place of the mission's places, speeds and service times.
        expansions: beginnings of lists that the search among real ones continues at most, per UAV;
            0: no such search.
        threads: at most this many; does not change the result.
        should_stop: asked every few milliseconds whether to give up.

    Returns:
        The lists, and what they are worth with times in whole buckets; None where it was told to
        give up.

    Raises:
        ValueError: names the argument that is wrong.
    """
    prices, count = _checked(team, price, bucket_s, timetable, threads)
    if expansions < 0:
        raise ValueError(f"expansions must be >= 0, not {expansions}")
    done, bound, worth, lists = _kernels.relaxed_lists(
        team.problem,
        *team.arguments(),
        np.asarray(team.open),
        prices,
        float(bucket_s),
        None if timetable is None else timetable.kernel,
        expansions,
        count,
        should_stop,
    )
    return PricedLists(bound, worth, lists_of(*lists)) if done else None


def worthy_timed_lists(
    team: TeamArrays,
    price: FloatArray,
    most: FloatArray,
    slack: float,
    bucket_s: float,
    *,
    heads: int,
    timetable: Timetable | None = None,
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> WorthyLists | None:
    """All real lists of active UAVs that earn nearly as much as the best, the empty ones apart.

    S is as eq. 1 has it. Lists whose last task gains nothing are left out, and of those with the
    same tasks all but the best.

    Args:
        team: mission and state.
        price: (n_task,) to pay for each visit [value·s]; >= 0.
        most: (n_uav,) no list earns more [value·s].
        slack: they earn less than that by no more [value·s]; >= 0.
        bucket_s: width of a bucket of the relaxation that guides it [s]; > 0.
        heads: beginnings of lists that are looked at, at most, per UAV.
        timetable: of flights, in place of the mission's places, speeds and service times.
        threads: at most this many; does not change the result.
        should_stop: asked every few milliseconds whether to give up.

    Returns:
        None where there would be too many, or it was told to give up.

    Raises:
        ValueError: names the argument that is wrong.
    """
    prices, count = _checked(team, price, bucket_s, timetable, threads)
    bests = checked_most(team, most, slack)
    if heads < 1:
        raise ValueError(f"heads must be >= 1, not {heads}")
    complete, uav, worth, lists = _kernels.worthy_timed_lists(
        team.problem,
        *team.arguments(),
        np.asarray(team.open),
        prices,
        bests,
        float(slack),
        float(bucket_s),
        None if timetable is None else timetable.kernel,
        heads,
        count,
        should_stop,
    )
    return WorthyLists(uav, worth, lists_of(*lists)) if complete else None


def _checked(
    team: TeamArrays,
    price: FloatArray,
    bucket_s: float,
    timetable: Timetable | None,
    threads: int | None,
) -> tuple[FloatArray, int]:
    """Prices and a number of threads; names the argument that is wrong."""
    prices = np.array(price, dtype=np.float64, order="C")
    if prices.shape != (team.problem.n_task,):
        raise ValueError(f"price must have shape {(team.problem.n_task,)}, not {prices.shape}")
    if not (np.isfinite(prices).all() and (prices >= 0.0).all()):
        raise ValueError("price must be finite and >= 0")
    begin_s = np.asarray(team.free_s)[np.asarray(team.active)].min(initial=0.0)
    most_s = team.problem.horizon_s - begin_s
    if not (bucket_s > 0.0 and most_s <= bucket_s * MOST_BUCKETS):
        raise ValueError(f"bucket_s must be > 0 and make at most {MOST_BUCKETS} buckets")
    if timetable is not None and timetable.shape != (team.problem.n_uav, team.problem.n_task):
        raise ValueError(f"timetable must not be of shape {timetable.shape}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")
    return prices, (os.cpu_count() or 1) if threads is None else threads


def _times(
    name: str, value: npt.ArrayLike, shape: tuple[int, ...], *, endless: bool = False
) -> FloatArray:
    array = np.array(value, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, not {array.shape}")
    if not ((array >= 0.0).all() and (endless or np.isfinite(array).all())):
        raise ValueError(f"{name} must be >= 0" + ("" if endless else " and finite"))
    return array
