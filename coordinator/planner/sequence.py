"""The upper level: search the priority sequences for the best J of the lower level.

Sequences that lead to the same first round lead to the same lists, unless UAVs become free
at the very same time later; each distinct first round is therefore evaluated once, by its
lexicographically first sequence, and again only after such a tie. All of them are tried
where that is cheap, else a seeded local search runs until it is stopped. Equal UAVs keep their
order, since exchanging them changes only names. Leaves out: limits
(`coordinator.planner.stop`) and lists that no sequence gives.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from coordinator.planner.assignment import single_stage
from coordinator.planner.stop import ShouldStop, never
from swarm.allocation.lower_level import Rule, TeamState, decisions, next_decision, rank_of
from swarm.allocation.problem import Problem

__all__ = ["EXHAUSTIVE_UAVS", "SearchLimits", "SequenceSearch", "best_sequence"]

EXHAUSTIVE_UAVS = 8
"""Up to this many active UAVs every distinct first round is tried."""

Sequence = tuple[int, ...]
FirstRound = tuple[int, ...]
"""Per active UAV in scenario order, the task it takes first, `_NO_TASK` or `_UNDECIDED`."""
_NO_TASK = -1
_UNDECIDED = -2
_CLIMBS_IN_VAIN = 20
_MANY = 200


@dataclass(frozen=True, slots=True)
class SearchLimits:
    """How much listing of first rounds is cheap."""

    first_rounds: int = 50_000
    """More of them are not tried one by one."""
    first_rounds_large_fleet: int = 2_000
    """The same for more than `EXHAUSTIVE_UAVS` active UAVs."""
    partial_rounds: int = 20_000
    """First rounds of only some UAVs that may be held at once in listing them."""
    decisions: int = 200_000
    """First decisions that may be computed in listing them."""
    local_evaluations: int | None = None
    """Evaluations of the local search, where trying all is not cheap; None leaves it to the
    caller's ``should_stop``."""


@dataclass(frozen=True, slots=True)
class SequenceSearch:
    """The best sequence found."""

    sequence: Sequence
    """UAV indices, first decider first; inactive UAVs come last."""
    objective: float
    """Σ of eq. 1 over the decisions taken from the state on [value·s]."""
    evaluations: int
    """Lower-level runs spent."""
    exhaustive: bool
    """No sequence gives a better objective."""


def best_sequence(
    problem: Problem,
    rule: Rule,
    rng: np.random.Generator,
    should_stop: ShouldStop = never,
    state: TeamState | None = None,
    limits: SearchLimits | None = None,
) -> SequenceSearch:
    """Search until all first rounds are tried, or until stopped.

    Equal objectives: the sequence first in lexicographic order of UAV indices among those tried.
    At least one sequence is always evaluated. With a large fleet the search ends by itself only
    where it meets no new first round any more.

    Args:
        problem: the mission.
        rule: how UAVs decide; a rule that looks at the ranks is none of those this can search.
        rng: moves of the climbs; fleets with few first rounds draw nothing from it.
        should_stop: asked before every evaluation after the first.
        state: where the team stands; at its start when None.
        limits: when to prefer the local search.
    """
    state = TeamState.at_start(problem) if state is None else state
    search = _Search(problem, rule, state, should_stop)
    limits = SearchLimits() if limits is None else limits
    small = len(search.uavs) <= EXHAUSTIVE_UAVS
    if search.plain:
        most = limits.first_rounds if small else limits.first_rounds_large_fleet
        first_rounds = search.list_first_rounds(most, limits)
        if first_rounds is not None:
            return search.result(exhaustive=search.try_first_rounds(first_rounds, rng))
    elif small:
        return search.result(exhaustive=search.try_each(permutations(search.uavs)))
    search.local_search(rng, limits.local_evaluations)
    return search.result(exhaustive=False)


