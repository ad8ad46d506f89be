"""The consensus-based bundle algorithm, the decentralised auction that most comparisons name.

Written from Choi, Brunet and How 2009 (doi:10.1109/TRO.2009.2022423): every UAV builds a bundle
of tasks by its own marginal gains in J (phase 1, `Insertion`), then neighbours agree on winners by
the action rules of their Table I (phase 2, `Beliefs`); who is outbid drops that task and all it
had added after it. Marginal gains of eq. 1 may grow when other tasks join a path, and then the
auction need not end; so a bid is never above the UAV's earlier ones, while the choice goes by the
true gains (Johnson, Ponda, Choi and How 2012, doi:10.1109/CDC.2012.6425867).
Two departures: tasks whose gain is negative are bid for too, since eq. 1 wants all on the lists;
a task dropped because an earlier one was lost keeps the rival who also outbid it. Equal bids go to
the smaller UAV index. Leaves out: messages that are lost or late; rounds are synchronous.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from coordinator.planner.options import ShouldStop, never
from sim.study.baselines.index_rules import Routes
from swarm.allocation import evaluate, rank_of, run
from swarm.allocation.index_rules import VALUE_PER_TIME
from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import BoolArray, FloatArray, IntArray, Problem


class Insertion:
    """Gains of insertion into paths that begin where the team stands; at its start when None.

    Keeps (n_task,) travel times for every UAV and task that has been on its path.
    """

    def __init__(self, problem: Problem, state: TeamState | None = None) -> None:
        self._problem = problem
        self._state = TeamState.at_start(problem) if state is None else state
        self._from_task_s: dict[tuple[int, int], FloatArray] = {}
        self._from_start_s = [
            problem.travel_s(uav, place) for uav, place in enumerate(self._state.place_enu_m)
        ]

    def gains(self, uav: int, path: Sequence[int]) -> tuple[FloatArray, IntArray]:
        """The best insertion of each task into ``path``.

        Returns:
            (n_task,) marginal J of each task at its best place [value·s], meaningless for tasks
            that are on the path, and (n_task,) those places: 0 is before the first task. Ties go
            to the earlier place.
        """
        problem = self._problem
        go_s = np.array([self._from_start_s[uav], *(self._row_s(uav, task) for task in path)])
        nodes = np.array(path, dtype=np.int64)
        legs_s = go_s[np.arange(len(path)), nodes]
        free_s = np.concatenate(
            ([self._state.free_s[uav]], legs_s + problem.service_s[nodes])
        ).cumsum()
        survived = np.concatenate(
            ([self._state.survived[uav]], problem.survival[uav, nodes])
        ).cumprod()
        weight = survived[:-1] * problem.weight[uav, nodes]
        later_weight = _from_the_end(weight)
        later_worth = _from_the_end(weight * (problem.horizon_s - free_s[1:]))

        detour_s = go_s + problem.service_s
        gain = problem.horizon_s - free_s[:, None] - detour_s
        gain *= survived[:, None] * problem.weight[uav]
        detour_s[:-1] += go_s[1:] - legs_s[:, None]
        survival = problem.survival[uav]
        gain -= survival * detour_s * later_weight[:, None]
        gain -= (1.0 - survival) * later_worth[:, None]
        places: IntArray = np.argmax(gain, axis=0)
        return gain[places, np.arange(problem.n_task)], places

    def _row_s(self, uav: int, task: int) -> FloatArray:
        row = self._from_task_s.get((uav, task))
        if row is None:
            row = self._problem.travel_s(uav, self._problem.task_enu_m[task])
            self._from_task_s[uav, task] = row
        return row


def _from_the_end(terms: FloatArray) -> FloatArray:
    """(n + 1,) sum of the terms from each place on; the last is 0."""
    sums: FloatArray = np.concatenate((np.cumsum(terms[::-1])[::-1], [0.0]))
    return sums


NOBODY = -1
"""Winner of a task for which no bid is known."""
NO_BID = -np.inf
"""Bid for such a task. The paper has 0, and tasks not worth it stay behind; eq. 1 wants all."""


@dataclass(frozen=True, slots=True, eq=False)
class Beliefs:
    """What every UAV believes; row i is UAV i's."""

    winner: IntArray
    """(n_uav, n_task) z: who wins each task; `NOBODY` if none."""
    bid: FloatArray
    """(n_uav, n_task) y: the winner's bid [value·s]; `NO_BID` if none."""
    heard: IntArray
    """(n_uav, n_uav) s: the round of the newest information about each UAV."""

    @classmethod
    def blank(cls, n_uav: int, n_task: int) -> Beliefs:
        """Nobody has bid, nobody has been heard."""
        return cls(
            np.full((n_uav, n_task), NOBODY, dtype=np.int64),
            np.full((n_uav, n_task), NO_BID),
            np.zeros((n_uav, n_uav), dtype=np.int64),
        )

    def copy(self) -> Beliefs:
        """Independent arrays."""
        return Beliefs(self.winner.copy(), self.bid.copy(), self.heard.copy())


