"""The upper level: search the priority sequences for the best J of the lower level.

Sequences that lead to the same first round lead to the same lists, unless UAVs become free at the
very same time later; each distinct first round is therefore evaluated once, by its
lexicographically first sequence, and again only after such a tie. All of them are tried where that
is cheap, else a seeded local search runs until it is stopped. Equal UAVs keep their order, since
exchanging them changes only names. Evaluations go to a kernel many at a time, on every processor;
results do not depend on how many there are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice, permutations
from math import factorial

import numpy as np

from coordinator.planner.options import ShouldStop, never
from coordinator.planner.sequence_space import (
    FirstRound,
    FirstRounds,
    Sequence,
    has_plain_first_round,
    neighbours,
    perturbed,
    single_stage,
    twins,
)
from swarm.allocation import Rule, evaluate, rank_of, run
from swarm.allocation.lower_level import CompiledRule, TeamState
from swarm.allocation.problem import IntArray, Problem
from swarm.kernels import lower_level as kernel
from swarm.kernels.lower_level import EXACT_TASKS

EXHAUSTIVE_UAVS = 8
"""Up to this many active UAVs every distinct first round is tried."""
Progress = Callable[[int, float], None]
"""Told the evaluations or iterations spent so far and the best J found by them [value·s]."""
_CLIMBS_IN_VAIN = 20
_RANDOM_STARTS = 12
_NEIGHBOURS = 32
"""Neighbours looked at together; the best of them is moved to if it is better."""
_CHUNK_LOOKS = 10_000_000
"""Tasks looked at between two questions whether to stop: some 50 ms."""
_THREAD_LOOKS = 100_000
"""Tasks looked at in about the time that starting threads takes."""
_LOOKAHEAD_LOOKS = 1_000_000
"""A decision by lookahead over more tasks than it can solve exactly, in the same currency."""
_MOST_ORDERS = 120
"""All orders of five UAVs; of more UAVs so many are drawn for a rule that is not compiled, as each
is flown decision by decision."""


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
    routes: tuple[tuple[int, ...], ...]
    """Task indices per UAV in order of execution: what the sequence leads to."""
    objective: float
    """Σ of eq. 1 over the decisions taken from the state on [value·s]."""
    evaluations: int
    """Lower-level runs spent; 0 if the first was stopped, whose last decisions then are greedy."""
    exhaustive: bool
    """No sequence gives a better objective."""


def search_sequence(
    problem: Problem,
    rule: Rule,
    rng: np.random.Generator,
    should_stop: ShouldStop = never,
    state: TeamState | None = None,
    limits: SearchLimits | None = None,
    *,
    progress: Progress | None = None,
    threads: int | None = None,
) -> SequenceSearch:
    """The best sequence found for UAVs that decide by ``rule``; see `best_sequence`.

    For a rule that is not compiled the orders tried are all of up to five active UAVs, and else the
    problem's own and some drawn ones; the first is flown to its end, whatever ``should_stop`` says.
    """
    if isinstance(rule, CompiledRule):
        return best_sequence(
            problem, rule, rng, should_stop, state, limits, progress=progress, threads=threads
        )
    state = TeamState.at_start(problem) if state is None else state
    active = tuple(int(uav) for uav in np.flatnonzero(state.active))
    out = tuple(int(uav) for uav in np.flatnonzero(~state.active))
    flown: list[tuple[float, tuple[int, ...], list[list[int]]]] = []
    for order in _orders(active, rng):
        if flown and should_stop(float(len(flown) + 1)):
            break
        routes, _ = run(problem, state, rank_of(order + out), rule)
        flown.append((evaluate(problem, routes, state)[0], order + out, routes))
        if progress is not None:
            progress(len(flown), max(objective for objective, _, _ in flown))
    objective, sequence, routes = max(flown, key=lambda each: each[0])
    return SequenceSearch(
        sequence=sequence,
        routes=tuple(tuple(route) for route in routes),
        objective=objective,
        evaluations=len(flown),
        exhaustive=factorial(len(active)) <= len(flown),
    )


def _orders(uavs: tuple[int, ...], rng: np.random.Generator) -> Iterator[tuple[int, ...]]:
    if factorial(len(uavs)) <= _MOST_ORDERS:
        yield from permutations(uavs)
        return
    yield uavs
    for _ in range(_MOST_ORDERS - 1):
        yield tuple(int(uav) for uav in rng.permutation(uavs))


def best_sequence(
    problem: Problem,
    rule: CompiledRule,
    rng: np.random.Generator,
    should_stop: ShouldStop = never,
    state: TeamState | None = None,
    limits: SearchLimits | None = None,
    *,
    progress: Progress | None = None,
    threads: int | None = None,
) -> SequenceSearch:
    """Search until all first rounds are tried, or until stopped, by Ctrl-C too.

    Equal objectives: the sequence first in lexicographic order of UAV indices among those tried.
    At least one sequence is always evaluated; if ``should_stop`` ends that evaluation, the
    decisions left in it are greedy. With a large fleet the search ends by itself only where it
    meets no new first round any more.

    Args:
        problem: the mission.
        rule: how UAVs decide.
        rng: moves of the local search; small fleets draw nothing from it.
        should_stop: asked again and again, also whether to stop after evaluations that are not
            spent yet, so as to spend no more than it allows; about 0 every few milliseconds.
        state: where the team stands; at its start when None.
        limits: when to prefer the local search.
        progress: told after every batch of evaluations.
        threads: how many evaluate; as many as there are processors when None. Changes nothing
            but speed.
    """
    state = TeamState.at_start(problem) if state is None else state
    search = _Search(problem, rule, state, should_stop, progress, threads)
    try:
        exhaustive = _searched_all(search, rng, SearchLimits() if limits is None else limits)
    except KeyboardInterrupt:
        if not search.evaluations:
            raise
        return search.result(exhaustive=False)
    return search.result(exhaustive=exhaustive)


def _searched_all(search: _Search, rng: np.random.Generator, limits: SearchLimits) -> bool:
    small = len(search.uavs) <= EXHAUSTIVE_UAVS
    if search.plain:
        most = limits.first_rounds if small else limits.first_rounds_large_fleet
        first_rounds = search.list_first_rounds(most, limits)
        if first_rounds is not None:
            return search.try_first_rounds(first_rounds)
    elif small:
        return search.try_each(permutations(search.uavs))
    search.local_search(rng, limits.local_evaluations)
    return False


class _Search:
    """The state of one search: what has been decided, evaluated and found best."""

    def __init__(
        self,
        problem: Problem,
        rule: CompiledRule,
        state: TeamState,
        should_stop: ShouldStop,
        progress: Progress | None,
        threads: int | None,
    ) -> None:
        self.uavs: Sequence = tuple(int(u) for u in np.flatnonzero(state.active))
        self.evaluations = 0
        self.plain = has_plain_first_round(problem, state, self.uavs)
        self._problem = problem
        self._rule = rule
        self._state = state
        self._n_open = int(np.count_nonzero(state.open))
        self._takes_long = rule.code == kernel.LOOKAHEAD and self._n_open > EXACT_TASKS
        """Whether a single decision takes some milliseconds."""
        self._should_stop = should_stop
        self._progress = progress
        self._threads = kernel.default_threads() if threads is None else threads
        self._inactive: Sequence = tuple(int(u) for u in np.flatnonzero(~state.active))
        self._most_evaluations = np.inf
        self._looked_up = 0
        self._twins = twins(problem, state, self.uavs)
        self._any_twins = any(len(equals) > 1 for equals in self._twins.values())
        self._first_rounds = FirstRounds(problem, rule, state, self.uavs, self._twins)
        self._values: dict[bytes, float] = {}
        self._best: tuple[float, Sequence] = (-np.inf, self.uavs)
        self._lists: list[list[int]] = [[] for _ in range(problem.n_uav)]
        self._cut = False
        """An evaluation was stopped under way."""

    def result(self, *, exhaustive: bool) -> SequenceSearch:
        objective, sequence = self._best
        return SequenceSearch(
            sequence + self._inactive,
            tuple(map(tuple, self._lists)),
            objective,
            self.evaluations,
            exhaustive,
        )

    def try_each(self, sequences: Iterable[Sequence]) -> bool:
        """Evaluate all; whether it came to the end."""
        ordered = (s for s in sequences if s == self._in_twin_order(s))
        while batch := list(islice(ordered, self._chunk())):
            if len(self._evaluate(batch)) < len(batch):
                return False
        return True

    def list_first_rounds(
        self, most: int, limits: SearchLimits
    ) -> dict[FirstRound, Sequence] | None:
        """Every distinct first round with its first sequence; None if too many."""
        return self._first_rounds.listed(
            most,
            most_partial=limits.partial_rounds,
            most_decisions=limits.decisions,
            should_stop=lambda: self._should_stop(self._work()),
        )

    def try_first_rounds(self, rounds: dict[FirstRound, Sequence]) -> bool:
        """Evaluate each, and all its sequences where a later tie lets them differ."""
        ordered = sorted(rounds.items(), key=lambda item: item[1])
        found = self._evaluate([sequence for _, sequence in ordered])
        if len(found) < len(ordered):
            return False
        tied = [first for (first, _), (_, tie) in zip(ordered, found, strict=True) if tie]
        for first_round in tied:
            sequences = self._first_rounds.sequences_of(first_round)
            others = (s for s in sequences if s != rounds[first_round])
            if not self.try_each(others):
                return False
        return True

    def local_search(self, rng: np.random.Generator, most_evaluations: int | None) -> None:
        """Climb by swaps and insertions, from constructed and then from disturbed sequences."""
        self._most_evaluations = np.inf if most_evaluations is None else most_evaluations
        starts = self._starts(rng)
        # Where even first rounds take long, what is certain is one whole run.
        first = self._evaluate(starts[:1]) if self._takes_long else []
        values = self._values_of(starts, [value for value, _ in first])
        if values is None:
            return
        best_first = sorted(range(len(starts)), key=lambda i: -values[i])
        waiting = [starts[i] for i in best_first[:2]]
        climbs_in_vain = 0
        while climbs_in_vain < _CLIMBS_IN_VAIN and not self._stopped():
            before = self.evaluations
            self._climb(waiting.pop(0) if waiting else perturbed(self._best[1], rng), rng)
            climbs_in_vain = 0 if self.evaluations > before else climbs_in_vain + 1

    def _starts(self, rng: np.random.Generator) -> list[Sequence]:
        """Sequences to begin with: constructed ones, greedy orders, and a few by chance."""
        inside = set(self.uavs)
        # with large teams constructing takes a while, and so does loading what it takes
        over = self._is_over()
        constructed = self.uavs if over else single_stage(self._problem, self._state).sequence
        speed_m_s = self._problem.speed_m_s
        ability = self._problem.weight @ self._state.open
        return [
            tuple(uav for uav in constructed if uav in inside),
            self.uavs,
            tuple(sorted(self.uavs, key=lambda uav: (-speed_m_s[uav], uav))),
            tuple(sorted(self.uavs, key=lambda uav: (speed_m_s[uav], uav))),
            tuple(sorted(self.uavs, key=lambda uav: (-ability[uav], uav))),
            *(tuple(int(uav) for uav in rng.permutation(self.uavs)) for _ in range(_RANDOM_STARTS)),
        ]

    def _climb(self, sequence: Sequence, rng: np.random.Generator) -> None:
        values = self._values_of([sequence])
        if values is None:
            return
        value = values[0]
        improved = True
        while improved:
            improved = False
            around = neighbours(sequence, rng)
            while not improved and (near := list(islice(around, _NEIGHBOURS))):
                values = self._values_of(near)
                if values is None:
                    return
                best = max(range(len(near)), key=values.__getitem__)
                if values[best] > value:
                    sequence, value, improved = near[best], values[best], True

    def _values_of(
        self, sequences: list[Sequence], known: list[float] | None = None
    ) -> list[float] | None:
        """J of each, of which the first ones may be ``known``; None if stopped before the end.

        Evaluated once per first round; that later ties may tell sequences apart is left.
        """
        if self._stopped():
            return None
        sequences = [self._in_twin_order(sequence) for sequence in sequences]
        keys = self._first_round_keys(sequences)
        if keys is None:
            if not self.evaluations:
                self._evaluate(sequences[:1])
            return None
        self._values.update(zip(keys, known or (), strict=False))
        unknown = {
            key: sequence
            for key, sequence in zip(reversed(keys), reversed(sequences), strict=True)
            if key not in self._values
        }
        fresh = list(reversed(unknown.items()))
        found = self._evaluate([sequence for _, sequence in fresh])
        self._values.update(
            (key, value) for (key, _), (value, _) in zip(fresh, found, strict=False)
        )
        return [self._values[key] for key in keys] if len(found) == len(fresh) else None

    def _first_round_keys(self, sequences: list[Sequence]) -> list[bytes] | None:
        """What tells apart sequences that may lead to different lists; None if stopped."""
        ranks = self._ranks(sequences)
        if not self.plain:
            return [row.tobytes() for row in ranks]
        self._looked_up += len(sequences) * min(len(self.uavs), self._problem.n_task)
        each = _LOOKAHEAD_LOOKS if self._takes_long else self._n_open
        looks = len(ranks) * len(self.uavs) * each
        threads = self._threads if looks > _THREAD_LOOKS else 1
        tasks = kernel.first_rounds(
            self._problem.kernel, self._state, ranks, self._rule.code, threads, self._is_over
        )
        if (tasks == kernel.UNDONE).any():
            return None
        return [row.tobytes() for row in tasks]

    def _ranks(self, sequences: list[Sequence]) -> IntArray:
        """(k, n_uav) place of every UAV in each of the sequences."""
        order = np.array([sequence + self._inactive for sequence in sequences], dtype=np.int64)
        order = order.reshape(len(sequences), self._problem.n_uav)
        ranks = np.empty_like(order)
        np.put_along_axis(ranks, order, np.arange(self._problem.n_uav)[None, :], axis=1)
        return ranks

    def _evaluate(self, sequences: list[Sequence]) -> list[tuple[float, bool]]:
        """J of each and whether priority mattered again after the first round.

        Shorter than ``sequences`` if stopped before their end.
        """
        results: list[tuple[float, bool]] = []
        while len(results) < len(sequences):
            begin = len(results)
            count = self._allowed(min(self._chunk(), len(sequences) - begin))
            if not count:
                break
            batch = sequences[begin : begin + count]
            runs = kernel.run_sequences(
                self._problem.kernel,
                self._state,
                self._ranks(batch),
                self._rule.code,
                self._threads,
                self._is_over,
            )
            self._cut = not runs.by_rule.all()
            whole = int(runs.by_rule.argmin()) if self._cut else count
            self.evaluations += whole
            values = runs.objective.tolist()
            # of those that were stopped only the very first one, for want of any other
            candidates = range(whole if self.evaluations else 1)
            best = None
            for number in candidates:
                best_value, best_sequence_ = self._best
                value, sequence = values[number], batch[number]
                if value > best_value or (value == best_value and sequence < best_sequence_):
                    self._best, best = (value, sequence), number
            if best is not None:
                self._lists = runs.lists(best, self._problem.n_uav)
            results += zip(values[:whole], runs.tied[:whole].tolist(), strict=True)
            if self._cut:
                break
            if self._progress is not None:
                self._progress(self.evaluations, self._best[0])
        return results

    def _chunk(self) -> int:
        """Evaluations to do between two questions whether to stop."""
        looks = self._n_open * (self._n_open / 2 + 100.0) + 1.0
        if self._takes_long:
            looks += self._n_open * _LOOKAHEAD_LOOKS
        return int(min(max(_CHUNK_LOOKS / looks, 1.0), 512.0)) * self._threads

    def _allowed(self, count: int) -> int:
        """How many of the next ``count`` evaluations may be spent; the first one always."""
        least = 0 if self.evaluations or self._cut else 1
        while count > least and self._stops_at(self._work() + count - 1):
            count //= 2
        return max(count, least)

    def _stops_at(self, work: float) -> bool:
        return work >= self._most_evaluations or self._should_stop(work)

    def _stopped(self) -> bool:
        return self._cut or (self.evaluations > 0 and self._stops_at(self._work()))

    def _is_over(self) -> bool:
        """Whether to leave what is under way."""
        return self._should_stop(0.0)

    def _work(self) -> float:
        """Evaluations spent, each first decision counting as its part of one."""
        looked_up = self._looked_up + self._first_rounds.decisions
        return self.evaluations + looked_up / max(1, self._problem.n_task)

    def _in_twin_order(self, sequence: Sequence) -> Sequence:
        """The same sequence with equal UAVs in ascending order on their places."""
        if not self._any_twins:
            return sequence
        waiting = {equals: iter(equals) for equals in self._twins.values()}
        return tuple(next(waiting[self._twins[uav]]) for uav in sequence)
