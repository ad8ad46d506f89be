"""The random problems: how close the rules come to the optimum on average.

J is normalised as the paper does, worst plan 0 and optimum 1, and in other readings of what it may
have averaged.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import permutations
from math import sqrt

import numpy as np

from coordinator.planner.plan import guided_plan
from sim.study.generator import random_table_problem
from sim.study.paper.tables import RULES, Check, Expectations, PaperFigures
from swarm.allocation import Problem, TeamState, evaluate, rank_of
from swarm.allocation.problem import FloatArray
from swarm.allocation.rules import kernel_rule
from swarm.kernels import exact as kernel
from swarm.kernels.lower_level import evaluate_sequences

STUDIED = (*RULES, "guided")
_ROUNDING = 1e-9
"""Of sums of eq. 1 in different orders, on the scale from worst plan to optimum."""


@dataclass(frozen=True, slots=True)
class ProblemResult:
    """One random problem; every value is J [value·s]."""

    optimum: float
    worst: float
    sequences: Mapping[str, tuple[float, ...]]
    """By rule, for every sequence in lexicographic order."""
    guided: float


@dataclass(frozen=True, slots=True)
class Average:
    """A mean over problems and its 95 % interval (Student's t)."""

    mean: float
    half_width: float | None
    """None for a single problem."""

    @classmethod
    def of(cls, values: FloatArray) -> Average:
        """Of (n,) values, n >= 1."""
        n = len(values)
        if n < 2:  # one value has no spread
            return cls(float(values.mean()), None)
        from scipy.special import stdtrit

        quantile = float(stdtrit(n - 1, 0.975))
        return cls(float(values.mean()), quantile * float(values.std(ddof=1)) / sqrt(n))

    def as_json(self) -> dict[str, float | None]:
        """Ready for `json.dumps`."""
        low = None if self.half_width is None else self.mean - self.half_width
        high = None if self.half_width is None else self.mean + self.half_width
        return {"mean": self.mean, "low_95": low, "high_95": high}


@dataclass(frozen=True, slots=True)
class Reading:
    """One reading of what an average over problems is taken of."""

    scale: str
    """`worst`: worst plan 0, optimum 1; `ratio`: J / optimum."""
    sequence: str
    """`best`, `mean` or `worst` of all sequences of each problem."""


READINGS = tuple(
    Reading(scale, sequence)
    for scale in ("worst", "ratio")
    for sequence in ("best", "mean", "worst")
)
"""The first is the paper's normalisation with the sequence searched, as its text has it."""


@dataclass(frozen=True, slots=True)
class RandomResults:
    """All random problems of one seed."""

    seed: int
    problems: tuple[ProblemResult, ...]

    def normalised(self, method: str) -> FloatArray:
        """(n_problem,) worst plan 0, optimum 1; the rules by their best sequence."""
        if method in RULES:
            return self.read(method, READINGS[0])
        return self._scaled(np.array([each.guided for each in self.problems]), "worst")

    def read(self, rule: str, reading: Reading) -> FloatArray:
        """(n_problem,) values of ``rule`` in ``reading``."""
        pick: dict[str, Callable[[FloatArray], FloatArray]] = {
            "best": lambda values: values.max(axis=1),
            "mean": lambda values: values.mean(axis=1),
            "worst": lambda values: values.min(axis=1),
        }
        by_sequence = np.array([each.sequences[rule] for each in self.problems])
        return self._scaled(pick[reading.sequence](by_sequence), reading.scale)

    def average(self, method: str) -> Average:
        """Of `normalised`."""
        return Average.of(self.normalised(method))

    def closest_reading(self, paper: PaperFigures) -> Reading:
        """The reading whose averages lie closest to the paper's, all rules together."""

        def distance(reading: Reading) -> float:
            return sum(
                abs(float(self.read(rule, reading).mean()) - figure.value)
                for rule, figure in paper.normalised.items()
            )

        return min(READINGS, key=distance)

    def checks(self, expected: Expectations) -> list[Check]:
        """Averages reach what they should, and nothing is better than the optimum."""
        found = []
        for method, least in expected.normalised_at_least.items():
            average = self.average(method)
            reach = average.mean + (average.half_width or 0.0)
            shown = f"{average.mean:.4f}"
            if average.half_width is not None:
                shown += f" ± {average.half_width:.4f}"
            enough = average.half_width is None or reach >= least  # one problem shows nothing
            found.append(Check(f"random problems, {method}", shown, f">= {least:g}", enough))
        values = np.concatenate([self.normalised(method) for method in STUDIED])
        outside = int(((values < -_ROUNDING) | (values > 1.0 + _ROUNDING)).sum())
        name = "plans outside worst..optimum"
        found.append(Check(name, str(outside), "0", outside == 0))
        return found

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "problems": len(self.problems),
            "seed": self.seed,
            "normalised": {method: self.average(method).as_json() for method in STUDIED},
            "readings": [
                {
                    "scale": "worst plan 0, optimum 1"
                    if reading.scale == "worst"
                    else "J / optimum",
                    "sequence": reading.sequence,
                    **{rule: Average.of(self.read(rule, reading)).as_json() for rule in RULES},
                }
                for reading in READINGS
            ],
            "values": {method: self.normalised(method).tolist() for method in STUDIED},
        }

    def _scaled(self, objective: FloatArray, scale: str) -> FloatArray:
        best = np.array([each.optimum for each in self.problems])
        zero = np.array([each.worst for each in self.problems]) if scale == "worst" else 0.0
        scaled: FloatArray = (objective - zero) / (best - zero)
        return scaled


def reproduce_random(
    table: Problem,
    problems: int,
    seed: int,
    *,
    threads: int = 1,
    progress: Callable[[int], None] | None = None,
) -> RandomResults:
    """Solve random problems; the result is the same for any number of threads.

    Nearly all the work is done by kernels, which let other threads run meanwhile. Of ``table``,
    Table I, all but the places is kept. ``progress`` is told how many problems are done.
    """
    if problems < 1:
        raise ValueError(f"problems must be >= 1, not {problems}")
    if threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")
    results = []
    pool = ThreadPoolExecutor(threads)
    try:
        for result in pool.map(partial(_solve, table, seed), range(problems)):
            results.append(result)
            if progress is not None:
                progress(len(results))
    finally:
        pool.shutdown(cancel_futures=True)
    return RandomResults(seed, tuple(results))


def _solve(table: Problem, seed: int, index: int) -> ProblemResult:
    problem = random_table_problem(table, seed, index)
    ranks = np.array([rank_of(order) for order in permutations(range(problem.n_uav))])
    team = TeamState.at_start(problem)
    # summed by one function, so that an optimum found again is worth exactly the same
    best = evaluate(problem, kernel.optimum(problem.kernel, threads=1)[1])[0]
    guided = evaluate(problem, guided_plan(problem, seed=seed, threads=1).routes)[0]
    return ProblemResult(
        optimum=best,
        worst=kernel.optimum(problem.kernel, worst=True, threads=1)[0],
        sequences={
            rule: tuple(
                evaluate_sequences(problem.kernel, team, ranks, kernel_rule(rule).code, threads=1)[
                    0
                ].tolist()
            )
            for rule in RULES
        },
        guided=guided,
    )