class _Search:
    """The state of one search: what has been decided, evaluated and found best."""

    def __init__(
        self, problem: Problem, rule: Rule, state: TeamState, should_stop: ShouldStop
    ) -> None:
        self.uavs: Sequence = tuple(int(u) for u in np.flatnonzero(state.active))
        self._problem = problem
        self._rule = rule
        self._state = state
        self._should_stop = should_stop
        self._inactive: Sequence = tuple(int(u) for u in np.flatnonzero(~state.active))
        self._most_evaluations = np.inf
        self._evaluations = 0
        self._first_decisions: dict[tuple[int, int], int] = {}
        self._twins = _twins(problem, state, self.uavs)
        self._place = {uav: place for place, uav in enumerate(self.uavs)}
        self._rank = rank_of(self.uavs + self._inactive)
        self.plain = self._has_plain_first_round()
        """Priority alone orders the first round: all are free at once, and nobody twice."""
        self._valued: dict[Sequence, tuple[float, bool]] = {}
        self._representatives: dict[FirstRound, Sequence] = {}
        self._best: tuple[float, Sequence] = (-np.inf, self.uavs)

    def result(self, *, exhaustive: bool) -> SequenceSearch:
        objective, sequence = self._best
        return SequenceSearch(sequence + self._inactive, objective, self._evaluations, exhaustive)

    def try_each(self, sequences: Iterable[Sequence]) -> bool:
        """Evaluate all; whether it came to the end."""
        for sequence in sequences:
            if self._stopped():
                return False
            if sequence == self._in_twin_order(sequence):
                self._evaluate(sequence)
        return True

    def list_first_rounds(
        self, most: int, limits: SearchLimits
    ) -> dict[FirstRound, Sequence] | None:
        """Every distinct first round with its lexicographically first sequence; None if too many.

        Grown UAV by UAV. Which order led to a partial round does not matter to the rest of it,
        so only the first order of each is carried on.
        """
        rounds: dict[FirstRound, Sequence] = {(_UNDECIDED,) * len(self.uavs): ()}
        for _ in self.uavs:
            longer: dict[FirstRound, Sequence] = {}
            for first_round, sequence in sorted(rounds.items(), key=lambda item: item[1]):
                for place, uav in enumerate(self.uavs):
                    if first_round[place] == _UNDECIDED and not self._twin_waits(uav, sequence):
                        task = self._first_task(uav, first_round)
                        extended = (*first_round[:place], task, *first_round[place + 1 :])
                        longer.setdefault(extended, (*sequence, uav))
                too_many = len(longer) > limits.partial_rounds
                too_many |= len(self._first_decisions) > limits.decisions
                if too_many or self._should_stop(self._work()):
                    return None
            rounds = longer
        return rounds if len(rounds) <= most else None

    def try_first_rounds(
        self, rounds: dict[FirstRound, Sequence], rng: np.random.Generator
    ) -> bool:
        """Evaluate each, and all its sequences where a later tie lets them differ.

        Of many, those on one climb come first, so that being stopped early does less harm.
        """
        self._representatives = rounds
        if len(rounds) > _MANY:
            self._climb(self._constructed(), rng)
        tied: list[FirstRound] = []
        for first_round, sequence in sorted(rounds.items(), key=lambda item: item[1]):
            if self._stopped():
                return False
            if self._value(first_round, sequence)[1]:
                tied.append(first_round)
        for first_round in tied:
            others = (s for s in self._sequences_of(first_round, ()) if s != rounds[first_round])
            if not self.try_each(others):
                return False
        return True

    def local_search(self, rng: np.random.Generator, most_evaluations: int | None) -> None:
        """Climb by swaps and insertions, from constructed and then from disturbed sequences."""
        self._most_evaluations = np.inf if most_evaluations is None else most_evaluations
        starts = [self._constructed(), self.uavs]
        climbs_in_vain = 0
        while climbs_in_vain < _CLIMBS_IN_VAIN and not self._stopped():
            before = self._evaluations
            start = starts.pop(0) if starts else _disturbed(self._best[1], rng)
            self._climb(start, rng)
            climbs_in_vain = 0 if self._evaluations > before else climbs_in_vain + 1

    def _constructed(self) -> Sequence:
        sequence = single_stage(self._problem, self._state).sequence
        return sequence[: len(self.uavs)]  # inactive UAVs come last

    def _climb(self, sequence: Sequence, rng: np.random.Generator) -> None:
        value = self._value_of(sequence)
        improved = True
        while improved:
            improved = False
            for neighbour in _neighbours(sequence, rng):
                if self._stopped():
                    return
                neighbour_value = self._value_of(neighbour)
                if neighbour_value > value:
                    sequence, value, improved = neighbour, neighbour_value, True
                    break

    def _value_of(self, sequence: Sequence) -> float:
        """J, evaluated once per first round; that later ties may tell sequences apart is left."""
        sequence = self._in_twin_order(sequence)
        if not self.plain:
            return self._value(sequence, sequence)[0]
        first_round = self._first_round(sequence)
        sequence = self._representatives.get(first_round, sequence)
        return self._value(first_round, sequence)[0]

    def _value(self, key: Sequence, sequence: Sequence) -> tuple[float, bool]:
        if key not in self._valued:
            self._valued[key] = self._evaluate(sequence)
        return self._valued[key]

    def _evaluate(self, sequence: Sequence) -> tuple[float, bool]:
        """J of one lower-level run, and whether priority mattered again after the first round."""
        problem = self._problem
        free_s, survived = self._state.free_s.tolist(), self._state.survived.tolist()
        decided = [False] * problem.n_uav
        tie = False
        value = 0.0
        rank = rank_of(sequence + self._inactive)
        for decision in decisions(problem, self._state, rank, self._rule):
            uav, task = decision.uav, decision.task
            tie = tie or (decided[uav] and free_s.count(decision.decided_s) > 1)
            decided[uav] = True
            free_s[uav] = decision.completion_s
            left_s = problem.horizon_s - decision.completion_s
            value += survived[uav] * float(problem.weight[uav, task]) * left_s
            survived[uav] *= float(problem.survival[uav, task])
        self._evaluations += 1
        best_value, best_sequence_ = self._best
        if value > best_value or (value == best_value and sequence < best_sequence_):
            self._best = (value, sequence)
        return value, tie

    def _has_plain_first_round(self) -> bool:
        if len({float(self._state.free_s[uav]) for uav in self.uavs}) > 1:
            return False
        for uav in self.uavs:
            tasks = self._state.open & self._problem.capable[uav]
            travel_s = self._problem.travel_s(uav, self._state.place_enu_m[uav])
            if ((travel_s + self._problem.service_s)[tasks] <= 0.0).any():
                return False
        return True

    def _twin_waits(self, uav: int, sequence: Sequence) -> bool:
        """Whether ``uav`` would pass an equal UAV of smaller index, which changes only names."""
        return any(twin < uav and twin not in sequence for twin in self._twins[uav])

    def _in_twin_order(self, sequence: Sequence) -> Sequence:
        """The same sequence with equal UAVs in ascending order on their places."""
        waiting = {twins: iter(twins) for twins in self._twins.values()}
        return tuple(next(waiting[self._twins[uav]]) for uav in sequence)

    def _stopped(self) -> bool:
        work = self._work()
        return self._evaluations > 0 and (work >= self._most_evaluations or self._should_stop(work))

    def _work(self) -> float:
        """Evaluations spent, each first decision counting as its part of one."""
        return self._evaluations + len(self._first_decisions) / max(1, self._problem.n_task)

    def _first_round(self, sequence: Sequence) -> FirstRound:
        first_round: FirstRound = (_UNDECIDED,) * len(self.uavs)
        for uav in sequence:
            place = self._place[uav]
            task = self._first_task(uav, first_round)
            first_round = (*first_round[:place], task, *first_round[place + 1 :])
        return first_round

    def _first_task(self, uav: int, first_round: FirstRound) -> int:
        """What ``uav`` takes after the UAVs decided in ``first_round``; `_NO_TASK` if nothing."""
        taken = [task for task in first_round if task >= 0]
        key = (uav, sum(1 << task for task in taken))
        if key not in self._first_decisions:
            state = self._state.copy()
            state.open[taken] = False
            decision = next_decision(self._problem, state, self._rank, self._rule, uav)
            self._first_decisions[key] = _NO_TASK if decision is None else decision.task
        return self._first_decisions[key]

    def _sequences_of(self, first_round: FirstRound, sequence: Sequence) -> Iterator[Sequence]:
        """All sequences that begin with ``sequence`` and lead to ``first_round``, in order."""
        if len(sequence) == len(self.uavs):
            yield sequence
            return
        partial = tuple(
            task if uav in sequence else _UNDECIDED
            for uav, task in zip(self.uavs, first_round, strict=True)
        )
        for uav, task in zip(self.uavs, first_round, strict=True):
            if uav in sequence or self._twin_waits(uav, sequence):
                continue
            if self._first_task(uav, partial) == task:
                yield from self._sequences_of(first_round, (*sequence, uav))


def _twins(problem: Problem, state: TeamState, uavs: Sequence) -> dict[int, Sequence]:
    """For each UAV all that equal it in every respect, itself included, ascending."""
    classes: dict[bytes, list[int]] = {}
    for uav in uavs:
        traits = (
            state.free_s[uav],
            state.survived[uav],
            *state.place_enu_m[uav],
            problem.speed_m_s[uav],
            *problem.success[uav],
            *problem.survival[uav],
        )
        classes.setdefault(np.array(traits).tobytes(), []).append(uav)
    return {uav: tuple(twins) for twins in classes.values() for uav in twins}


def _neighbours(sequence: Sequence, rng: np.random.Generator) -> Iterator[Sequence]:
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


def _disturbed(sequence: Sequence, rng: np.random.Generator) -> Sequence:
    """A sequence a few random swaps away."""
    changed = list(sequence)
    for _ in range(max(3, len(changed) // 8)):
        i, j = rng.integers(len(changed), size=2)
        changed[i], changed[j] = changed[j], changed[i]
    return tuple(changed)
