"""The exact optimum of eq. 1 by dynamic programming over subsets."""

from __future__ import annotations

from collections.abc import Callable

from swarm.kernels import _kernels
from swarm.kernels._kernels import KernelProblem
from swarm.kernels.lower_level import default_threads

MOST_TASKS: int = _kernels.MOST_TASKS
"""Tasks the solver takes where every survival probability is 1."""
MOST_UNCERTAIN_TASKS: int = _kernels.MOST_UNCERTAIN_TASKS
"""Tasks it takes otherwise."""


def optimum(
    problem: KernelProblem,
    *,
    worst: bool = False,
    threads: int | None = None,
    should_stop: Callable[[], bool] | None = None,
) -> tuple[float, list[list[int]]]:
    """The best lists from the starts, or the worst, that hold all tasks some UAV is capable of.

    Best tours over every subset for each UAV, n²·2ⁿ, by labels where survival is below 1; then the
    division among the UAVs, 3ⁿ for each. The same with any number of threads.

    With ``worst`` J is minimised. ``should_stop`` is asked every few milliseconds whether to give
    up.

    Returns:
        J [value·s], as the dynamic programme's sums have it, and a list of task indices per UAV;
        NaN and empty lists where it was told to give up.

    Raises:
        ValueError: too many tasks.
    """
    count = default_threads() if threads is None else threads
    return _kernels.optimum(problem, worst, count, should_stop)
