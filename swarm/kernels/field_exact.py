"""The proven optimum of the field's problem for small teams, and the best lists of one UAV.

Items of a list: task k from its first point on is 2k, from its last point on 2k + 1; base b is
-1 - b. Comparison everywhere: (fewest tasks without due_s left out, then largest J).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelField
from swarm.kernels.field import FieldTeamArrays
from swarm.kernels.lower_level import default_threads

MOST_TASKS: int = _kernels.MOST_FIELD_TASKS
"""Tasks the solver takes."""


class ProofOutcome(Enum):
    """How an exact search ended."""

    PROVEN = 0
    STOPPED = 1
    TOO_LARGE = 2


@dataclass(frozen=True, slots=True)
class FieldLists:
    """The best lists that were found."""

    outcome: ProofOutcome
    """Whether they are proven to be the best."""
    found: bool
    """Whether there are any; where not, nothing below means anything."""
    n_left_out: int
    """Open tasks without due_s that are on no list."""
    objective: float
    """J of the lists from the state on [value·s]."""
    lists: tuple[tuple[int, ...], ...]
    """Items of each UAV."""


@dataclass(frozen=True, slots=True)
class OwnFieldList:
    """The best list of one UAV as if it were alone."""

    outcome: ProofOutcome
    """Only one that is proven is of use."""
    n_left_out: int
    """Open tasks without due_s that it is capable of and that are not on it."""
    objective: float
    """J of the list from the state on [value·s]."""
    items: tuple[int, ...]
    """What it holds."""


def optimum(
    problem: KernelField,
    team: FieldTeamArrays,
    *,
    known: Sequence[Sequence[int]] = (),
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> FieldLists:
    """The best lists of a team from where it stands on, slots included.

    The same with any number of threads. Several visits to bases in a row are at most as many as
    there are bases.

    Args:
        problem: what it is about.
        team: where it stands.
        known: lists to be better than, one of each UAV; of no matter where they can't be flown.
        threads: as many as there are processors when None.
        should_stop: asked every few milliseconds whether to give up.

    Returns:
        The best that was found, not proven where it was told to stop or grew too large.

    Raises:
        ValueError: an argument is not what it must be.
    """
    count = default_threads() if threads is None else threads
    outcome, found, n_left_out, objective, lists = _kernels.field_optimum(
        problem, _as_tuple(team), [list(items) for items in known], count, should_stop
    )
    items = tuple(tuple(own) for own in lists)
    return FieldLists(ProofOutcome(outcome), found, n_left_out, objective, items)


def best_list(
    problem: KernelField,
    team: FieldTeamArrays,
    uav: int,
    *,
    should_stop: Callable[[], bool] | None = None,
) -> OwnFieldList:
    """The best list of one UAV over all open tasks, as if it were alone; slots are no concern.

    Args:
        problem: what it is about.
        team: where it stands.
        uav: whose list.
        should_stop: asked every few milliseconds whether to give up.

    Raises:
        ValueError: an argument is not what it must be, or it is capable of more than
            `MOST_TASKS` open tasks.
    """
    outcome, n_left_out, objective, items = _kernels.field_best_list(
        problem, _as_tuple(team), uav, should_stop
    )
    return OwnFieldList(ProofOutcome(outcome), n_left_out, objective, tuple(items))


def _as_tuple(team: FieldTeamArrays) -> tuple[Any, ...]:
    return (
        team.free_s,
        team.sortie_end_s,
        team.first_s,
        team.survived,
        team.active,
        team.open,
        team.landed_at,
        team.rank,
    )
