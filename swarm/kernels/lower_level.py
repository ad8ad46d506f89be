"""Decisions of UAVs, one by one, as whole runs of Fig. 1, and for many sequences at once.

A UAV that is free at infinity takes no decision. In what follows ``team`` says where the team
stands and is left unchanged, a rank is a (n_uav,) place of each UAV in the priority sequence, of
which the smaller decides first, and ``should_stop`` is asked every few milliseconds. A wrong shape
or number raises a ValueError that names its argument.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelProblem
from swarm.kernels.arrays import converted

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int64]
_Bools = npt.NDArray[np.bool_]

RuleCode = Literal[0, 1]
GREEDY: RuleCode = 0
"""Eq. 7: the open task with the largest p·S·m·(D − t)."""
LOOKAHEAD: RuleCode = 1
"""Eq. 6, 8: the first task of the UAV's own best complete tour of all tasks open to it."""

EXACT_TASKS: int = _kernels.EXACT_TASKS
"""Lookahead is exact up to this many open tasks that the UAV is capable of."""

UNDONE = -2
"""In `first_rounds`."""

Fields = tuple[int, int, float, float, float, float | None, bool, bool]
"""A decision: uav, task, decided_s, completion_s, score, second_score, certificate, exact."""


class Team(Protocol):
    """Where the team stands, as `swarm.allocation.TeamState` explains it, which is one."""

    free_s: _Floats
    place_enu_m: _Floats
    survived: _Floats
    open: _Bools
    active: _Bools


def default_threads() -> int:
    """As many threads as this process may use processors."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def decide(problem: KernelProblem, team: Team, uav: int, rule: RuleCode) -> Fields | None:
    """The next task of ``uav`` if it is its turn now; None when nothing open suits it.

    Ties go to the smaller task index. The certificate is Theorem 5's. Lookahead beyond
    `EXACT_TASKS` tasks is a beam search with local search, and then not exact unless certified.

    Of ``team`` only the row of ``uav`` and the open tasks are read.
    """
    try:
        return _kernels.decide(
            problem, team.free_s, team.place_enu_m, team.survived, team.open, uav, rule
        )
    except TypeError:  # not arrays as they should be: convert or refuse them by name
        return _kernels.decide(problem, *_converted(team)[:4], uav, rule)


def valued(
    problem: KernelProblem, team: Team, uav: int, rule: RuleCode, most: int
) -> list[tuple[int, float]]:
    """What ``rule`` makes of the tasks that `decide` chooses from [value·s].

    Gives at most ``most`` tasks and their scores, the one that `decide` takes first, then the
    others from the best on. Lookahead beyond `EXACT_TASKS` tasks values that one alone.
    """
    return _kernels.valued(problem, *_converted(team)[:4], uav, rule, most)


def run(
    problem: KernelProblem,
    team: Team,
    rank: npt.ArrayLike,
    rule: RuleCode,
    should_stop: Callable[[], bool] | None = None,
) -> tuple[_Ints, _Ints, _Floats, _Floats]:
    """All decisions of Fig. 1 from ``team`` on, in order; once it is to stop, greedy ones.

    Returns:
        (k,) UAVs, (k,) the tasks they take, (k,) completion times [s], (k,) scores [value·s].
    """
    ranks = converted("rank", rank, np.int64, 1)
    return _kernels.run(problem, *_converted(team), ranks, rule, should_stop)


def evaluate_sequences(
    problem: KernelProblem,
    team: Team,
    ranks: npt.ArrayLike,
    rule: RuleCode,
    threads: int | None = None,
) -> tuple[_Floats, _Bools]:
    """`Runs.objective` and `Runs.tied` of `run_sequences`."""
    objective, tied, *_ = run_sequences(problem, team, ranks, rule, threads)
    return objective, tied


class Runs(NamedTuple):
    """Runs of the lower level, by k priority sequences."""

    objective: _Floats
    """(k,) Σ of eq. 1 over the decisions taken, added in their order [value·s]; NaN of what was
    not begun."""
    tied: _Bools
    """(k,) whether the sequence mattered after the first round: two UAVs were free at one time."""
    by_rule: _Bools
    """(k,) whether all decisions were taken, and by the rule."""
    uavs: _Ints
    """(k, n_task) who decided, in order; then -1."""
    tasks: _Ints
    """(k, n_task) on what."""

    def lists(self, run: int, n_uav: int) -> list[list[int]]:
        """Task indices per UAV in order of execution of one of them."""
        routes: list[list[int]] = [[] for _ in range(n_uav)]
        for uav, task in zip(self.uavs[run].tolist(), self.tasks[run].tolist(), strict=True):
            if task >= 0:
                routes[uav].append(task)
        return routes


def run_sequences(
    problem: KernelProblem,
    team: Team,
    ranks: npt.ArrayLike,
    rule: RuleCode,
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> Runs:
    """What many priority sequences lead to; the same with any number of threads.

    ``ranks`` are (k, n_uav), a row for every sequence; as many ``threads`` as there are processors
    when None. Once it is to stop, what is under way, and the first one at any rate, ends with
    greedy decisions, and no other begins.
    """
    rows = converted("rank", ranks, np.int64, 2)
    count = default_threads() if threads is None else threads
    return Runs(*_kernels.run_sequences(problem, *_converted(team), rows, rule, count, should_stop))


def first_rounds(
    problem: KernelProblem,
    team: Team,
    ranks: npt.ArrayLike,
    rule: RuleCode,
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> _Ints:
    """What each UAV takes if all active ones decide once, in the order of their ranks alone.

    Arguments are those of `run_sequences`. Gives (k, n_uav) task indices; -1 for UAVs that take
    nothing, `UNDONE` all along the rows that it was told to stop before.
    """
    rows = converted("rank", ranks, np.int64, 2)
    count = default_threads() if threads is None else threads
    return _kernels.first_rounds(problem, *_converted(team), rows, rule, count, should_stop)


def _converted(team: Team) -> tuple[_Floats, _Floats, _Floats, _Bools, _Bools]:
    return (
        converted("free_s", team.free_s, np.float64, 1),
        converted("place_enu_m", team.place_enu_m, np.float64, 2),
        converted("survived", team.survived, np.float64, 1),
        converted("open", team.open, np.bool_, 1),
        converted("active", team.active, np.bool_, 1),
    )
