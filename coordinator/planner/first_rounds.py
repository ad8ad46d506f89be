"""First rounds: what every UAV takes first, as the priority sequences bring it about.

Where all UAVs are free at once, many sequences share a first round. Leaves out: what first rounds
are worth, and when there are too many to try (`coordinator.planner.sequence`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

import numpy as np

from coordinator.planner.sequence_space import Sequence
from swarm.allocation.lower_level import CompiledRule, TeamState, next_decision
from swarm.allocation.problem import Problem
from swarm.kernels import lower_level as kernel

__all__ = ["FirstRound", "FirstRounds"]

FirstRound = tuple[int, ...]
"""Per active UAV in scenario order, the task it takes first, `_NO_TASK` or `_UNDECIDED`."""
TaskSet = int
"""Tasks, a bit for each."""
_NO_TASK = -1
_UNDECIDED = -2


class FirstRounds:
    """The first rounds of some UAVs that priority alone orders.

    Args:
        problem: the mission.
        rule: how UAVs decide.
        state: where the team stands.
        uavs: indices of those that take part, ascending; free all at once.
        twins: each of them with its equals, ascending, of which it is one.
    """

    def __init__(
        self,
        problem: Problem,
        rule: CompiledRule,
        state: TeamState,
        uavs: Sequence,
        twins: Mapping[int, Sequence],
    ) -> None:
        self._problem = problem
        self._rule = rule
        self._state = state
        self._uavs = uavs
        self._twins = twins
        self._rank = np.arange(problem.n_uav)  # the ascending sequence
        self._is_greedy = rule.code == kernel.GREEDY
        self._taken_first: dict[tuple[int, TaskSet], int] = {}
        self._preferred: dict[int, list[int]] = {}
        """By UAV, the tasks it likes best, as far as was asked for; at their end `_NO_TASK`."""

    @property
    def decisions(self) -> int:
        """How many different first decisions have been needed so far."""
        return len(self._taken_first)

    def listed(
        self, most: int, *, most_partial: int, most_decisions: int, should_stop: Callable[[], bool]
    ) -> dict[FirstRound, Sequence] | None:
        """Every distinct one with its lexicographically first sequence; None if too many.

        Grown UAV by UAV. Which order led to a partial round does not matter to the rest of it,
        so only the first order of each is carried on.

        Args:
            most: of them.
            most_partial: of those of only some UAVs, at once.
            most_decisions: that may be needed.
            should_stop: asked after each decision; to stop is to find too many.
        """
        rounds: dict[FirstRound, tuple[Sequence, TaskSet]]
        rounds = {(_UNDECIDED,) * len(self._uavs): ((), 0)}
        for _ in self._uavs:
            longer: dict[FirstRound, tuple[Sequence, TaskSet]] = {}
            for first_round, (sequence, taken) in sorted(rounds.items(), key=lambda item: item[1]):
                for place, uav in enumerate(self._uavs):
                    if first_round[place] == _UNDECIDED and not self._twin_waits(uav, sequence):
                        known = self.decisions
                        task = self._first_task(uav, taken)
                        if self.decisions > known and should_stop():
                            return None
                        extended = (*first_round[:place], task, *first_round[place + 1 :])
                        if extended not in longer:
                            longer[extended] = (*sequence, uav), taken | _only(task)
                too_many = len(longer) > most_partial or self.decisions > most_decisions
                if too_many or should_stop():  # decisions known already take time too
                    return None
            rounds = longer
        if len(rounds) > most:
            return None
        return {first_round: sequence for first_round, (sequence, _) in rounds.items()}

    def sequences_of(self, first_round: FirstRound, begin: Sequence = ()) -> Iterator[Sequence]:
        """All sequences that begin with ``begin`` and lead to ``first_round``, in order."""
        if len(begin) == len(self._uavs):
            yield begin
            return
        decided = (t for u, t in zip(self._uavs, first_round, strict=True) if u in begin)
        taken = sum(map(_only, decided))
        for uav, task in zip(self._uavs, first_round, strict=True):
            if uav in begin or self._twin_waits(uav, begin):
                continue
            if self._first_task(uav, taken) == task:
                yield from self.sequences_of(first_round, (*begin, uav))

    def _twin_waits(self, uav: int, sequence: Sequence) -> bool:
        """Whether ``uav`` would pass an equal UAV of smaller index, which changes only names."""
        equals = self._twins[uav]
        return uav != equals[0] and any(u < uav and u not in sequence for u in equals)

    def _first_task(self, uav: int, taken: TaskSet) -> int:
        """What ``uav`` takes when others have ``taken`` so much; `_NO_TASK` if nothing."""
        task = self._taken_first.get((uav, taken))
        if task is None:
            task = self._favourite(uav, taken) if self._is_greedy else self._decide(uav, taken)
            self._taken_first[uav, taken] = task
        return task

    def _favourite(self, uav: int, taken: TaskSet) -> int:
        """The same by the greedy rule, whose order of preference does not depend on the others."""
        preferred = self._preferred.setdefault(uav, [])
        for task in preferred:
            if not taken & _only(task):
                return task
        while True:
            task = self._decide(uav, sum(map(_only, preferred)))
            preferred.append(task)
            if not taken & _only(task):
                return task

    def _decide(self, uav: int, taken: TaskSet) -> int:
        state = self._state.copy()
        state.open[[task for task in range(self._problem.n_task) if taken & _only(task)]] = False
        decision = next_decision(self._problem, state, self._rank, self._rule, uav)
        return _NO_TASK if decision is None else decision.task


def _only(task: int) -> TaskSet:
    """That task alone; nothing for `_NO_TASK`."""
    return 1 << task if task >= 0 else 0
