"""One method on one mission in a process of its own, so that time and memory are its own.

``python -m sim.bench.worker`` reads one job as JSON from standard input and writes one answer to
standard output. Leaves out: which jobs there are (`sim.bench.plan_bench`).
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from sim.bench.machine import peak_memory_bytes
from sim.bench.methods import METHODS, TracePoint
from sim.study.baselines.value_per_time import makespan_s, value_per_time
from sim.study.generator import random_mission
from swarm.allocation.problem import Problem
from swarm.clock import Clock, SystemClock
from swarm.errors import SwarmError
from swarm.scenario import load_scenario

__all__ = ["HORIZON_SHARE", "Answer", "Job", "Source", "do", "do_in_subprocess", "problem_of"]

HORIZON_SHARE = 1.2
"""D of random missions over the makespan of value-per-time's lists."""
_GRACE_S = 120.0
"""A method that ignores its limit is ended this long after twice the limit."""


@dataclass(frozen=True, slots=True)
class Source:
    """Where a mission comes from: a scenario file, or size and seed of a random one."""

    scenario: str | None = None
    n_uav: int = 0
    n_task: int = 0
    seed: int = 0
    horizon_s: float | None = None
    """D, where it is known already [s]."""


@dataclass(frozen=True, slots=True)
class Job:
    """What to run."""

    source: Source
    method: str
    """One of `METHODS`."""
    limit_s: float
    seed: int


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of it."""

    routes: list[list[int]]
    elapsed_s: float
    """From the problem's arrays to lists; imports are done before [s]."""
    cpu_s: float
    """Time of all processors in it [s]."""
    peak_bytes: int
    """Most memory of the whole process, interpreter and mission included."""
    base_bytes: int
    """The same before the method began."""
    note: str
    trace: list[TracePoint]
    """See `Solved`."""


def problem_of(source: Source) -> Problem:
    """The mission's arrays; pop-ups are unknown to a plan."""
    if source.scenario is not None:
        return Problem.from_mission(load_scenario(Path(source.scenario)).known_at_start())
    if source.horizon_s is not None:
        return random_mission(source.n_uav, source.n_task, source.seed, horizon_s=source.horizon_s)
    problem = random_mission(source.n_uav, source.n_task, source.seed)
    longest_s = makespan_s(problem, value_per_time(problem))
    return replace(problem, horizon_s=HORIZON_SHARE * longest_s)


def do(job: Job, clock: Clock) -> Answer:
    """Run a job in this process."""
    problem = problem_of(job.source)
    solve = METHODS[job.method].load()
    base_bytes = peak_memory_bytes()
    begin_cpu_s, begin_s = _cpu_s(), clock.now_s()
    solved = solve(problem, job.limit_s, job.seed, clock)
    elapsed_s = clock.now_s() - begin_s
    return Answer(
        routes=[[int(task) for task in route] for route in solved.routes],
        elapsed_s=elapsed_s,
        cpu_s=_cpu_s() - begin_cpu_s,
        peak_bytes=peak_memory_bytes(),
        base_bytes=base_bytes,
        note=solved.note,
        trace=list(solved.trace),
    )


def do_in_subprocess(job: Job) -> Answer:
    """Run a job in a new process.

    Raises:
        SwarmError: the process failed or had to be ended.
    """
    limit_s = 2.0 * job.limit_s + _GRACE_S
    try:
        ended = subprocess.run(
            [sys.executable, "-m", "sim.bench.worker"],
            input=json.dumps(asdict(job)),
            capture_output=True,
            text=True,
            timeout=limit_s,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise SwarmError(f"method {job.method} was ended after {limit_s:.0f} s") from error
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines() or [f"exit status {ended.returncode}"]
        raise SwarmError(f"method {job.method} failed: {said[-1]}")
    fields: dict[str, Any] = json.loads(ended.stdout)
    fields["trace"] = [(time_s, worth) for time_s, worth in fields["trace"]]
    return Answer(**fields)


def main(read: Callable[[], str], write: Callable[[str], object]) -> int:
    """Do the job that ``read`` gives and ``write`` the answer; its exit status."""
    fields: dict[str, Any] = json.loads(read())
    fields["source"] = Source(**fields["source"])
    try:
        answer = do(Job(**fields), SystemClock())
    except KeyboardInterrupt:
        return 130
    write(json.dumps(asdict(answer), allow_nan=False))
    return 0


def _cpu_s() -> float:
    times = os.times()
    return times.user + times.system


if __name__ == "__main__":
    raise SystemExit(main(sys.stdin.read, sys.stdout.write))
