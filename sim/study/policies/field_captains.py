"""Who decides for a whole team in the field: lists made elsewhere than in the agents' own heads.

The agents are the real ones, with their vehicles, slots, energy and claims; only whose lists they
follow differs. All agents of a flight share one captain, which sees what the UAV that decides sees
and remembers its lists at once, so communication with it is ideal. Lists are orders of tasks: where
batteries are swapped follows from them anew at each decision, as for guided agents.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from agent.core.field_decision import FieldRule
from sim.study.baselines.field_cbba import field_cbba
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FIELD_VALUE_PER_TIME, run_rule
from swarm.kernels.field_search import SearchedLists, optimise_lists

Lists = list[list[int]]


class Captain(ABC):
    """Keeps lists by ids, as tasks come and go."""

    def __init__(self, seed: int) -> None:
        self.moved = 0
        """Tasks that stood on one UAV's list and then on another's."""
        self.epochs = 0
        """Times at which new lists came into force."""
        self._seed = seed
        self._lists: dict[str, list[tuple[str, int]]] = {}
        """By UAV: tasks and directions."""
        self._owner: dict[str, str] = {}
        self._unlisted: frozenset[str] = frozenset()
        self._answer: tuple[tuple[bytes, ...], SearchedLists] | None = None
        """To the last question: who decides at the same instant gets the same lists."""

    def rule(self, name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule:
        """What an agent decides by in an epoch of that rule and those routes."""
        if not self._lists:
            self._lists = {uav: [(task, 0) for task in tasks] for uav, tasks in routes.items()}
            self._owner = {task: uav for uav, tasks in routes.items() for task in tasks}
            self.begin()
        return FieldRule(name, routes, make_lists=self.lists)

    def lists(self, problem: FieldProblem, state: FieldState, mine: int) -> SearchedLists:
        """The lists in force, from ``state`` on."""
        arrays = (state.free_s, state.open, state.active, state.landed_at, state.sortie_end_s)
        question = tuple(array.tobytes() for array in arrays)
        if self._answer is None or self._answer[0] != question:
            self._answer = question, self.answer(problem, state)
        return _with_gap_filled(problem, state, mine, self._answer[1])

    @abstractmethod
    def answer(self, problem: FieldProblem, state: FieldState) -> SearchedLists:
        """The lists in force, from ``state`` on; tasks on nobody's list go by value per time."""

    def begin(self) -> None:  # noqa: B027 - most have nothing to do
        """The routes of the epoch are the lists."""

    # -- for those that follow -----------------------------------------------------------

    def kept(self, problem: FieldProblem) -> Lists:
        """The lists as items of that problem."""
        columns = {str(task): column for column, task in enumerate(problem.task_ids)}
        return [
            [2 * columns[task] + way for task, way in self._lists.get(uav, ()) if task in columns]
            for uav in problem.uav_ids
        ]

    def keep(self, problem: FieldProblem, lists: Sequence[Sequence[int]]) -> None:
        """These come into force."""
        self._lists = {
            uav: [(str(problem.task_ids[item >> 1]), item & 1) for item in items if item >= 0]
            for uav, items in zip(problem.uav_ids, lists, strict=True)
        }
        owner = {task: uav for uav, tasks in self._lists.items() for task, _ in tasks}
        self.moved += sum(self._owner.get(task, uav) != uav for task, uav in owner.items())
        self._owner.update(owner)
        self.epochs += 1

    def has_news(self, problem: FieldProblem, state: FieldState) -> bool:
        """Whether other tasks are on no living UAV's list than when this was last asked."""
        listed = {
            task
            for row, uav in enumerate(problem.uav_ids)
            if state.active[row]
            for task, _ in self._lists.get(uav, ())
        }
        tasks = (str(problem.task_ids[column]) for column in np.flatnonzero(state.open))
        unlisted = frozenset(task for task in tasks if task not in listed)
        news, self._unlisted = bool(unlisted - self._unlisted), unlisted
        return news


class FrozenCaptain(Captain):
    """The offline plan, never changed."""

    def begin(self) -> None:
        """One plan."""
        self.epochs = 1

    def answer(self, problem: FieldProblem, state: FieldState) -> SearchedLists:
        """The plan's lists."""
        return _followed(problem, state, self.kept(problem))


class AuctionCaptain(Captain):
    """CBBA, held anew whenever tasks open that are on no living UAV's list."""

    def rule(self, name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule:
        """It has no plan to begin with."""
        return super().rule(name, dict.fromkeys(routes, ()))

    def answer(self, problem: FieldProblem, state: FieldState) -> SearchedLists:
        """What was won, of it what can still be done."""
        if self.has_news(problem, state):
            routes = field_cbba(problem, state).routes
            self.keep(problem, [[2 * task for task in route] for route in routes])
        return _followed(problem, state, self.kept(problem))


_ITERATIONS_PER_TASK = 200
_ITERATIONS_WITHOUT_NEWS = 50
"""The same when nothing has opened: the lists in force answer to that already."""


class CentralCaptain(Captain):
    """Re-optimises the lists of the whole team whenever anybody is to decide."""

    def answer(self, problem: FieldProblem, state: FieldState) -> SearchedLists:
        """The best lists found from those in force on."""
        n_open = int(np.count_nonzero(state.open))
        news = self.has_news(problem, state)
        per_task = _ITERATIONS_PER_TASK if news else _ITERATIONS_WITHOUT_NEWS
        found = optimise_lists(
            problem.kernel,
            state,
            seed=self._seed + self.epochs,
            iterations=per_task * n_open,
            lists=self.kept(problem),
            threads=1,
        )
        self.keep(problem, found.lists)
        return found


def _followed(problem: FieldProblem, state: FieldState, lists: Lists) -> SearchedLists:
    """Lists as far as they can be done, with swaps where they are needed."""
    return optimise_lists(problem.kernel, state, iterations=0, lists=lists, threads=1)


def _with_gap_filled(
    problem: FieldProblem, state: FieldState, mine: int, found: SearchedLists
) -> SearchedLists:
    """Who has nothing on its list takes what is on nobody's by value per time."""
    if found.lists[mine]:
        return found
    free = state.open.copy()
    free[[item >> 1 for items in found.lists for item in items if item >= 0]] = False
    if not free.any():
        return found
    rest = replace(state, open=free)
    runs = run_rule(problem.kernel, rest, FIELD_VALUE_PER_TIME, first=mine)
    own = runs.items[runs.uavs == mine][:1].tolist()
    # As any rule, this one knows of the others who stands at bases now, and no more.
    lists = tuple(tuple(own) if row == mine else () for row in range(problem.n_uav))
    return replace(found, lists=lists)
