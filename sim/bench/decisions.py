"""How long one online decision takes, over a whole mission, and a batch of planned ones.

Each decision is timed by itself, in the order of Fig. 1, from the shared state alone, as an agent
makes it. Leaves out: the speed of the batch beside a loop tuned by hand, which needs a compiler
(``python -m tests.benchmarks.lower_level`` in a source tree).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from rich.console import RenderableType

from sim.bench.machine import this_machine
from sim.bench.results import BenchResult, table_of
from sim.bench.solvers import MissionSource, problem_of
from swarm.allocation import Problem, TeamState, rank_of, rule_by_name
from swarm.allocation.lower_level import Decision, Rule, decisions
from swarm.allocation.problem import IntArray
from swarm.allocation.rules import GuidedRule, team_at_start
from swarm.kernels.lower_level import GREEDY, default_threads, evaluate_sequences
from swarm.kernels.routes import optimise_routes
from swarm.model import TaskId
from swarm.runtime.clock import Clock
from swarm.runtime.table import Column

_DISTURBED_FRAC = 0.3
"""UAVs lost and tasks on no list, in the row after a disturbance."""
_ITERATIONS_PER_TASK = 20
_LONGEST_S = 20.0
"""Of one rule's decisions in all; of larger missions only the beginning is decided."""


@dataclass(frozen=True, slots=True)
class DecisionTimes:
    """Decisions of one rule."""

    name: str
    decisions: int
    median_s: float
    p99_s: float
    largest_s: float
    first_s: float
    """The first one on a new mission, which may have arrays to lay out."""


@dataclass(frozen=True, slots=True)
class DecideBench(BenchResult):
    """Everything measured in one run."""

    n_uav: int
    n_task: int
    seed: int
    times: tuple[DecisionTimes, ...]
    sequences: int
    """Greedy sequences in the batch."""
    sequences_per_s: float
    """By one thread."""
    threads: int
    sequences_per_s_threaded: float
    """By that many threads."""

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield f"One online decision at {self.n_uav} × {self.n_task}, seed {self.seed}:"
        yield table_of(
            self.times,
            Column("rule", words=True, key="name"),
            Column("decisions", key="decisions"),
            *(
                Column(name, _duration, key=f"{name}_s")
                for name in ("median", "p99", "largest", "first")
            ),
        )
        yield (
            f"A batch of {self.sequences} greedy sequences: {self.sequences_per_s:.0f} per "
            f"second by one thread, {self.sequences_per_s_threaded:.0f} by {self.threads}."
        )
        yield (
            f"disturbed: {_DISTURBED_FRAC:.0%} of the UAVs are lost and {_DISTURBED_FRAC:.0%} of "
            "the tasks are on no list, so lists are repaired at every decision. first: the first "
            f"decision on a new mission. Decisions of a rule end once they took {_LONGEST_S:g} s."
        )


class _TimedRule:
    """A rule that remembers how long its decisions took."""

    def __init__(self, rule: Rule, clock: Clock) -> None:
        self.name = rule.name
        self.times_s: list[float] = []
        self._rule = rule
        self._clock = clock

    def decide(
        self, problem: Problem, state: TeamState, rank: IntArray, uav: int
    ) -> Decision | None:
        begin_s = self._clock.now_s()
        decision = self._rule.decide(problem, state, rank, uav)
        self.times_s.append(self._clock.now_s() - begin_s)
        return decision


def measure_decisions(
    n_uav: int,
    n_task: int,
    seed: int,
    clock: Clock,
    *,
    sequences: int = 200,
) -> DecideBench:
    """Time all decisions of each rule on one random mission, and a batch of greedy sequences."""
    machine = this_machine()
    problem = problem_of(MissionSource(n_uav=n_uav, n_task=n_task, seed=seed))
    rng = np.random.default_rng(seed)
    times = []
    for name, rule, state in _rules(problem, rng, seed):
        timed = _TimedRule(rule, clock)
        for _ in decisions(problem, state, rank_of(range(n_uav)), timed):
            if sum(timed.times_s) > _LONGEST_S:
                break
        times.append(_times(name, timed.times_s))
    ranks = np.array([rng.permutation(n_uav) for _ in range(sequences)])
    threads = default_threads()
    return DecideBench(
        machine=machine,
        n_uav=n_uav,
        n_task=n_task,
        seed=seed,
        times=tuple(times),
        sequences=sequences,
        sequences_per_s=_sequences_per_s(problem, ranks, 1, clock),
        threads=threads,
        sequences_per_s_threaded=_sequences_per_s(problem, ranks, threads, clock),
    )


def _rules(
    problem: Problem, rng: np.random.Generator, seed: int
) -> Iterator[tuple[str, Rule, TeamState]]:
    for name in ("greedy", "lookahead"):
        yield name, rule_by_name(name), TeamState.at_start(problem)
    iterations = _ITERATIONS_PER_TASK * problem.n_task
    routes, _ = optimise_routes(team_at_start(problem), seed=seed, iterations=iterations)
    lists: dict[str, list[TaskId]] = {
        uav: [problem.task_ids[task] for task in route]
        for uav, route in zip(problem.uav_ids, routes, strict=True)
    }
    yield "guided", GuidedRule(lists), TeamState.at_start(problem)

    # No list has the pop-ups, and the lists of those lost are still there.
    popped_up = {problem.task_ids[task] for task in _some(rng, problem.n_task)}
    known: dict[str, list[TaskId]] = {
        uav: [task for task in tasks if task not in popped_up] for uav, tasks in lists.items()
    }
    state = TeamState.at_start(problem)
    state.active[_some(rng, problem.n_uav)] = False
    yield "guided, disturbed", GuidedRule(known), state


def _some(rng: np.random.Generator, n: int) -> list[int]:
    chosen: list[int] = rng.permutation(n)[: int(_DISTURBED_FRAC * n)].tolist()
    return chosen


def _times(name: str, times_s: list[float]) -> DecisionTimes:
    return DecisionTimes(
        name=name,
        decisions=len(times_s),
        median_s=float(np.median(times_s)),
        p99_s=float(np.quantile(times_s, 0.99)),
        largest_s=max(times_s),
        first_s=times_s[0],
    )


def _sequences_per_s(problem: Problem, ranks: IntArray, threads: int, clock: Clock) -> float:
    begin_s = clock.now_s()
    evaluate_sequences(problem.kernel, TeamState.at_start(problem), ranks, GREEDY, threads)
    return len(ranks) / max(clock.now_s() - begin_s, 1e-9)


def _duration(time_s: float) -> str:
    return f"{time_s * 1e6:.1f} µs" if time_s < 1e-3 else f"{time_s * 1e3:.2f} ms"
