"""Attempts at tasks that UAVs have ended, and where each UAV stands after its own.

A fleet of hundreds has thousands of attempts behind it, and at every decision of an agent it
matters where everybody stands. So what one more attempt changes is one UAV's standing, worked out
anew from its own attempts when somebody asks. Leaves out: what has become of the tasks
(swarm.protocol.board).
"""

from __future__ import annotations

from bisect import insort

import numpy as np

from swarm.allocation.lower_level import TeamState
from swarm.allocation.problem import Problem


class Attempts:
    """Those that the outcomes of one board tell of."""

    def __init__(self) -> None:
        self.of_uav: dict[str, list[tuple[float, int, str]]] = {}
        """By UAV completion [s], number and task of each: one after the other, and at one time in
        board order."""
        self._team: TeamState | None = None
        """After all attempts but those of `_moved`, apart from its tasks."""
        self._moved: set[str] = set()

    def add(self, completed_s: float, number: int, task: str, uav: str) -> None:
        """One more, which need not be the last one."""
        insort(self.of_uav.setdefault(uav, []), (completed_s, number, task))
        self._moved.add(uav)

    def team(self, problem: Problem) -> TeamState:
        """Where every UAV of ``problem`` stands; all of them active, all tasks open.

        Args:
            problem: of the board that these are attempts at. Whatever else it comes to know, where
                its tasks are and what survives them stays, or the attempts are to be told anew.
        """
        state = self._team
        if state is None:
            state = self._team = TeamState.at_start(problem)
        for uav in self._moved.intersection(problem.row_of):
            row = problem.row_of[uav]
            attempted = self.of_uav[uav]
            columns = [problem.column_of[task] for _, _, task in attempted]
            state.free_s[row] = attempted[-1][0]
            state.place_enu_m[row] = problem.task_enu_m[columns[-1]]
            state.survived[row] = 1.0
            for column in columns:
                state.survived[row] *= problem.survival[row, column]
        self._moved.clear()
        return TeamState(
            state.free_s.copy(),
            state.place_enu_m.copy(),
            state.survived.copy(),
            np.ones(problem.n_task, dtype=np.bool_),
            state.active.copy(),
        )
