"""Following task lists, and the best offline plan flown as it is.

What is on no living UAV's list (pop-ups, what a lost UAV leaves, failed attempts) is taken by
value per time by UAVs whose own lists are done. Leaves out: changing lists (the other modules of
this package).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from sim.fate import Fate
from sim.study.baselines.index_rule import Routes
from sim.study.baselines.value_per_time import VALUE_PER_TIME
from sim.study.flight import Flight
from sim.study.policies.situation import Account, News, Situation
from sim.study.policies.team import fly_team
from sim.study.policy import Planner
from swarm.allocation import Problem
from swarm.clock import Clock
from swarm.model import TaskId, UavId

__all__ = ["PLANNED_BY", "Frozen", "ListFollower", "by_index"]

PLANNED_BY = "guided"
"""Method of the offline plan from which the policies of this package begin."""


class ListFollower:
    """Every UAV does its list; see the module.

    Args:
        lists: task ids by UAV id, in order.
        account: of its work.
    """

    def __init__(self, lists: Mapping[UavId, Sequence[TaskId]], account: Account) -> None:
        self._planned = lists
        self._account = account
        self._lists: Routes = []
        self._planned_for: dict[int, int] = {}
        """By task: on whose list it stood in the latest plan that had it on one."""

    @property
    def account(self) -> Account:
        """Of its work so far."""
        return self._account

    def hear(self, situation: Situation, news: Collection[News]) -> Collection[int]:
        """Put the plan into force when the mission begins."""
        if News.BEGUN in news:
            self.put_into_force(by_index(situation.problem, self._planned))
        return ()

    def choose(self, situation: Situation, uav: int) -> int | None:
        """The next task on the list, which is no decision, or one that is on none."""
        task = self._next(situation, uav)
        return self._unlisted(situation, uav) if task is None else task

    def put_into_force(self, lists: Routes) -> None:
        """From now on these lists are followed."""
        owner = {task: uav for uav, route in enumerate(lists) for task in route}
        before = self._planned_for
        self._account.moved += sum(before.get(task, uav) != uav for task, uav in owner.items())
        self._account.epochs += 1
        self._planned_for.update(owner)
        self._lists = lists

    def _next(self, situation: Situation, uav: int) -> int | None:
        route = self._lists[uav]
        while route:
            task = route.pop(0)
            if situation.state.open[task]:
                return task
        return None

    def _unlisted(self, situation: Situation, uav: int) -> int | None:
        state = situation.state.copy()
        for row, route in enumerate(self._lists):
            if state.active[row]:
                state.open[route] = False
        if not state.open.any():
            return None
        with self._account.timed():
            choice = VALUE_PER_TIME.decide(situation.problem, state, situation.rank, uav)
        return None if choice is None else choice.task


@dataclass(frozen=True, slots=True)
class Frozen:
    """The offline plan, never changed."""

    name: str = "frozen"
    what: str = "the best offline plan, never changed; gaps by value per time"

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        """Fly a mission to its end; see `sim.study.policy.Policy`."""
        best = plan(fate.mission, PLANNED_BY)
        follower = ListFollower(best.routes, Account(clock))
        return fly_team(fate, follower, sequence=best.sequence)


def by_index(problem: Problem, lists: Mapping[UavId, Sequence[TaskId]]) -> Routes:
    """Lists of ids as lists of indices; unknown tasks are left out."""
    columns = {task: column for column, task in enumerate(problem.task_ids)}
    return [
        [columns[task] for task in lists.get(uav, ()) if task in columns] for uav in problem.uav_ids
    ]
