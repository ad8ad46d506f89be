"""Policies that never plan anew: a rule without any plan, and the offline plan as it is.

What is on no living UAV's list (pop-ups, what a lost UAV leaves, failed attempts) is taken by
value per time by UAVs whose own lists are done.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from sim.study.baselines.index_rules import Routes
from sim.study.policies.roster import Planner
from sim.study.policies.situation import Account, Dispatcher, TeamNews, TeamSituation
from sim.study.policies.team import fly_team
from sim.world.outcome import FlightOutcome
from sim.world.uncertainty import Realization
from swarm.allocation import Problem, Rule
from swarm.allocation.index_rules import NEAREST, VALUE_PER_TIME
from swarm.model import TaskId, UavId
from swarm.runtime.clock import Clock


class RuleDispatcher:
    """Asks a rule."""

    def __init__(self, rule: Rule, account: Account) -> None:
        self._rule = rule
        self._account = account

    @property
    def account(self) -> Account:
        """Of its work so far."""
        return self._account

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        """News matter when the next UAV decides."""
        del situation, news
        return ()

    def choose(self, situation: TeamSituation, uav: int) -> int | None:
        """What the rule takes."""
        with self._account.timed():
            problem, state, rank = situation.problem, situation.state, situation.rank
            choice = self._rule.decide(problem, state, rank, uav)
        return None if choice is None else choice.task


PLANNED_BY = "guided"
"""Method of the offline plan."""


class ListFollower:
    """Every UAV does its list of task ids; see the module."""

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

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        """Put the plan into force when the mission begins."""
        if TeamNews.BEGUN in news:
            self.put_into_force(by_index(situation.problem, self._planned))
        return ()

    def choose(self, situation: TeamSituation, uav: int) -> int | None:
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

    def _next(self, situation: TeamSituation, uav: int) -> int | None:
        route = self._lists[uav]
        while route:
            task = route.pop(0)
            if situation.state.open[task]:
                return task
        return None

    def _unlisted(self, situation: TeamSituation, uav: int) -> int | None:
        state = situation.state.copy()
        for row, route in enumerate(self._lists):
            if state.active[row]:
                state.open[route] = False
        if not state.open.any():
            return None
        with self._account.timed():
            choice = VALUE_PER_TIME.decide(situation.problem, state, situation.rank, uav)
        return None if choice is None else choice.task


def by_index(problem: Problem, lists: Mapping[UavId, Sequence[TaskId]]) -> Routes:
    """Lists of ids as lists of indices; unknown tasks are left out."""
    columns = {task: column for column, task in enumerate(problem.task_ids)}
    return [
        [columns[task] for task in lists.get(uav, ()) if task in columns] for uav in problem.uav_ids
    ]


Maker = Callable[[Mapping[UavId, Sequence[TaskId]], Account, int], Dispatcher]
"""Makes a dispatcher of the offline plan's lists, an account of its work, and a seed."""


@dataclass(frozen=True, slots=True)
class TeamPolicy:
    """A policy by which one dispatcher decides for all UAVs."""

    name: str
    what: str
    make: Maker
    planned: bool = True
    """Whether it begins with the offline plan."""
    every_s: float | None = None
    """How often its dispatcher hears that time has passed [s]; None: never."""

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        """Fly a mission to its end; see `sim.study.policies.roster.Policy`."""
        best = plan(fate.mission, PLANNED_BY) if self.planned else None
        lists = {} if best is None else best.routes
        return fly_team(
            fate,
            self.make(lists, Account(clock), fate.seed),
            sequence=None if best is None else best.sequence,
            every_s=self.every_s,
        )


NEAREST_FIRST = TeamPolicy(
    "nearest",
    "every free UAV takes the task it reaches soonest",
    lambda _lists, account, _seed: RuleDispatcher(NEAREST, account),
    planned=False,
)
VALUE_PER_TIME_ONLINE = TeamPolicy(
    "value-per-time",
    "every free UAV takes the task worth most per time",
    lambda _lists, account, _seed: RuleDispatcher(VALUE_PER_TIME, account),
    planned=False,
)
FROZEN = TeamPolicy(
    "frozen",
    "the best offline plan, never changed; gaps by value per time",
    lambda lists, account, _seed: ListFollower(lists, account),
)
