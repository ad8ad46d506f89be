"""Complete tours of one UAV: exactly over every subset of a few tasks, well over many.

Leaves out: dividing tasks among UAVs (`swarm.kernels.exact`).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels._kernels import TourTable
from swarm.kernels.arrays import converted


def tour_table(
    weight: npt.ArrayLike, survival: npt.ArrayLike, leg_s: npt.ArrayLike, horizon_s: float
) -> TourTable:
    """Best tours over subsets of n tasks (eq. 6), whenever and wherever they begin.

    Time and memory grow as n²·2ⁿ, more where survival is below 1: dynamic programming on the
    remaining set and the last task, by labels where a tour's worth depends on survival.
    A subset is a bit mask of positions 0..n-1. ``first_values(mask, completion_s)`` gives the
    (n,) worth of the best tour over ``mask`` by its first task, -inf outside; ``values`` the
    (2**n,) worth of the best tour over every subset; ``best_tour`` its positions in order.
    ``completion_s`` is the (n,) completion time of each task if it is first [s]; its entries
    outside ``mask`` are not read.

    Args:
        weight: (n,) p·m of each task; negative weights find the worst tours.
        survival: (n,) probability of surviving each task, within 0..1.
        leg_s: (n, n) time from completing one task to completing another [s].
        horizon_s: D [s].

    Raises:
        ValueError: names the argument whose shape or numbers are wrong; more than 18 tasks, or 16
            where survival is below 1.
    """
    return TourTable(
        converted("weight", weight, np.float64, 1),
        converted("survival", survival, np.float64, 1),
        converted("leg_s", leg_s, np.float64, 2),
        float(horizon_s),
    )


def good_tour(
    completion_s: npt.ArrayLike,
    weight: npt.ArrayLike,
    survival: npt.ArrayLike,
    leg_s: npt.ArrayLike,
    horizon_s: float,
) -> tuple[npt.NDArray[np.int64], float, float]:
    """A good tour over 2..4096 tasks, and what it loses by another first task.

    Beam search, then local search by reversals, swaps and moves of up to three tasks, each looked
    at in constant time. Deterministic and without proof.

    Args:
        completion_s: (n,) completion time of each task if it is first [s].
        weight: (n,) p·m.
        survival: (n,) survival probabilities.
        leg_s: (n, n) time from completing one task to completing another [s].
        horizon_s: D [s].

    Returns:
        (n,) positions in order, its worth with S = 1 before [value·s], and the best worth found
        among tours that begin with another task.

    Raises:
        ValueError: names the argument whose shape or numbers are wrong.
    """
    return _kernels.good_tour(
        converted("completion_s", completion_s, np.float64, 1),
        converted("weight", weight, np.float64, 1),
        converted("survival", survival, np.float64, 1),
        converted("leg_s", leg_s, np.float64, 2),
        float(horizon_s),
    )
