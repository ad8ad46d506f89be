"""The space of priority sequences: equal ones, near ones, first rounds, and where to start in it.

Where all UAVs are free at once, many sequences share a first round, in which every UAV takes one
task. The sequence that reproduces the optimal single-stage assignment (Theorem 3, Corollary 4) is
constructed instead of searched: solve the assignment, then peel off a UAV that holds its own best
remaining task, as Lemma 2 promises one, until none is left.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from coordinator.planner.assignment import best_assignment
from swarm.allocation.lower_level import CompiledRule, TeamState, next_decision
from swarm.allocation.problem import FloatArray, Problem
from swarm.kernels import lower_level as kernel

Sequence = tuple[int, ...]
"""UAV indices, first decider first."""


def has_plain_first_round(problem: Problem, state: TeamState, uavs: Sequence) -> bool:
    """Whether priority alone orders the first round: all are free at once, nobody twice."""
    if len({float(state.free_s[uav]) for uav in uavs}) > 1:
        return False
    for uav in uavs:
        tasks = state.open & problem.capable[uav]
        travel_s = problem.travel_s(uav, state.place_enu_m[uav])
        if ((travel_s + problem.service_s)[tasks] <= 0.0).any():
            return False
    return True


def twins(problem: Problem, state: TeamState, uavs: Sequence) -> dict[int, Sequence]:
    """For each UAV all that equal it in every respect, itself included, ascending."""
    classes: dict[bytes, list[int]] = {}
    accelerations_m_s2 = problem.acceleration_m_s2
    for uav in uavs:
        traits = (
            state.free_s[uav],
            state.survived[uav],
            *state.place_enu_m[uav],
            problem.speed_m_s[uav],
            np.inf if accelerations_m_s2 is None else accelerations_m_s2[uav],
            *problem.success[uav],
            *problem.survival[uav],
        )
        classes.setdefault(np.array(traits).tobytes(), []).append(uav)
    return {uav: tuple(twins) for twins in classes.values() for uav in twins}


def neighbours(sequence: Sequence, rng: np.random.Generator) -> Iterator[Sequence]:
    """Every swap of two UAVs and every insertion of one elsewhere, in random order."""
    n = len(sequence)
    for move in rng.permutation(n * n):
        low, high = divmod(int(move), n)
        changed = list(sequence)
        if low < high:
            changed[low], changed[high] = changed[high], changed[low]
        elif low > high:
            changed.insert(high, changed.pop(low))
        else:
            continue
        yield tuple(changed)
    for move in rng.permutation(n * n):
        low, high = divmod(int(move), n)
        if low + 1 < high:  # neighbours in the sequence have been swapped above
            changed = list(sequence)
            changed.insert(high, changed.pop(low))
            yield tuple(changed)


def perturbed(sequence: Sequence, rng: np.random.Generator) -> Sequence:
    """A sequence a few random swaps away."""
    changed = list(sequence)
    for _ in range(max(3, len(changed) // 8)):
        i, j = rng.integers(len(changed), size=2)
        changed[i], changed[j] = changed[j], changed[i]
    return tuple(changed)


FirstRound = tuple[int, ...]
"""Per active UAV in scenario order, the task it takes first, `_NO_TASK` or `_UNDECIDED`."""
TaskSet = int
"""Tasks, a bit for each."""
_NO_TASK = -1
_UNDECIDED = -2


class FirstRounds:
    """The first rounds of some UAVs that priority alone orders.

    Args:
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
        so only the first order of each is carried on. Too many are more than ``most``, more than
        ``most_partial`` of only some UAVs at once, more than ``most_decisions`` needed for them, or
        being told to stop, which is asked after each decision.
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


@dataclass(frozen=True, slots=True)
class SingleStage:
    """One round: who takes what, and the order in which greedy UAVs decide on just that."""

    sequence: tuple[int, ...]
    """UAV indices, first decider first; UAVs without a task come last."""
    tasks: tuple[int | None, ...]
    """Task index of each UAV; None for those without."""
    objective: float
    """Σ of the round's terms of eq. 1 [value·s]."""


def single_stage(problem: Problem, state: TeamState | None = None) -> SingleStage:
    """The optimal first round, and the priority sequence that makes greedy UAVs fly it.

    As many tasks as possible are assigned, and of all such assignments one with the largest
    objective is. UAVs that are not active in ``state`` (the start when None) and tasks that are not
    open take no part.
    """
    state = TeamState.at_start(problem) if state is None else state
    scores = np.array([_scores(problem, state, uav) for uav in range(problem.n_uav)]).reshape(
        problem.n_uav, problem.n_task
    )
    possible = problem.capable & state.open & state.active[:, None]
    # one forbidden pair must cost more than any assignment of possible pairs can earn
    forbidden = -(1.0 + 2.0 * min(scores.shape) * float(np.abs(scores).max(initial=0.0)))
    assigned = best_assignment(np.where(possible, scores, forbidden))
    tasks = {uav: task for uav, task in assigned.items() if possible[uav, task]}
    objective = float(sum(scores[uav, task] for uav, task in tasks.items()))
    sequence = _peel(np.where(possible, scores, -np.inf), tasks)
    held = set(sequence)
    rest = [uav for uav in range(problem.n_uav) if uav not in held]
    rest.sort(key=lambda uav: not state.active[uav])
    return SingleStage(
        tuple(sequence + rest), tuple(tasks.get(uav) for uav in range(problem.n_uav)), objective
    )


def _scores(problem: Problem, state: TeamState, uav: int) -> FloatArray:
    """(n_task,) greedy score of every task, open or not."""
    travel_s = problem.travel_s(uav, state.place_enu_m[uav])
    completion_s = (float(state.free_s[uav]) + travel_s) + problem.service_s
    weight: FloatArray = float(state.survived[uav]) * problem.weight[uav]
    return (problem.horizon_s - completion_s) * weight


def _peel(scores: FloatArray, tasks: dict[int, int]) -> list[int]:
    """Order the UAVs of ``tasks`` so that each holds its best task of those left.

    Equal scores can hide that UAV; then the tasks are passed round among UAVs to whom they are
    worth the same, and ``tasks`` is changed accordingly.
    """
    scores = scores.copy()
    holders = dict(tasks)
    order: list[int] = []
    while holders:
        wishes = {uav: int(scores[uav].argmax()) for uav in holders}
        content = [uav for uav, task in holders.items() if wishes[uav] == task]
        if not content:
            _pass_round(holders, wishes)
            tasks.update(holders)
            continue
        uav = content[0]
        order.append(uav)
        scores[:, holders.pop(uav)] = -np.inf
    return order


def _pass_round(holders: dict[int, int], wishes: dict[int, int]) -> None:
    """Give one UAV, or a ring of UAVs, what they wish; optimal holdings lose nothing by it."""
    holder_of = {task: uav for uav, task in holders.items()}
    uav = next(iter(holders))
    chain: list[int] = []
    while uav not in chain:
        chain.append(uav)
        if wishes[uav] not in holder_of:  # nobody's task: it is worth the same as the held one
            holders[uav] = wishes[uav]
            return
        uav = holder_of[wishes[uav]]
    for member in chain[chain.index(uav) :]:
        holders[member] = wishes[member]
