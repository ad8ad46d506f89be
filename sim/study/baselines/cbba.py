"""The consensus-based bundle algorithm, the decentralised auction that most comparisons name.

Written from Choi, Brunet and How 2009 (doi:10.1109/TRO.2009.2022423): every UAV builds a bundle
of tasks by its own marginal gains in J (phase 1), then neighbours agree on winners by the action
rules of `sim.study.baselines.consensus` (phase 2); who is outbid drops that task and all it had
added after it. Marginal gains of eq. 1 may grow when other tasks join a path, and then the
auction need not end; so a bid is never above the UAV's earlier ones, while the choice goes by the
true gains (Johnson, Ponda, Choi and How 2012, doi:10.1109/CDC.2012.6425867).
Two departures: tasks whose gain is negative are bid for too, since eq. 1 wants all on the lists;
a task dropped because an earlier one was lost keeps the rival who also outbid it.
Leaves out: messages that are lost or late; rounds are synchronous.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coordinator.planner.stop import ShouldStop, never
from sim.study.baselines.consensus import NO_BID, NOBODY, Beliefs, hear
from sim.study.baselines.index_rule import Routes
from sim.study.baselines.insertion import Insertion
from sim.study.baselines.value_per_time import VALUE_PER_TIME
from swarm.allocation import Problem, TeamState, evaluate, rank_of, run
from swarm.allocation.problem import BoolArray, IntArray

__all__ = ["CbbaResult", "cbba"]


@dataclass(frozen=True, slots=True)
class CbbaResult:
    """How the auction ended."""

    routes: Routes
    """Disjoint lists of task indices per UAV."""
    rounds: int
    """Rounds of consensus; in each, every UAV sends one message to each neighbour."""
    converged: bool
    """All agree and nobody wants to change; otherwise it was stopped, and its conflicts were
    settled for the best bid."""
    completed: int
    """Tasks that nobody had won, because of the capacity or the stop, and that were handed out
    afterwards by value per time."""


def cbba(
    problem: Problem,
    *,
    state: TeamState | None = None,
    capacity: int | None = None,
    neighbours: BoolArray | None = None,
    should_stop: ShouldStop = never,
) -> CbbaResult:
    """Run the auction; the same problem gives the same lists.

    Args:
        problem: the mission.
        state: where the team stands: open tasks are auctioned among active UAVs; at its start when
            None.
        capacity: most tasks in a bundle (L_t); >= 1. None means no limit: bundles are bounded at
            first, to save work, and the bound is raised for as long as it holds anyone back.
        neighbours: (n_uav, n_uav) symmetric, connecting all active UAVs: who hears whom;
            everybody when None.
        should_stop: given the rounds so far, whether to stop.

    Raises:
        ValueError: capacity or neighbours are not as they must be.
    """
    if capacity is not None and capacity < 1:
        raise ValueError(f"capacity must be >= 1, not {capacity}")
    state = TeamState.at_start(problem) if state is None else state
    auction = _Auction(problem, state, _network(state.active, neighbours))
    n_open, n_active = int(state.open.sum()), int(state.active.sum())
    bound = capacity or 2 * -(-n_open // max(1, n_active)) + 2
    converged = auction.settle(bound, should_stop)
    while capacity is None and converged and auction.holds_back(bound):
        bound *= 2
        converged = auction.settle(bound, should_stop)
    routes, completed = _complete(problem, state, auction.paths_won())
    return CbbaResult(routes, auction.rounds, converged, completed)


class _Auction:
    """Beliefs, bundles and paths of all UAVs."""

    def __init__(self, problem: Problem, state: TeamState, neighbours: BoolArray) -> None:
        self.rounds = 0
        self._problem = problem
        self._eligible: BoolArray = problem.capable & state.open & state.active[:, None]
        self._insertion = Insertion(problem, state)
        self._beliefs = Beliefs.blank(problem.n_uav, problem.n_task)
        self._bundles: Routes = [[] for _ in range(problem.n_uav)]
        self._paths: Routes = [[] for _ in range(problem.n_uav)]
        self._receivers: list[IntArray] = [np.flatnonzero(row) for row in neighbours]
        n_active = int(state.active.sum())
        complete = int(neighbours.sum()) == n_active * (n_active - 1)
        # elsewhere news travel one neighbour a round
        self._quiet_rounds = 1 if complete else n_active

    def settle(self, capacity: int, should_stop: ShouldStop) -> bool:
        """Alternate the phases until nothing changes; whether it came to that."""
        stirred = set(range(self._problem.n_uav))
        quiet = 0
        while quiet < self._quiet_rounds:
            if should_stop(self.rounds):
                return False
            for uav in sorted(stirred):
                if not self._build(uav, capacity, should_stop):
                    return False
            before = self._beliefs.copy()
            self._agree(before)
            changed = (before.winner != self._beliefs.winner).any(axis=1)
            changed |= (before.bid != self._beliefs.bid).any(axis=1)
            stirred = {int(uav) for uav in np.flatnonzero(changed)}
            for uav in stirred:
                self._release(uav)
            quiet = 0 if stirred else quiet + 1
        return True

    def holds_back(self, capacity: int) -> bool:
        """Whether the capacity keeps any UAV from bidding on."""
        return any(
            len(bundle) >= capacity and len(bundle) < int(eligible.sum())
            for bundle, eligible in zip(self._bundles, self._eligible, strict=True)
        )

    def paths_won(self) -> Routes:
        """The paths, each task only with the UAV whose own bid for it is best."""
        owner: dict[int, tuple[float, int]] = {}
        for uav, path in enumerate(self._paths):
            for task in path:
                if self._beliefs.winner[uav, task] == uav:
                    claim = (-float(self._beliefs.bid[uav, task]), uav)
                    owner[task] = min(owner.get(task, claim), claim)
        return [
            [task for task in path if task in owner and owner[task][1] == uav]
            for uav, path in enumerate(self._paths)
        ]

    def _build(self, uav: int, capacity: int, should_stop: ShouldStop) -> bool:
        """Phase 1, Algorithm 3: add tasks for as long as some can be won; False if stopped."""
        bundle, path = self._bundles[uav], self._paths[uav]
        winner, bid = self._beliefs.winner[uav], self._beliefs.bid[uav]
        eligible = self._eligible[uav].copy()
        eligible[bundle] = False
        while len(bundle) < capacity and eligible.any():
            if should_stop(self.rounds):
                return False
            gains, places = self._insertion.gains(uav, path)
            ceiling = bid[bundle[-1]] if bundle else np.inf
            bids = np.minimum(gains, ceiling)
            wins = eligible & ((bids > bid) | ((bids == bid) & (uav < winner)))
            if not wins.any():
                return True
            task = int(np.argmax(np.where(wins, gains, -np.inf)))
            bundle.append(task)
            path.insert(int(places[task]), task)
            winner[task], bid[task] = uav, bids[task]
            eligible[task] = False
        return True

    def _agree(self, said: Beliefs) -> None:
        """Phase 2: everybody hears all neighbours, in the order of their indices."""
        self.rounds += 1
        for sender, receivers in enumerate(self._receivers):
            if len(receivers):
                hear(self._beliefs, said, sender, receivers, self.rounds)

    def _release(self, uav: int) -> None:
        """Drop the first task lost and all added after it (eq. 8 of the 2009 paper)."""
        bundle, winner = self._bundles[uav], self._beliefs.winner[uav]
        kept = next((n for n, task in enumerate(bundle) if winner[task] != uav), len(bundle))
        dropped = set(bundle[kept:])
        for task in dropped:
            if winner[task] == uav:
                winner[task], self._beliefs.bid[uav, task] = NOBODY, NO_BID
        del bundle[kept:]
        self._paths[uav] = [task for task in self._paths[uav] if task not in dropped]


def _network(active: BoolArray, neighbours: BoolArray | None) -> BoolArray:
    n_uav = len(active)
    network: BoolArray = ~np.eye(n_uav, dtype=np.bool_)
    if neighbours is not None:
        given = np.array(neighbours, dtype=np.bool_)
        if given.shape != (n_uav, n_uav) or (given != given.T).any():
            raise ValueError(f"neighbours must be symmetric, of shape {(n_uav, n_uav)}")
        network &= given
    network &= active & active[:, None]
    reached = np.zeros(n_uav, dtype=np.bool_)
    reached[np.flatnonzero(active)[:1]] = True
    for _ in range(n_uav):
        reached |= network[reached].any(axis=0)
    if (reached != active).any():
        raise ValueError("neighbours must connect all active UAVs")
    return network


def _complete(problem: Problem, state: TeamState, routes: Routes) -> tuple[Routes, int]:
    """The lists with all tasks on them that some UAV is capable of, and how many were missing."""
    _, completion_s = evaluate(problem, routes, state)
    after = state.copy()
    for uav, route in enumerate(routes):
        for task in route:
            after.survived[uav] *= problem.survival[uav, task]
        if route:
            after.free_s[uav] = completion_s[route[-1]]
            after.place_enu_m[uav] = problem.task_enu_m[route[-1]]
        after.open[route] = False
    rest, _ = run(problem, after, rank_of(range(problem.n_uav)), VALUE_PER_TIME)
    longer = [route + more for route, more in zip(routes, rest, strict=True)]
    return longer, sum(map(len, rest))
