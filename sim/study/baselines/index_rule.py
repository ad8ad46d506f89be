"""Decision rules that take the open task with the largest index, whatever the others do.

They fit the lower level of Fig. 1 (`swarm.allocation.lower_level`) as they are. Leaves out: the
indices themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from swarm.allocation import Decision, Problem, TeamState, rank_of, run
from swarm.allocation.problem import FloatArray, IntArray

__all__ = ["IndexRule", "Routes", "routes_by"]

Routes = list[list[int]]
"""Task indices per UAV in order of execution."""

Index = Callable[[Problem, int, FloatArray], FloatArray]
"""Of (problem, UAV index, (n_task,) travel times from where it is [s]): (n_task,) the index."""


@dataclass(frozen=True, slots=True)
class IndexRule:
    """Take the open task with the largest index; ties go to the smaller task index."""

    name: str
    index: Index

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        """The next task of ``uav``; ``rank`` plays no part."""
        del rank
        candidates = np.flatnonzero(state.open & problem.capable[uav])
        if not len(candidates):
            return None
        travel_s = problem.travel_s(uav, state.place_enu_m[uav])
        scores = self.index(problem, uav, travel_s)[candidates]
        best = int(np.argmax(scores))
        task = int(candidates[best])
        decided_s = float(state.free_s[uav])
        others = np.delete(scores, best)
        return Decision(
            uav=uav,
            task=task,
            decided_s=decided_s,
            completion_s=float((decided_s + travel_s[task]) + problem.service_s[task]),
            score=float(scores[best]),
            second_score=float(others.max()) if len(others) else None,
            certificate=False,
            exact=True,
        )


def routes_by(rule: IndexRule, problem: Problem, sequence: Sequence[int] | None = None) -> Routes:
    """The lists to which ``rule`` leads.

    Args:
        rule: how every UAV decides.
        problem: the mission.
        sequence: UAV indices, first decider first; as in the problem when None.
    """
    order = range(problem.n_uav) if sequence is None else sequence
    return run(problem, TeamState.at_start(problem), rank_of(order), rule)[0]