def update_beliefs(
    beliefs: Beliefs, said: Beliefs, sender: int, receivers: IntArray, now: int
) -> None:
    """Let ``receivers`` take in one message of ``sender``.

    Args:
        beliefs: changed in place.
        said: what was believed when the message was sent.
        sender: index of a UAV, not among the receivers.
        receivers: (k,) indices.
        now: number of this round; timestamps of direct contact.
    """
    own = receivers[:, None]
    mine, my_bid = beliefs.winner[receivers], beliefs.bid[receivers]
    theirs, their_bid = said.winner[sender], said.bid[sender]
    better = (their_bid > my_bid) | ((their_bid == my_bid) & (theirs < mine))

    news = said.heard[sender] > beliefs.heard[receivers]  # (k, n_uav): s_km > s_im
    stale = said.heard[sender] < beliefs.heard[receivers]
    # a winner that is nobody points anywhere; every use below asks for somebody first
    news_of_mine = np.take_along_axis(news, np.maximum(mine, 0), axis=1)
    news_of_theirs = news[:, theirs]
    stale_of_theirs = stale[:, theirs]

    i_win, sender_wins, nobody = mine == own, mine == sender, mine == NOBODY
    third = ~(i_win | sender_wins | nobody)
    says_self, says_nobody = theirs == sender, theirs == NOBODY
    says_me = theirs == own
    says_third = ~(says_self | says_nobody | says_me)
    same, other = third & (mine == theirs), third & (mine != theirs)

    update: BoolArray = says_self & (
        (i_win & better) | sender_wins | (third & (news_of_mine | better)) | nobody
    )
    reset: BoolArray = says_me & (sender_wins | (third & news_of_mine))
    update |= (
        says_third
        & news_of_theirs
        & ((i_win & better) | sender_wins | same | (other & (news_of_mine | better)) | nobody)
    )
    reset |= says_third & sender_wins & ~news_of_theirs
    reset |= says_third & other & news_of_mine & stale_of_theirs
    update |= says_nobody & (sender_wins | (third & news_of_mine))

    beliefs.winner[receivers] = np.where(update, theirs, np.where(reset, NOBODY, mine))
    beliefs.bid[receivers] = np.where(update, their_bid, np.where(reset, NO_BID, my_bid))
    beliefs.heard[receivers] = np.maximum(beliefs.heard[receivers], said.heard[sender])
    beliefs.heard[receivers, sender] = now


@dataclass(frozen=True, slots=True)
class CbbaResult:
    """How the auction ended."""

    routes: Routes
    """Disjoint lists of task indices per UAV."""
    rounds: int
    """Rounds of consensus; in each, every UAV sends one message to each other one."""
    converged: bool
    """All agree and nobody wants to change; otherwise it was stopped, and its conflicts were
    settled for the best bid."""
    completed: int
    """Tasks that nobody had won because of the stop, handed out afterwards by value per time."""


def cbba(
    problem: Problem,
    *,
    state: TeamState | None = None,
    should_stop: ShouldStop = never,
) -> CbbaResult:
    """Run the auction; the same problem gives the same lists.

    Open tasks are auctioned among active UAVs from where they stand; ``state`` is the start when
    None. ``should_stop`` is given the rounds so far.
    """
    state = TeamState.at_start(problem) if state is None else state
    eligible = problem.capable & state.open & state.active[:, None]
    auction = Auction(Insertion(problem, state), eligible, state.active)
    converged = auction.run(int(state.open.sum()), should_stop)
    routes, completed = _complete(problem, state, auction.paths_won())
    return CbbaResult(routes, auction.rounds, converged, completed)


class Gains(Protocol):
    """What a UAV's path gains by each task."""

    def gains(self, uav: int, path: Sequence[int]) -> tuple[FloatArray, IntArray]:
        """See `Insertion.gains`; -infinity for a task that is not bid for."""
        ...


class Auction:
    """Beliefs, bundles and paths of all UAVs.

    Args:
        insertion: gives bids.
        eligible: (n_uav, n_task) tasks that may be bid for.
        active: (n_uav,) who takes part.
    """

    def __init__(self, insertion: Gains, eligible: BoolArray, active: BoolArray) -> None:
        self.rounds = 0
        n_uav, n_task = eligible.shape
        self._eligible = eligible
        self._insertion = insertion
        self._beliefs = Beliefs.blank(n_uav, n_task)
        self._bundles: Routes = [[] for _ in range(n_uav)]
        self._paths: Routes = [[] for _ in range(n_uav)]
        self._active: list[int] = np.flatnonzero(active).tolist()

    def run(self, n_open: int, should_stop: ShouldStop = never) -> bool:
        """Hold it over ``n_open`` tasks to its end; False if stopped.

        Bundles are bounded at first, to save work, for as long as that holds nobody back.
        """
        bound = 2 * -(-n_open // max(1, len(self._active))) + 2
        converged = self.settle(bound, should_stop)
        while converged and self.holds_back(bound):
            bound *= 2
            converged = self.settle(bound, should_stop)
        return converged

    def settle(self, capacity: int, should_stop: ShouldStop) -> bool:
        """Alternate the phases until nothing changes; whether it came to that."""
        stirred = set(range(len(self._eligible)))
        while stirred:
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
        """Phase 2: everybody hears all others, in the order of their indices."""
        self.rounds += 1
        for sender in self._active:
            receivers = np.array([uav for uav in self._active if uav != sender], dtype=np.int64)
            if len(receivers):
                update_beliefs(self._beliefs, said, sender, receivers, self.rounds)

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
