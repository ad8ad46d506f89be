"""The consensus-based bundle algorithm under the field's constraints: windows, energy, lines.

The auction is that of `sim.study.baselines.cbba`; a UAV's marginal gains come from the evaluator of
the field (`swarm.kernels.field_insertion`), which waits for windows and swaps batteries where the
order of its tasks needs it. A task that a UAV cannot fit in is not bid for, and one that is due
only where J gains by it. What others will do at bases no bid knows: only who stands there now.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sim.study.baselines.cbba import Auction, CbbaResult
from swarm.allocation.field import FieldProblem, FieldState
from swarm.allocation.problem import FloatArray, IntArray
from swarm.kernels.field_insertion import best_insertions


class FieldInsertion:
    """Gains of insertion into paths that begin where the team stands."""

    def __init__(self, problem: FieldProblem, state: FieldState) -> None:
        self._problem, self._state = problem, state
        self._known: dict[tuple[int, tuple[int, ...]], tuple[FloatArray, IntArray]] = {}

    def gains(self, uav: int, path: Sequence[int]) -> tuple[FloatArray, IntArray]:
        """As `sim.study.baselines.cbba.Insertion.gains`; -infinity where nothing is bid."""
        key = uav, tuple(path)
        if key not in self._known:
            problem, wanted = self._problem, self._state.open & self._problem.capable[uav]
            wanted[list(path)] = False
            gains, places = best_insertions(problem.kernel, self._state, uav, path, wanted)
            gains[~problem.required & (gains <= 0.0)] = -np.inf
            self._known[key] = gains, places.astype(np.int64)
        return self._known[key]


def field_cbba(problem: FieldProblem, state: FieldState) -> CbbaResult:
    """Auction the open tasks among active UAVs; the same state gives the same lists."""
    active = state.active & np.isfinite(state.free_s)
    eligible = problem.capable & state.open & active[:, None]
    auction = Auction(FieldInsertion(problem, state), eligible, active)
    converged = auction.run(int(state.open.sum()))
    return CbbaResult(auction.paths_won(), auction.rounds, converged, 0)
