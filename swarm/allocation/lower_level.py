"""The lower level (Fig. 1): UAVs decide one after another, each for itself.

The UAV that is free earliest decides next; at equal times the one earlier in the
priority sequence; then the smaller index. Used unchanged by the offline planner and
by every agent: decision by decision with any rule, or as one compiled run with a rule
that a kernel knows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import takewhile
from math import isfinite
from typing import Protocol, runtime_checkable

import numpy as np

from swarm.allocation.problem import BoolArray, FloatArray, IntArray, Problem
from swarm.kernels import lower_level as kernel
from swarm.kernels.lower_level import RuleCode


@dataclass(slots=True, eq=False)
class TeamState:
    """What has been decided so far; the lower level reads nothing else of the past.

    Raises:
        ValueError: the arrays' shapes do not fit each other.
    """

    free_s: FloatArray
    """(n_uav,) mission time at which each UAV is next free [s]; infinite for one that decides
    nothing more, though it takes part."""
    place_enu_m: FloatArray
    """(n_uav, 3) where each UAV is then [m; east, north, up]."""
    survived: FloatArray
    """(n_uav,) S of eq. 1 so far: product of the survival probabilities of its tasks."""
    open: BoolArray
    """(n_task,) tasks nobody has taken."""
    active: BoolArray
    """(n_uav,) UAVs that take part."""

    def __post_init__(self) -> None:
        n_uav = len(self.free_s)
        shapes = {"place_enu_m": (n_uav, 3), "survived": (n_uav,), "active": (n_uav,)}
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ValueError(f"{name} must have shape {shape}")

    @classmethod
    def at_start(cls, problem: Problem) -> TeamState:
        """Mission time 0: every UAV at its start, every task open."""
        return cls(
            free_s=np.zeros(problem.n_uav),
            place_enu_m=problem.start_enu_m.copy(),
            survived=np.ones(problem.n_uav),
            open=np.ones(problem.n_task, dtype=np.bool_),
            active=np.ones(problem.n_uav, dtype=np.bool_),
        )

    def copy(self) -> TeamState:
        """An independent copy."""
        return TeamState(
            self.free_s.copy(),
            self.place_enu_m.copy(),
            self.survived.copy(),
            self.open.copy(),
            self.active.copy(),
        )

    def apply(self, problem: Problem, decision: Decision) -> None:
        """Let ``decision`` happen: its UAV is next free at the completion, at the task's place."""
        uav, task = decision.uav, decision.task
        self.free_s[uav] = decision.completion_s
        self.place_enu_m[uav] = problem.task_enu_m[task]
        self.survived[uav] *= problem.survival[uav, task]
        self.open[task] = False


@dataclass(frozen=True, slots=True)
class Decision:
    """One UAV's choice of its next task."""

    uav: int
    task: int
    """Indices of the deciding UAV and of the task it takes."""
    decided_s: float
    """Mission time of the decision: when the UAV became free [s]."""
    completion_s: float
    """Predicted completion, exactly ``(decided_s + distance / speed) + service`` [s]."""
    score: float
    """What the rule maximised, for this task [value·s]."""
    second_score: float | None
    """The same for the best other task; None when there was no other."""
    certificate: bool
    """Theorem 5 proves that greedy and lookahead agree on this decision."""
    exact: bool
    """The choice is proven to be the rule's own maximum, not a heuristic's guess at it."""
    valued: tuple[tuple[int, float], ...] = ()
    """Tasks the rule compared on the way, with their scores: this one, then the others, best first.
    Empty where comparing them one by one would take longer than deciding; see `CompiledRule`."""

    @classmethod
    def of(
        cls,
        problem: Problem,
        state: TeamState,
        uav: int,
        task: int,
        score: float,
        *,
        second_score: float | None = None,
        exact: bool = False,
        valued: tuple[tuple[int, float], ...] = (),
    ) -> Decision:
        """``uav``, whose turn it is in ``state``, takes ``task``; without a certificate."""
        decided_s = float(state.free_s[uav])
        travel_s = problem.travel_along_s(uav, state.place_enu_m[uav], [task])[0]
        completion_s = float((decided_s + travel_s) + problem.service_s[task])
        return cls(uav, task, decided_s, completion_s, score, second_score, False, exact, valued)


