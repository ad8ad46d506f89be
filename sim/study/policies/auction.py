"""CBBA with re-bidding: whenever tasks or UAVs come or go, the auction is held anew.

All living UAVs drop what they are not flying to or serving, and bid from where and when they will
be free. In between they follow their paths. Leaves out: the auction itself
(`sim.study.baselines.cbba`), its messages and the time it takes.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from sim.fate import Fate
from sim.study.baselines.cbba import cbba
from sim.study.flight import Flight
from sim.study.policies.lists import ListFollower
from sim.study.policies.situation import Account, News, Situation
from sim.study.policies.team import fly_team
from sim.study.policy import Planner
from swarm.clock import Clock

__all__ = ["Auction", "Cbba"]

_UPON = frozenset({News.APPEARED, News.WITHDRAWN, News.LOST, News.REOPENED})


class Auction(ListFollower):
    """Follows paths won at auction.

    Args:
        account: of its work.
    """

    def __init__(self, account: Account) -> None:
        super().__init__({}, account)

    def hear(self, situation: Situation, news: Collection[News]) -> Collection[int]:
        """Hold the auction anew if the news are worth it."""
        begun = News.BEGUN in news
        if begun or (situation.state.open.any() and not _UPON.isdisjoint(news)):
            with self._account.timed():
                routes = cbba(situation.problem, state=situation.state).routes
            self.put_into_force(routes)
        return ()


@dataclass(frozen=True, slots=True)
class Cbba:
    """The auction, held anew at every event."""

    name: str = "cbba"
    what: str = "consensus-based bundle algorithm, re-bidding at every event"

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        """Fly a mission to its end; see `sim.study.policy.Policy`."""
        del plan
        return fly_team(fate, Auction(Account(clock)))
