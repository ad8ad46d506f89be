"""The paper's results, computed again and held against what it prints.

Leaves out: showing them (sim.study.reproduce_report) and drawing them (sim.study.figures).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from sim.study.generator import random_table_problem
from sim.study.reproduce_expected import Check, Expectations
from sim.study.reproduce_random import RandomStudy, study_random
from sim.study.reproduce_table import TableStudy, study_table
from sim.study.reproduce_theorems import TheoremResult, check_theorems
from sim.study.reproduce_times import Machine, TimeStudy, study_times, this_machine
from swarm.allocation import Problem
from swarm.clock import Clock
from swarm.scenario import load_scenario
from swarm.scenario.shipped import resolve_scenario

__all__ = ["Reproduction", "reproduce_paper"]

_TIMED_PROBLEMS = 20
_THEOREM_CASES = 500


@dataclass(frozen=True, slots=True)
class Reproduction:
    """Everything that was computed, and what it had to be."""

    table: TableStudy
    random: RandomStudy
    times: TimeStudy
    theorems: tuple[TheoremResult, ...]
    machine: Machine
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
            "checks": [
                {
                    "name": check.name,
                    "ours": check.ours,
                    "expected": check.expected,
                    "ok": check.ok,
                }
                for check in self.checks
            ],
            "paper": {
                "optimum": paper.optimum.value,
                "hierarchical": paper.hierarchical.value,
                "normalised": {rule: figure.value for rule, figure in paper.normalised.items()},
            },
            "table": self.table.as_json(),
            "random": self.random.as_json(),
            "times": self.times.as_json(),
            "theorems": [theorem.as_json() for theorem in self.theorems],
            "machine": self.machine.as_json(),
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

    Args:
        problems: how many random problems; >= 1.
        seed: of everything random; >= 0.
        clock: of the machine.
        expected: what must come out; the paper's and the checked figures when None.
        threads: how many work at random problems; >= 1.
        theorem_cases: random cases of each theorem; >= 1.
        progress: told how many random problems are done.
    """
    begin_s = clock.now_s()
    wanted = Expectations() if expected is None else expected
    mission = load_scenario(resolve_scenario("table-1"))
    table = Problem.from_mission(mission)
    # times first, while no other thread of this process works
    draw = partial(random_table_problem, table, seed)
    times = study_times(draw, min(problems, _TIMED_PROBLEMS), clock=clock)
    return Reproduction(
        table=study_table(mission, wanted, clock=clock),
        random=study_random(table, problems, seed, threads=threads, progress=progress),
        times=times,
        theorems=tuple(check_theorems(seed, theorem_cases)),
        machine=this_machine(),
        expected=wanted,
        elapsed_s=clock.now_s() - begin_s,
    )
