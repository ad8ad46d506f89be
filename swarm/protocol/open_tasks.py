"""Which open tasks pay best for the time of one UAV, told in a fraction of a millisecond.

Whoever hears that a task has opened asks whether it is among the best within reach. At 5000 tasks
the arrays of a whole problem take a hundred times as long, so places and values are kept here, in
the order in which tasks were told of, and brought up to date by what has changed since.
"""

from __future__ import annotations

from itertools import islice

import numpy as np

from swarm.allocation.problem import straight_m
from swarm.protocol.board import TaskBoard, TaskState
from swarm.protocol.fields import Point

_LEAST_ROWS = 64


class OpenTasks:
    """The open tasks of one board."""

    def __init__(self, board: TaskBoard) -> None:
        self._board = board
        self._generation = -1
        self._rows: dict[str, int] = {}
        self._n_outcomes = 0
        """Taken into account."""
        self._place_m = np.empty((3, _LEAST_ROWS))
        self._value = np.empty(_LEAST_ROWS)
        self._service_s = np.empty(_LEAST_ROWS)
        self._open = np.empty(_LEAST_ROWS, dtype=np.bool_)

    def n_better(self, task: str, from_m: Point, speed_m_s: float) -> int:
        """How many others pay better: by value / (travel + service), as the crow flies.

        Args:
            task: on the board.
            from_m: where the UAV is [m; mission origin].
            speed_m_s: its cruise speed [m/s].
        """
        self._catch_up()
        n_task, row = len(self._rows), self._rows[task]
        offset_m = self._place_m[:, :n_task] - np.array(from_m)[:, None]
        taken_s = straight_m(offset_m, spoilt=offset_m) / speed_m_s + self._service_s[:n_task]
        with np.errstate(divide="ignore", invalid="ignore"):
            per_s = self._value[:n_task] / taken_s
        return int(np.count_nonzero((per_s > per_s[row]) & self._open[:n_task]))

    def _catch_up(self) -> None:
        board = self._board
        states, outcomes = board.states, board.replica.outcomes
        if self._generation != board.generation:
            self._generation, self._n_outcomes = board.generation, 0
            self._rows.clear()
        for task in reversed(list(islice(reversed(states), len(states) - len(self._rows)))):
            self._add(task)
        further = len(outcomes) - self._n_outcomes
        for _, task in islice(reversed(outcomes), further):
            if task in states:
                self._open[self._rows[task]] = states[task] is TaskState.OPEN
        self._n_outcomes = len(outcomes)

    def _add(self, task: str) -> None:
        row = self._rows[task] = len(self._rows)
        if row == len(self._value):
            self._place_m = np.concatenate([self._place_m, np.empty_like(self._place_m)], axis=1)
            self._value, self._service_s, self._open = (
                np.concatenate([array, np.empty_like(array)])
                for array in (self._value, self._service_s, self._open)
            )
        entry = self._board.replica.board[task]
        self._place_m[:, row] = entry.position_enu_m
        self._value[row], self._service_s[row] = entry.value, entry.service_s
        self._open[row] = self._board.states[task] is TaskState.OPEN
