"""Schedules of whole teams with the field's constraints, by lists or by a rule.

An item of a list is 2k for task k from its first point on, 2k + 1 from its last point on, and
-1 - b for base b. In what follows ``team`` says where the team stands and is left unchanged. A
wrong shape or number raises a ValueError that names its argument.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import IntEnum
from itertools import chain
from typing import Literal, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelField

_Floats = npt.NDArray[np.float64]
_Ints = npt.NDArray[np.int32]
_Ranks = npt.NDArray[np.int64]
_Bools = npt.NDArray[np.bool_]

FieldRuleCode = Literal[0, 1, 2, 3]
FIELD_GREEDY: FieldRuleCode = 0
"""The open task with the largest p·S·m·(until − end) among those that it can do next; else to a
base, after which it could do one; else home."""
FIELD_LOOKAHEAD: FieldRuleCode = 1
"""The first item of the UAV's own best list over all open tasks, as if it were alone and every slot
free: exact up to `EXACT_OWN_TASKS` tasks that it is capable of, beyond greedy's list improved by
insertions and moves. Where that is a base without a slot in time it decides like greedy."""
FIELD_NEAREST: FieldRuleCode = 2
"""As greedy, but the task whose work can begin soonest."""
FIELD_VALUE_PER_TIME: FieldRuleCode = 3
"""As greedy, but the task with the most p·m for each second until its end."""

EXACT_OWN_TASKS = 10


class FieldRefusal(IntEnum):
    """Why an item can't be next on a list, in the order in which that is asked."""

    NONE = 0
    INCAPABLE = 1
    """p is 0, or the UAV takes no part."""
    NO_WAY = 2
    """To it, along it, or home from it."""
    WINDOW = 3
    """Work would begin after closes_s."""
    DUE = 4
    """It would end after due_s."""
    ENERGY = 5
    """At a task, with the way home from there; at a base, before there is a slot."""


class FieldTeamArrays(Protocol):
    """Where the team stands, as `swarm.allocation.field.FieldState` explains it, which is one."""

    @property
    def free_s(self) -> _Floats:
        """(n_uav,) when it is free to depart [s]."""

    @property
    def sortie_end_s(self) -> _Floats:
        """(n_uav,) when it has landed at the latest [s]."""

    @property
    def first_s(self) -> _Floats:
        """(n_uav, n_node) legs from where it is then [s]."""

    @property
    def survived(self) -> _Floats:
        """(n_uav,) S of eq. 1 of its next task."""

    @property
    def active(self) -> _Bools:
        """(n_uav,) whether it takes part."""

    @property
    def open(self) -> _Bools:
        """(n_task,) whether somebody may take the task."""

    @property
    def landed_at(self) -> _Ints:
        """(n_uav,) base at which it stands ready, or -1."""

    @property
    def rank(self) -> _Ranks:
        """(n_uav,) place in the sequence."""

    @property
    def arrives_s(self) -> _Floats:
        """(n_uav,) above that base, if it has no slot yet [s]."""

    @property
    def leaving(self) -> _Ints:
        """(n_uav,) base on a slot of which it waits for a departure, or -1."""

    @property
    def leaves_s(self) -> _Floats:
        """(n_uav,) when that is [s]."""


class FlownLists(NamedTuple):
    """The schedules of lists; rows of items are those of all lists, one after the other."""

    times_s: _Floats
    """(n_item, 4) departure, arrival, beginning and end of work or swap [s]; NaN of what was not
    done."""
    done: _Ints
    """(n_uav,) items done; fewer than there are if the next one can't be."""
    refusal: _Ints
    """(n_uav,) `FieldRefusal` of that one."""
    home: _Ints
    """(n_uav,) where its way home leads: a base, or -1 for its start."""
    home_s: _Floats
    """(n_uav, 2) departure and arrival on it [s]; NaN of who did nothing."""
    value: _Floats
    """(n_uav,) of eq. 1."""

    @property
    def feasible(self) -> bool:
        """Whether all was done."""
        return not self.refusal.any()


class FieldRuns(NamedTuple):
    """Decisions by a rule, in the order in which they are taken."""

    uavs: _Ints
    """(k,) who decides."""
    items: _Ints
    """(k,) on what."""
    decided_s: _Floats
    """(k,) when [s]."""
    times_s: _Floats
    """(k, 4) departure, arrival, beginning and end as known then [s]: at a base somebody whose
    decision comes later may be ahead."""
    scores: _Floats
    """(k, 2) `FieldStep.score` and `FieldStep.second_score` [value·s]; NaN: there is none."""

    def lists(self, n_uav: int) -> list[list[int]]:
        """Items per UAV in order of execution."""
        lists: list[list[int]] = [[] for _ in range(n_uav)]
        for uav, item in zip(self.uavs.tolist(), self.items.tolist(), strict=True):
            lists[uav].append(item)
        return lists


class FieldStep(NamedTuple):
    """One decision."""

    item: int
    depart_s: float
    arrive_s: float
    begin_s: float
    end_s: float
    score: float | None
    """Greedy: p·S·m·(until − end) of a task, None of a base; lookahead: of its list [value·s]."""
    second_score: float | None
    """Greedy: of the next best task [value·s]."""


def fly_lists(
    problem: KernelField, team: FieldTeamArrays, lists: Sequence[Sequence[int]]
) -> FlownLists:
    """Fly (n_uav,) lists of items from ``team`` on, whether they can be done or not.

    What follows an item that can't be done is not done. Bases serve in the order of arrival, then
    rank, then index. No task may be there twice; which are open is not asked.
    """
    flat = np.array(list(chain.from_iterable(lists)), dtype=np.int32)
    offsets = np.cumsum([0, *(len(items) for items in lists)], dtype=np.int64)
    return FlownLists(*_kernels.field_fly_lists(problem, *team_arrays(team), flat, offsets))


def run_rule(
    problem: KernelField,
    team: FieldTeamArrays,
    rule: FieldRuleCode,
    should_stop: Callable[[], bool] | None = None,
    *,
    first: int | None = None,
) -> FieldRuns:
    """All decisions from ``team`` on, each when its UAV is free; once it is to stop, no more.

    The lists that they make can be flown, and every visit to a base is followed by a task: who
    flew to a base in vain goes home instead.

    Args:
        problem: what it is about.
        team: where it stands.
        rule: by which all decide.
        should_stop: asked every few milliseconds.
        first: a UAV whose first decision alone is of interest. Then it ends when that one is
            certain; some that are told after it are not.
    """
    of = -1 if first is None else first
    return FieldRuns(*_kernels.field_run_rule(problem, *team_arrays(team), rule, of, should_stop))


def decide(
    problem: KernelField, team: FieldTeamArrays, uav: int, rule: FieldRuleCode
) -> FieldStep | None:
    """What ``uav`` does next if it is its turn now; None: it goes home.

    Of the others it is read who stands at which base until when.
    """
    found = _kernels.field_decide(problem, *team_arrays(team), uav, rule)
    return None if found is None else FieldStep(*found)


def team_arrays(
    team: FieldTeamArrays,
) -> tuple[
    _Floats, _Floats, _Floats, _Floats, _Bools, _Bools, _Ints, _Ranks, _Floats, _Ints, _Floats
]:
    """What the kernels are told of a team, in their order."""
    return (
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
    )