class Rule(Protocol):
    """A decision rule: a pure function of the shared state."""

    @property
    def name(self) -> str:
        """Name under which plans and epochs refer to the rule."""

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; None when no open task is one it is capable of."""


@runtime_checkable
class ScoringRule(Rule, Protocol):
    """A rule that can say what it makes of the tasks it does not take."""

    def valued(
        self, problem: Problem, state: TeamState, uav: int, most: int
    ) -> tuple[tuple[int, float], ...]:
        """`Decision.valued` of what it would decide; so many tasks at the most."""


@runtime_checkable
class IdlingRule(Rule, Protocol):
    """A rule that tells of many UAVs at once that they take nothing."""

    def count_idle(
        self, problem: Problem, state: TeamState, rank: IntArray, uavs: Sequence[int]
    ) -> int:
        """How many of ``uavs``, free at one time and asked in this order, `decide` surely gives
        nothing before the first that it may give a task.
        """


@runtime_checkable
class CompiledRule(ScoringRule, Protocol):
    """A rule that the kernels know, so that they can run the whole lower level by it."""

    @property
    def code(self) -> RuleCode:
        """Its name to them."""


def rank_of(sequence: Sequence[int]) -> IntArray:
    """(n_uav,) place of each UAV in a priority sequence of UAV indices; 0 decides first.

    Raises:
        ValueError: the sequence does not name each of 0..n_uav-1 once.
    """
    rank = np.full(len(sequence), -1, dtype=np.int64)
    for place, uav in enumerate(sequence):
        if not 0 <= uav < len(rank) or rank[uav] >= 0:
            raise ValueError(f"sequence must name each UAV index once: {list(sequence)}")
        rank[uav] = place
    return rank


def decisions(
    problem: Problem, state: TeamState, rank: IntArray, rule: Rule, last: int | None = None
) -> Iterator[Decision]:
    """Decide in the order of Fig. 1 until no active UAV has an open task it is capable of.

    With ``last`` it ends once that UAV has had its turn, its decision being the last one if it
    takes a task. ``state`` is left unchanged; ``rank`` is as `rank_of` gives it.
    """
    state = state.copy()
    queue = [
        (free_s, place, uav)
        for uav, (free_s, place) in enumerate(
            zip(state.free_s.tolist(), rank.tolist(), strict=True)
        )
        if state.active[uav] and isfinite(free_s)
    ]
    heapify(queue)
    idling = rule if isinstance(rule, IdlingRule) else None
    turns: list[int] = []
    while queue:
        if idling is not None and (turns := turns or _before(last, queue)):
            idle = idling.count_idle(problem, state, rank, turns)
            for _ in range(idle):
                heappop(queue)
            if not queue:
                return
            turns = turns[idle + 1 :]
        now_s, place, uav = heappop(queue)
        decision = rule.decide(problem, state, rank, uav)
        if decision is not None:
            state.apply(problem, decision)
            if isfinite(decision.completion_s):
                heappush(queue, (decision.completion_s, place, uav))
            if decision.completion_s == now_s:  # it has a turn again before the others
                turns = []
            yield decision
        # Who takes none has no further decision, as tasks only close.
        if uav == last:
            return


def _before(last: int | None, queue: Sequence[tuple[float, int, int]]) -> list[int]:
    """UAVs of a heap that are free at its earliest time, in turn, if several; none from ``last``
    on.
    """
    free_s = queue[0][0]
    if len(queue) == 1 or free_s not in [each[0] for each in queue[1:3]]:
        return []
    turns = [uav for _, _, uav in sorted(each for each in queue if each[0] == free_s)]
    return turns if last is None else list(takewhile(lambda uav: uav != last, turns))


def next_decision(
    problem: Problem, state: TeamState, rank: IntArray, rule: Rule, uav: int
) -> Decision | None:
    """The decision ``uav`` takes if it is its turn now; None when nothing open suits it.

    Whose turn it is, is the caller's knowledge; inactive UAVs take nothing.
    """
    if not state.active[uav]:
        return None
    return rule.decide(problem, state, rank, uav)


def run(
    problem: Problem,
    state: TeamState,
    rank: IntArray,
    rule: Rule,
    should_stop: Callable[[], bool] | None = None,
) -> tuple[list[list[int]], FloatArray]:
    """All decisions as lists, as `decisions` takes them.

    ``should_stop`` is asked every few milliseconds, or between the decisions of a rule that is not
    compiled. Once it says so the decisions left are greedy, or are not taken.

    Returns:
        Task indices per UAV in order of execution, and (n_task,) completion times [s], NaN for
        tasks nobody took.
    """
    routes: list[list[int]] = [[] for _ in range(problem.n_uav)]
    completion_s = np.full(problem.n_task, np.nan)
    if isinstance(rule, CompiledRule):
        uavs, tasks, times_s, _ = kernel.run(problem.kernel, state, rank, rule.code, should_stop)
        for uav, task in zip(uavs.tolist(), tasks.tolist(), strict=True):
            routes[uav].append(task)
        completion_s[tasks] = times_s
        return routes, completion_s
    for decision in decisions(problem, state, rank, rule):
        routes[decision.uav].append(decision.task)
        completion_s[decision.task] = decision.completion_s
        if should_stop is not None and should_stop():
            break
    return routes, completion_s
