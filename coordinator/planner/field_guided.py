"""Plans of the method `guided` under the field's constraints: searched lists with base visits.

Leaves out: bounds, schedules and why a task is left out (coordinator.planner.plan).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from coordinator.planner.options import Limit, ShouldStop
from coordinator.planner.sequence_search import Progress
from swarm.allocation.field.problem import FieldProblem
from swarm.allocation.field.state import FieldState
from swarm.kernels.field_search import Effort, optimise_lists

_ITERATIONS_PER_TASK, _FEWEST_ITERATIONS, _MOST_ITERATIONS = 400, 4_000, 100_000
_SEARCH = Effort(150_000_000)
"""Without a limit: some seconds on two processors. Who waits for the plan may be in the air."""


@dataclass(frozen=True, slots=True)
class FieldGuidedPlan:
    """What is published."""

    lists: tuple[tuple[int, ...], ...]
    """Items per UAV in order: 2k for task k forwards, 2k + 1 backwards, -1 - b for base b."""
    sequence: tuple[int, ...]
    """UAV indices by the ranks that the lists were flown with."""
    n_left_out: int
    """Open tasks without due_s that are on no list, whether somebody could do them or not."""
    objective: float
    """Σ of eq. 1 over the lists flown together, from the state on [value·s]."""
    iterations: int
    """Removals and re-insertions tried."""

    @property
    def routes(self) -> tuple[tuple[int, ...], ...]:
        """Task indices per UAV in order of execution."""
        return tuple(tuple(item >> 1 for item in items if item >= 0) for items in self.lists)


def field_guided_plan(
    problem: FieldProblem,
    *,
    seed: int = 0,
    stop: ShouldStop | None = None,
    progress: Progress | None = None,
    state: FieldState | None = None,
    lists: Sequence[Sequence[int]] | None = None,
    effort: Effort | None = None,
    threads: int | None = None,
) -> FieldGuidedPlan:
    """Optimise lists until stopped; never worse than those it begins with.

    With the same seed the same plan comes out, unless a limit in time decides how many iterations
    are made. Compared by (fewest required tasks left out, then largest J).

    Args:
        problem: the mission.
        seed: >= 0.
        stop: asked every few milliseconds with the iterations so far. The annealing cools along a
            `Limit`; under any other function, or none, it ends after a few seconds' worth of
            iterations.
        progress: told the iterations and the best J so far after each slice of work.
        state: where the team stands; at its start when None.
        lists: of items, to begin with, such as those now published.
        effort: after which it ends even so; without a `Limit` a few seconds' worth when None.
        threads: as many as there are processors when None; does not change the result.
    """
    state = FieldState.at_start(problem) if state is None else state
    found = optimise_lists(
        problem.kernel,
        state,
        seed=seed,
        spent_frac=_spent_frac(problem.n_task, stop),
        effort=_SEARCH if effort is None and not isinstance(stop, Limit) else effort,
        lists=lists,
        progress=progress,
        threads=threads,
    )
    return FieldGuidedPlan(
        lists=found.lists,
        sequence=tuple(int(uav) for uav in np.argsort(state.rank, kind="stable")),
        n_left_out=found.n_left_out,
        objective=found.objective,
        iterations=found.iterations,
    )


def _spent_frac(n_task: int, stop: ShouldStop | None) -> Callable[[int], float]:
    if isinstance(stop, Limit):
        return stop.spent_frac
    most = min(_MOST_ITERATIONS, max(_FEWEST_ITERATIONS, _ITERATIONS_PER_TASK * n_task))

    def spent_frac(iterations: int) -> float:
        return 1.0 if stop is not None and stop(iterations) else iterations / most

    return spent_frac
