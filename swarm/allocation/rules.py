"""Decision rules: how a UAV whose turn it is chooses its next task.

Pure functions of the shared state; ties go to the smaller task index. Leaves out: whose
turn it is (`swarm.allocation.lower_level`) and the priority sequence.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from swarm.allocation.certificate import agrees
from swarm.allocation.long_tours import good_tours
from swarm.allocation.lower_level import Decision, Rule, TeamState
from swarm.allocation.problem import FloatArray, IntArray, Problem
from swarm.allocation.tours import TourTable, legs_s, mask_of, tour_table

__all__ = ["EXACT_TASKS", "RULE_NAMES", "Greedy", "Lookahead", "Rule", "rule_by_name"]

EXACT_TASKS = 12
"""`lookahead` is exact up to this many open tasks that the UAV is capable of."""

RULE_NAMES = ("greedy", "lookahead")


def rule_by_name(name: str) -> Rule:
    """A new rule of this name.

    Raises:
        ValueError: there is no such rule.
    """
    if name == "greedy":
        return Greedy()
    if name == "lookahead":
        return Lookahead()
    raise ValueError(f"rule must be one of {', '.join(RULE_NAMES)}, not {name!r}")


@dataclass(frozen=True, slots=True)
class Greedy:
    """Eq. 7: the open task with the largest p·S·m·(D − t)."""

    name: str = field(default="greedy", init=False)

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        return _Outlook.of(problem, state, uav).greedy_decision()


class Lookahead:
    """Eq. 6, 8: the first task of the UAV's own best tour of all tasks open to it.

    Exact up to `EXACT_TASKS` tasks, and where Theorem 5 settles it; a heuristic's tour beyond.
    Tour tables are kept for the problem last asked about; they change speed, never results.
    """

    name = "lookahead"

    def __init__(self) -> None:
        self._problem: Problem | None = None
        self._tables: dict[int, tuple[IntArray, TourTable]] = {}

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        outlook = _Outlook.of(problem, state, uav)
        tasks = outlook.tasks
        if len(tasks) < 2:
            return outlook.greedy_decision()
        if len(tasks) > EXACT_TASKS:
            return self._long_decision(outlook)
        kept, table = self._table(problem, uav, tasks)
        inside = np.searchsorted(kept, tasks)
        completion_s = np.full(len(kept), np.nan)
        completion_s[inside] = outlook.completion_s
        values = table.first_values(mask_of(inside), completion_s)[inside]
        values *= float(state.survived[uav])
        certificate = outlook.certificate()
        # where Theorem 5 settles the choice, rounding in the tours' sums must not
        best = int((outlook.scores if certificate else values).argmax())
        score = float(values[best])
        values[best] = -np.inf
        return outlook.decision(best, score, float(values.max()), certificate, exact=True)

    def _long_decision(self, outlook: _Outlook) -> Decision:
        problem, uav, tasks = outlook.problem, outlook.uav, outlook.tasks
        tour, value, second = good_tours(
            outlook.completion_s,
            problem.weight[uav, tasks],
            problem.survival[uav, tasks],
            legs_s(problem, uav, tasks),
            problem.horizon_s,
        )
        survived = outlook.survived
        best = int(tour[0])
        certificate = outlook.certificate()
        if certificate and int(outlook.scores.argmax()) != best:
            best, value, second = int(outlook.scores.argmax()), second, value
        return outlook.decision(
            best, survived * value, survived * second, certificate, exact=certificate
        )

    def _table(self, problem: Problem, uav: int, tasks: IntArray) -> tuple[IntArray, TourTable]:
        """A table over ``tasks`` or more, and the tasks it is over (ascending)."""
        if self._problem is not problem:
            self._problem, self._tables = problem, {}
        known = self._tables.get(uav)
        if known is not None and np.isin(tasks, known[0], assume_unique=True).all():
            return known
        table = tour_table(
            problem.weight[uav, tasks],
            problem.survival[uav, tasks],
            legs_s(problem, uav, tasks),
            problem.horizon_s,
        )
        self._tables[uav] = (tasks, table)
        return self._tables[uav]


@dataclass(frozen=True, slots=True, eq=False)
class _Outlook:
    """What one UAV could do next."""

    problem: Problem
    uav: int
    free_s: float
    survived: float
    tasks: IntArray
    """(n,) open tasks it is capable of, ascending."""
    completion_s: FloatArray
    """(n,) when each would be complete if taken next [s]."""
    scores: FloatArray
    """(n,) S·p·m·(D − t)."""

    @classmethod
    def of(cls, problem: Problem, state: TeamState, uav: int) -> _Outlook:
        tasks = (state.open & problem.capable[uav]).nonzero()[0]
        free_s, survived = float(state.free_s[uav]), float(state.survived[uav])
        completion_s = problem.travel_s(uav, state.place_enu_m[uav])
        completion_s += free_s
        completion_s += problem.service_s
        scores = problem.horizon_s - completion_s
        scores *= survived * problem.weight[uav]
        return cls(problem, uav, free_s, survived, tasks, completion_s[tasks], scores[tasks])

    def greedy_decision(self) -> Decision | None:
        n = len(self.tasks)
        if n == 0:
            return None
        best = int(self.scores.argmax())
        score = float(self.scores[best])
        if n == 1:
            return self.decision(best, score, None, True, exact=True)
        others = self.scores.copy()
        others[best] = -np.inf
        return self.decision(best, score, float(others.max()), self.certificate(), exact=True)

    def certificate(self) -> bool:
        return agrees(self.problem, self.uav, self.tasks, self.scores, self.completion_s)

    def decision(
        self, best: int, score: float, second: float | None, certificate: bool, *, exact: bool
    ) -> Decision:
        return Decision(
            self.uav,
            int(self.tasks[best]),
            self.free_s,
            float(self.completion_s[best]),
            score,
            second,
            certificate,
            exact,
        )
