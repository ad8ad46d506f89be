"""Policies that plan anew during a mission: by auction, or by one central optimiser.

The auction (CBBA) is held anew whenever tasks or UAVs come or go. The optimiser hears everything
at once and searches the lists of all open tasks from those in force on, with the effort of a live
coordinator (`coordinator.planner.online`). Leaves out: messages, and the time that planning takes.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from sim.study.baselines.cbba import cbba
from sim.study.policies.dispatchers import ListFollower, TeamPolicy
from sim.study.policies.situation import Account, TeamNews, TeamSituation
from swarm.allocation import Problem, TeamState, evaluate
from swarm.allocation.rules import team_arrays
from swarm.kernels.routes import optimise_routes
from swarm.model import TaskId, UavId

_UPON = frozenset({TeamNews.APPEARED, TeamNews.WITHDRAWN, TeamNews.LOST, TeamNews.REOPENED})


class AuctionDispatcher(ListFollower):
    """Follows paths won at auction."""

    def __init__(self, account: Account) -> None:
        super().__init__({}, account)

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        """Hold the auction anew if the news are worth it."""
        begun = TeamNews.BEGUN in news
        if begun or (situation.state.open.any() and not _UPON.isdisjoint(news)):
            with self._account.timed():
                routes = cbba(situation.problem, state=situation.state).routes
            self.put_into_force(routes)
        return ()


_ITERATIONS_PER_TASK = 400
"""As in `coordinator.planner.online`."""
_ITERATIONS_WITHOUT_NEWS = 100
"""The same when an attempt has ended and nothing else happened: the lists in force answer to that,
and more work was measured to bring no more value."""

_LEAST_GAIN = 1e-9
"""Of the value still to be won: less is rounding."""
_EVENTS = frozenset(TeamNews) - {TeamNews.BEGUN, TeamNews.TIME}
_NO_NEWS = frozenset({TeamNews.ENDED})


class CentralOptimiser(ListFollower):
    """Follows lists that it improves ``upon`` certain news; it may divert UAVs in flight."""

    def __init__(
        self,
        lists: Mapping[UavId, Sequence[TaskId]],
        account: Account,
        *,
        seed: int,
        upon: Collection[TeamNews] = _EVENTS,
        diverts: bool = False,
    ) -> None:
        super().__init__(lists, account)
        self._seed = seed
        self._upon = frozenset(upon)
        self._diverts = diverts
        self._plans = 0

    def hear(self, situation: TeamSituation, news: Collection[TeamNews]) -> Collection[int]:
        """Plan anew if the news are worth it."""
        super().hear(situation, news)
        if self._upon.isdisjoint(news):
            return ()
        quiet = _NO_NEWS.issuperset(news)
        per_task = _ITERATIONS_WITHOUT_NEWS if quiet else _ITERATIONS_PER_TASK
        if not self._diverts:
            self._improve(situation.problem, situation.state, per_task)
            return ()
        legs, in_flight = situation.legs, situation.in_flight()
        for uav in in_flight:
            self._lists[uav].insert(0, legs[uav].task)
        self._improve(situation.problem, situation.if_stopped(), per_task)
        stopped = []
        for uav in in_flight:
            if self._lists[uav][:1] == [legs[uav].task]:
                del self._lists[uav][0]
            else:
                stopped.append(uav)
        return stopped

    def _improve(self, problem: Problem, state: TeamState, iterations_per_task: int) -> None:
        """Put better lists into force, if any are found."""
        takers = problem.capable[state.active].any(axis=0)
        n_open = int(np.count_nonzero(state.open & takers))
        if not n_open:
            return
        going_on = [
            [task for task in route if state.open[task]] if state.active[uav] else []
            for uav, route in enumerate(self._lists)
        ]
        with self._account.timed():
            team = team_arrays(problem, state, state.active, 0.0)
            routes, worth = optimise_routes(
                team,
                seed=self._seed + self._plans,
                iterations=iterations_per_task * n_open,
                lists=going_on,
                threads=1,
            )
            self._plans += 1
            if sum(map(len, going_on)) == n_open:
                before, _ = evaluate(problem, going_on, state)
                if worth <= before + _LEAST_GAIN * abs(before):
                    return
        self.put_into_force(routes)


CBBA = TeamPolicy(
    "cbba",
    "consensus-based bundle algorithm, re-bidding at every event",
    lambda _lists, account, _seed: AuctionDispatcher(account),
    planned=False,
)
CENTRAL = TeamPolicy(
    "central",
    "central re-optimisation at every event, ideal communication",
    lambda lists, account, seed: CentralOptimiser(lists, account, seed=seed),
)
"""A task flown to stays with its UAV."""
CENTRAL_DIVERT = TeamPolicy(
    "central-divert",
    "central re-optimisation at every event, UAVs in flight are diverted",
    lambda lists, account, seed: CentralOptimiser(lists, account, seed=seed, diverts=True),
)


def interval(interval_s: float = 60.0) -> TeamPolicy:
    """Re-optimisation at fixed intervals; in between, lists are followed and gaps filled.

    Raises:
        ValueError: the interval is not positive and finite.
    """
    if not 0.0 < interval_s < math.inf:
        raise ValueError(f"interval_s must be > 0 and finite, not {interval_s}")
    return TeamPolicy(
        f"interval:{interval_s:g}",
        f"central re-optimisation every {interval_s:g} s, ideal communication",
        lambda lists, account, seed: CentralOptimiser(
            lists, account, seed=seed, upon=(TeamNews.TIME,)
        ),
        every_s=interval_s,
    )
