"""How long the optimum, lookahead and greedy take, measured side by side in one thread.

Leaves out: problems of other sizes, and the Python around the kernels.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from statistics import median

import numpy as np

from sim.study.reproduce_table import RULES
from swarm.allocation import Problem, TeamState, rank_of, rule_by_name
from swarm.clock import Clock
from swarm.kernels import exact
from swarm.kernels.lower_level import default_threads, evaluate_sequences

__all__ = ["Machine", "TimeStudy", "study_times", "this_machine"]

_REPEATS = 25


@dataclass(frozen=True, slots=True)
class Machine:
    """Where times were measured."""

    processor: str
    processors: int
    """That this process may use."""
    system: str
    python: str

    def __str__(self) -> str:
        noun = "processor" if self.processors == 1 else "processors"
        return f"{self.processors} {noun} {self.processor}, {self.system}, Python {self.python}"

    def as_json(self) -> dict[str, str | int]:
        """Ready for `json.dumps`."""
        return {
            "processor": self.processor,
            "processors": self.processors,
            "system": self.system,
            "python": self.python,
        }


@dataclass(frozen=True, slots=True)
class TimeStudy:
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
        return {
            "problems": self.problems,
            "repeats": self.repeats,
            "median_s": dict(self.median_s),
            "of_greedy": {method: self.ratio(method) for method in self.median_s},
        }


def study_times(
    draw: Callable[[int], Problem], problems: int, *, clock: Clock, repeats: int = _REPEATS
) -> TimeStudy:
    """Take turns over problems and methods, so that what else the machine does hits all alike.

    Args:
        draw: the problem of an index; anew each time, since kernels remember tours of a problem.
        problems: how many are drawn; >= 1.
        clock: of the machine.
        repeats: how often each method solves each problem; >= 1.
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
    return TimeStudy(problems, repeats, medians)


def this_machine() -> Machine:
    """The one this runs on."""
    return Machine(
        processor=_processor(),
        processors=default_threads(),
        system=f"{platform.system()} {platform.machine()}",
        python=platform.python_version(),
    )


def _work(problem: Problem, method: str) -> Callable[[], object]:
    if method == "optimum":
        return lambda: exact.optimum(problem.kernel, threads=1)
    ranks = np.array([rank_of(order) for order in permutations(range(problem.n_uav))])
    team, code = TeamState.at_start(problem), rule_by_name(method).code
    return lambda: evaluate_sequences(problem.kernel, team, ranks, code, threads=1)


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:  # no Linux
        text = ""
    for line in text.splitlines():
        key, _, name = line.partition(":")
        if key.strip() == "model name":
            return " ".join(name.split())
    return platform.processor() or "of unknown make"
