"""The relaxed pricing problem behind the upper bound on J; see `coordinator.planner.bound`.

For one UAV and a price per task, the best list of Σ p·S₀·m·(D − t) − price, with times in whole
buckets, each leg rounded down, S taken as that of the start, and tasks allowed more than once.
Leaves out: how prices are found.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt

from swarm.kernels import _kernels
from swarm.kernels.routes import FloatArray, TeamArrays

__all__ = ["MOST_BUCKETS", "priced_lists", "shortest_leg_s"]

MOST_BUCKETS = 100_000


def shortest_leg_s(team: TeamArrays) -> float:
    """Least time between completing one task and another, by any active UAV [s].

    Infinite where there are fewer than two tasks or no active UAV.
    """
    return _kernels.shortest_leg_s(team.mission.kernel, *team.arguments())


def priced_lists(
    team: TeamArrays, price: FloatArray, bucket_s: float, *, threads: int | None = None
) -> tuple[float, npt.NDArray[np.int64]]:
    """Best relaxed lists of all active UAVs, each for itself, over the open tasks.

    Time grows with active UAVs · tasks² · buckets, memory per thread with tasks ·
    (tasks + buckets).

    Args:
        team: mission and state.
        price: (n_task,) to pay for each visit [value·s]; >= 0.
        bucket_s: width of a bucket [s]; > 0 and not above `shortest_leg_s`.
        threads: at most this many; does not change the result.

    Returns:
        Sum of what the lists are worth after paying, each at least 0, and (n_task,) how often each
        task is visited by them.

    Raises:
        ValueError: names the argument that is wrong.
    """
    prices = np.array(price, dtype=np.float64, order="C")
    if prices.shape != (team.mission.n_task,):
        raise ValueError(f"price must have shape {(team.mission.n_task,)}, not {prices.shape}")
    if not (np.isfinite(prices).all() and (prices >= 0.0).all()):
        raise ValueError("price must be finite and >= 0")
    if not 0.0 < bucket_s <= shortest_leg_s(team):
        raise ValueError(f"bucket_s must be within 0..shortest leg, not {bucket_s}")
    begin_s = np.asarray(team.free_s)[np.asarray(team.active)].min(initial=0.0)
    if team.mission.horizon_s - begin_s > bucket_s * MOST_BUCKETS:
        raise ValueError(f"bucket_s must not make more than {MOST_BUCKETS} buckets")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be >= 1, not {threads}")
    return _kernels.priced_lists(
        team.mission.kernel,
        *team.arguments(),
        np.asarray(team.open),
        prices,
        float(bucket_s),
        (os.cpu_count() or 1) if threads is None else threads,
    )
