"""Decision rules: how a UAV whose turn it is chooses its next task.

Rules with a fixed formula run in a kernel, or rank the open tasks by an index
(swarm.allocation.index_rules). The rule `guided` keeps to the published routes
unless a fortified rollout shows something better.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile
from weakref import ReferenceType, ref

import numpy as np

from swarm.allocation.index_rules import INDEX_RULES, IndexRule
from swarm.allocation.lower_level import Decision, TeamState
from swarm.allocation.problem import BoolArray, IntArray, Problem
from swarm.kernels.lower_level import GREEDY, LOOKAHEAD, RuleCode, decide, valued
from swarm.kernels.rollout import GuidedChoice, count_idle, guided_choice
from swarm.kernels.routes import ListArrays, TeamArrays

_CODES: dict[str, RuleCode] = {"greedy": GREEDY, "lookahead": LOOKAHEAD}

RULE_NAMES = (*_CODES, *INDEX_RULES)
"""Of rules that need nothing but the shared state; `GuidedRule` needs lists."""


@dataclass(frozen=True, slots=True)
class KernelRule:
    """Greedy (eq. 7): the open task with the largest p·S·m·(D − t). Or lookahead (eq. 6, 8): the
    first task of the UAV's own best complete tour of all tasks open to it.

    Lookahead is exact up to `EXACT_TASKS` tasks, and where Theorem 5 settles it; a heuristic's tour
    beyond.
    """

    name: str
    code: RuleCode

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        fields = decide(problem.kernel, state, uav, self.code)
        return None if fields is None else Decision(*fields)

    def valued(
        self, problem: Problem, state: TeamState, uav: int, most: int
    ) -> tuple[tuple[int, float], ...]:
        """Tasks with their scores, the one it decides on first; so many at the most."""
        return tuple(valued(problem.kernel, state, uav, self.code, most))


def rule_by_name(name: str) -> KernelRule | IndexRule:
    """The rule of this name.

    Raises:
        ValueError: there is no such rule.
    """
    if name in INDEX_RULES:
        return INDEX_RULES[name]
    if name not in _CODES:
        raise ValueError(f"rule must be one of {', '.join(RULE_NAMES)}, not {name!r}")
    return KernelRule(name, _CODES[name])


def kernel_rule(name: str) -> KernelRule:
    """The compiled rule of this name.

    Raises:
        ValueError: there is no such rule.
    """
    if name not in _CODES:
        raise ValueError(f"rule must be one of {', '.join(_CODES)}, not {name!r}")
    return KernelRule(name, _CODES[name])


_REPAIR_ITERATIONS = 200
"""Steps of the search after a disturbance."""


class GuidedRule:
    """Decide by published lists; see the module.

    Args:
        lists: task ids per UAV id in order; ids that a problem does not know are skipped.
        repair_iterations: steps of the search after a disturbance; all replicas need the same.

    The lists as the problem last asked about has them are kept; that changes speed, never results.
    """

    name = "guided"

    def __init__(
        self,
        lists: Mapping[str, Sequence[str]],
        *,
        repair_iterations: int = _REPAIR_ITERATIONS,
    ) -> None:
        self._lists = {uav: tuple(tasks) for uav, tasks in lists.items()}
        self._repair_iterations = repair_iterations
        self._known_of: ReferenceType[Problem] | None = None
        """The problem asked about last; not kept from being forgotten by all others."""
        self._routes = ListArrays.of([], 0, 0)
        self._owner: IntArray = np.zeros(0, dtype=np.int64)
        self._lacks_some = False
        """Whether some task that somebody can do is on no list."""

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; None when nothing open suits it or the team is better off.

        UAVs that have had their turn without taking a task are not counted upon: those free
        before this decision, or at the same time with a better rank.
        """
        if not (state.open & problem.capable[uav]).any():
            return None
        choice = self._choice(problem, state, rank, uav)
        if choice.task is None:
            return None
        return Decision.of(
            problem,
            state,
            uav,
            choice.task,
            choice.worth,
            second_score=choice.second_worth,
            valued=choice.valued,
        )

    def count_idle(
        self, problem: Problem, state: TeamState, rank: IntArray, uavs: Sequence[int]
    ) -> int:
        """How many of ``uavs``, free at one time, take nothing before the first that may."""
        self._look_up(problem)
        listed = np.zeros(problem.n_uav, dtype=np.bool_)
        listed[self._owner[state.open & (self._owner >= 0)]] = True
        asked = list(takewhile(lambda uav: not listed[uav], uavs))
        if not asked:
            return 0
        now_s = float(state.free_s[asked[0]])
        active = state.active & ~_has_declined(state, rank, now_s, int(rank[asked[0]]))
        active[asked] = True
        return count_idle(team_arrays(problem, state, active, now_s), self._routes, asked)

    def worth(self, problem: Problem, state: TeamState, rank: IntArray, uav: int) -> float:
        """J to go of the whole team when ``uav`` has its turn [value·s]; the score of `decide`."""
        return self._choice(problem, state, rank, uav).worth

    def _choice(self, problem: Problem, state: TeamState, rank: IntArray, uav: int) -> GuidedChoice:
        self._look_up(problem)
        now_s = float(state.free_s[uav])
        active = state.active & ~_has_declined(state, rank, now_s, int(rank[uav]))
        active[uav] = True
        team = team_arrays(problem, state, active, now_s)
        kept = (self._owner >= 0) & active[self._owner]
        disturbed = self._lacks_some or bool((state.open & ~kept).any())
        return guided_choice(
            team, self._routes, uav, iterations=self._repair_iterations if disturbed else 0
        )

    def _look_up(self, problem: Problem) -> None:
        """Find the listed tasks among those of the problem."""
        if self._known_of is not None and self._known_of() is problem:
            return
        self._known_of = ref(problem)
        index = problem.column_of
        routes = [
            [index[task] for task in self._lists.get(uav, ()) if task in index]
            for uav in problem.uav_ids
        ]
        self._routes = ListArrays.of(routes, problem.n_uav, problem.n_task)
        self._owner = np.full(problem.n_task, -1, dtype=np.int64)
        self._owner[self._routes.task] = self._routes.uav
        self._lacks_some = bool((problem.capable.any(axis=0) & (self._owner < 0)).any())


def team_arrays(problem: Problem, state: TeamState, active: BoolArray, now_s: float) -> TeamArrays:
    """The state for route kernels; UAVs that are free at an unknown time count as free now."""
    free_s = np.where(np.isfinite(state.free_s), state.free_s, now_s)
    return TeamArrays(problem.kernel, free_s, state.place_enu_m, state.survived, active, state.open)


def team_at_start(problem: Problem) -> TeamArrays:
    """The same at mission time 0, with everything open."""
    state = TeamState.at_start(problem)
    return team_arrays(problem, state, state.active, 0.0)


def _has_declined(state: TeamState, rank: IntArray, now_s: float, own_rank: int) -> BoolArray:
    declined: BoolArray = state.free_s < now_s
    declined |= (state.free_s == now_s) & (rank < own_rank)
    return declined
