"""The paper's results, computed again and held against what it prints.

Times are medians, taken side by side in one thread, without the Python around the kernels.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from itertools import permutations
from statistics import median

import numpy as np

from sim.bench.machine import processor_name
from sim.study.generator import random_table_problem
from sim.study.paper.random_problems import RandomResults, reproduce_random
from sim.study.paper.tables import RULES, Check, Expectations, TableResults, reproduce_tables
from sim.study.paper.theorems import TheoremResult, check_theorems
from swarm.allocation import Problem, TeamState, rank_of
from swarm.allocation.rules import kernel_rule
from swarm.kernels import exact
from swarm.kernels.lower_level import default_threads, evaluate_sequences
from swarm.runtime.clock import Clock
from swarm.scenario import load_scenario
from swarm.scenario.files import resolve_scenario

_REPEATS = 25


@dataclass(frozen=True, slots=True)
class ProcessorInfo:
    """Where times were measured."""

    processor: str
    processors: int
    """That this process may use."""
    system: str
    python: str

    def __str__(self) -> str:
        noun = "processor" if self.processors == 1 else "processors"
        return f"{self.processors} {noun} {self.processor}, {self.system}, Python {self.python}"


@dataclass(frozen=True, slots=True)
class MethodTimes:
    """Median times of one run over the same problems."""

    problems: int
    repeats: int
    median_s: Mapping[str, float]
    """By method, for one problem: `optimum`; `lookahead` and `greedy` with all sequences tried."""

    def ratio(self, method: str) -> float:
        """How many times as long as greedy."""
        return self.median_s[method] / self.median_s["greedy"]

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {**asdict(self), "of_greedy": {name: self.ratio(name) for name in self.median_s}}


def measure_times(
    draw: Callable[[int], Problem], problems: int, *, clock: Clock, repeats: int = _REPEATS
) -> MethodTimes:
    """Take turns over problems and methods, so that what else the machine does hits all alike.

    Problems are drawn anew each time, since kernels remember tours of a problem.
    """
    taken_s: dict[str, list[float]] = {"optimum": [], **{rule: [] for rule in reversed(RULES)}}
    for _ in range(repeats):
        for index in range(problems):
            for method, spent_s in taken_s.items():
                work = _work(draw(index), method)
                begin_s = clock.now_s()
                work()
                spent_s.append(clock.now_s() - begin_s)
    medians = {method: median(spent_s) for method, spent_s in taken_s.items()}
    return MethodTimes(problems, repeats, medians)


def this_processor() -> ProcessorInfo:
    """The one this runs on."""
    return ProcessorInfo(
        processor=processor_name(),
        processors=default_threads(),
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
    )


def _work(problem: Problem, method: str) -> Callable[[], object]:
    if method == "optimum":
        return lambda: exact.optimum(problem.kernel, threads=1)
    ranks = np.array([rank_of(order) for order in permutations(range(problem.n_uav))])
    team, code = TeamState.at_start(problem), kernel_rule(method).code
    return lambda: evaluate_sequences(problem.kernel, team, ranks, code, threads=1)


_TIMED_PROBLEMS = 20
_THEOREM_CASES = 500


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything that was computed, and what it had to be."""

    table: TableResults
    random: RandomResults
    times: MethodTimes
    theorems: tuple[TheoremResult, ...]
    machine: ProcessorInfo
    expected: Expectations
    elapsed_s: float

    @property
    def checks(self) -> list[Check]:
        """All that must come out right."""
        return [
            *self.table.checks(self.expected),
            *self.random.checks(self.expected),
            *(theorem.check() for theorem in self.theorems),
        ]

    @property
    def ok(self) -> bool:
        """Whether every check holds."""
        return all(check.ok for check in self.checks)

    def as_json(self) -> dict[str, object]:
        """The reproduction as `swarm reproduce --json` prints it, ready for `json.dumps`."""
        paper = self.expected.paper
        return {
            "ok": self.ok,
            "checks": [asdict(check) for check in self.checks],
            "paper": {
                "optimum": paper.optimum.value,
                "hierarchical": paper.hierarchical.value,
                "normalised": {rule: figure.value for rule, figure in paper.normalised.items()},
            },
            "table": self.table.as_json(),
            "random": self.random.as_json(),
            "times": self.times.as_json(),
            "theorems": [asdict(theorem) for theorem in self.theorems],
            "machine": asdict(self.machine),
            "elapsed_s": self.elapsed_s,
        }


def reproduce_paper(
    problems: int,
    seed: int,
    *,
    clock: Clock,
    expected: Expectations | None = None,
    threads: int = 1,
    theorem_cases: int = _THEOREM_CASES,
    progress: Callable[[int], None] | None = None,
) -> Reproduction:
    """Compute all of it; only times depend on the machine and on ``threads``.

    What must come out is `Expectations` when None. ``progress`` is told how many random problems
    are done.
    """
    begin_s = clock.now_s()
    wanted = Expectations() if expected is None else expected
    mission = load_scenario(resolve_scenario("table-1"))
    table = Problem.from_mission(mission)
    # times first, while no other thread of this process works
    draw = partial(random_table_problem, table, seed)
    times = measure_times(draw, min(problems, _TIMED_PROBLEMS), clock=clock)
    return Reproduction(
        table=reproduce_tables(mission, wanted, clock=clock),
        random=reproduce_random(table, problems, seed, threads=threads, progress=progress),
        times=times,
        theorems=tuple(check_theorems(seed, theorem_cases)),
        machine=this_processor(),
        expected=wanted,
        elapsed_s=clock.now_s() - begin_s,
    )
