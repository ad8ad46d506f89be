"""Speed of decisions and of batches of sequences, beside a loop tuned by hand.

Run it: ``python -m tests.benchmarks.lower_level``. The limit that batches are held against
is `sweep_limit.cpp`, compiled here with the kernels' options: the same sweeps over the same
columns and nothing else. Both run on one thread, in turn, and are compared by the least
processor time of several rounds, so that other work on the machine falsifies little.
"""

from __future__ import annotations

import math
import os
import platform
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from swarm.allocation import Problem, TeamState, rank_of, rule_by_name
from swarm.kernels.exact import optimum
from swarm.kernels.lower_level import GREEDY, default_threads, evaluate_sequences
from swarm.runtime.clock import SystemClock
from tests.support.problems import random_problem

SOURCE = Path(__file__).with_name("sweep_limit.cpp")
OPTIONS = ("-std=c++17", "-O3", "-ffp-contract=off", "-fno-math-errno")


@dataclass(frozen=True, slots=True)
class BatchSpeed:
    """Batch evaluation of greedy sequences on one thread."""

    look_ns: float
    """Time per task looked at by a decision [ns]."""
    limit_ns: float
    """The same of the loop tuned by hand [ns]."""
    sequences_per_s: float
    """Sequences evaluated per second of processor time."""
    threads: int
    """Threads of the next figure."""
    sequences_per_s_threaded: float
    """Sequences evaluated per second by all of them."""

    @property
    def share_of_limit(self) -> float:
        """1: as fast as the loop tuned by hand."""
        return self.limit_ns / self.look_ns


def best_s(work: Callable[[], object], repeats: int, runs: int = 1) -> float:
    """Shortest time of ``repeats`` over ``runs`` calls each, per call [s]."""
    clock = SystemClock()
    times_s = []
    for _ in range(repeats):
        begin_s = clock.now_s()
        for _ in range(runs):
            work()
        times_s.append((clock.now_s() - begin_s) / runs)
    return min(times_s)


def case(n_uav: int, n_task: int, lowest_survival: float = 0.9) -> Problem:
    """A problem in which no UAV is incapable and none is late for long."""
    rng = np.random.default_rng(0)
    return random_problem(rng, n_uav, n_task, lowest_survival=lowest_survival, horizon_s=60.0)


def decision_s(rule: str, n_uav: int, n_task: int) -> float:
    """One decision of an agent, from its state to a `Decision`, with everything open [s].

    Lookahead decides on a new problem every time, so that it finds no tables of tours.
    """
    chosen, rank = rule_by_name(rule), rank_of(range(n_uav))
    problems = [case(n_uav, n_task) for _ in range(1 if rule == "greedy" else 5)]
    state = TeamState.at_start(problems[0])
    if rule == "greedy":
        return best_s(lambda: chosen.decide(problems[0], state, rank, n_uav // 2), 5, 2000)
    return best_s(lambda: chosen.decide(problems.pop(), state, rank, n_uav // 2), len(problems))


def exact_s(n_uav: int, n_task: int, lowest_survival: float = 1.0) -> float:
    """Proving the optimum, on all processors [s]."""
    problem = case(n_uav, n_task, lowest_survival)
    return best_s(lambda: optimum(problem.kernel), 1)


def batch_speed(n_uav: int, n_task: int, sequences: int = 200, rounds: int = 5) -> BatchSpeed:
    """Evaluation of random sequences by greedy from the starts."""
    problem = case(n_uav, n_task)
    state = TeamState.at_start(problem)
    rng = np.random.default_rng(0)
    ranks = np.array([rank_of(rng.permutation(n_uav).tolist()) for _ in range(sequences)])
    threads = default_threads()

    def evaluate(count: int) -> None:
        evaluate_sequences(problem.kernel, state, ranks, GREEDY, count)

    looks = sequences * n_task * (n_task + 1) / 2
    look_ns, limit_ns = math.inf, math.inf
    with sweep_limit(n_uav, n_task, sequences) as measure_limit_ns:
        for _ in range(rounds):
            limit_ns = min(limit_ns, measure_limit_ns())
            for _ in range(3):
                begin_s = time.process_time()
                evaluate(1)
                look_ns = min(look_ns, 1e9 * (time.process_time() - begin_s) / looks)
    return BatchSpeed(
        look_ns=look_ns,
        limit_ns=limit_ns,
        sequences_per_s=1e9 * sequences / (look_ns * looks),
        threads=threads,
        sequences_per_s_threaded=sequences / best_s(lambda: evaluate(threads), 5),
    )


@contextmanager
def sweep_limit(n_uav: int, n_task: int, sequences: int) -> Iterator[Callable[[], float]]:
    """Measures the time per task looked at in the loop tuned by hand [ns]."""
    compiler = os.environ.get("CXX", "c++")
    with tempfile.TemporaryDirectory() as folder:
        program = str(Path(folder) / "sweep_limit")
        subprocess.run([compiler, *OPTIONS, str(SOURCE), "-o", program], check=True)
        arguments = [program, str(n_uav), str(n_task), str(sequences)]

        def measure_ns() -> float:
            done = subprocess.run(arguments, check=True, capture_output=True, text=True)
            return float(done.stdout)

        yield measure_ns


def main() -> None:
    """Print every figure."""
    print(f"{platform.machine()}, {os.cpu_count()} processors, Python {platform.python_version()}")
    print(f"greedy decision at 50 × 500: {1e6 * decision_s('greedy', 50, 500):.1f} µs (below 20)")
    for n_task in (12, 60, 500):
        print(
            f"lookahead decision, {n_task} open: {1e3 * decision_s('lookahead', 5, n_task):.2f} ms"
        )
    for n_task, lowest in ((12, 1.0), (14, 1.0), (16, 1.0), (12, 0.9), (14, 0.9)):
        kind = "= 1" if lowest == 1.0 else "< 1"
        print(f"optimum of 8 × {n_task}, survival {kind}: {exact_s(8, n_task, lowest):.3f} s")
    for n_uav, n_task in ((10, 60), (50, 500), (200, 5000)):
        speed = batch_speed(n_uav, n_task, max(2, 10_000_000 // n_task**2))
        print(
            f"batch at {n_uav} × {n_task}: {speed.look_ns:.2f} ns per task looked at, "
            f"the loop tuned by hand {speed.limit_ns:.2f} ns: {100 * speed.share_of_limit:.0f} % "
            f"of its speed (at least 50); {speed.sequences_per_s:.0f} sequences/s, "
            f"{speed.sequences_per_s_threaded:.0f} on {speed.threads} threads"
        )


if __name__ == "__main__":
    main()
