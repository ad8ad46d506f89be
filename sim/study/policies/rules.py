"""Decision rules without a plan: every UAV that is free takes an open task by a rule.

Leaves out: the rules (`sim.study.baselines`, `swarm.allocation.rules`).
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from sim.fate import Fate
from sim.study.baselines.nearest import NEAREST
from sim.study.baselines.value_per_time import VALUE_PER_TIME
from sim.study.flight import Flight
from sim.study.policies.situation import Account, News, Situation
from sim.study.policies.team import fly_team
from sim.study.policy import Planner
from swarm.allocation import Rule
from swarm.clock import Clock

__all__ = ["NEAREST_FIRST", "VALUE_PER_TIME_ONLINE", "ByRule", "RuleChooser"]


class RuleChooser:
    """Asks a rule."""

    def __init__(self, rule: Rule, account: Account) -> None:
        self._rule = rule
        self._account = account

    @property
    def account(self) -> Account:
        """Of its work so far."""
        return self._account

    def hear(self, situation: Situation, news: Collection[News]) -> Collection[int]:
        """News matter when the next UAV decides."""
        del situation, news
        return ()

    def choose(self, situation: Situation, uav: int) -> int | None:
        """What the rule takes."""
        with self._account.timed():
            problem, state, rank = situation.problem, situation.state, situation.rank
            choice = self._rule.decide(problem, state, rank, uav)
        return None if choice is None else choice.task


@dataclass(frozen=True, slots=True)
class ByRule:
    """Every UAV by the same rule, without any plan."""

    name: str
    what: str
    rule: Rule

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        """Fly a mission to its end; see `sim.study.policy.Policy`."""
        del plan
        return fly_team(fate, RuleChooser(self.rule, Account(clock)))


NEAREST_FIRST = ByRule("nearest", "every free UAV takes the task it reaches soonest", NEAREST)
VALUE_PER_TIME_ONLINE = ByRule(
    "value-per-time", "every free UAV takes the task worth most per time", VALUE_PER_TIME
)
