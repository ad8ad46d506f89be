# %% [markdown]
"""# Compare a policy of one's own with the project's, in many futures that nobody knows.

    python -m sim.examples.compare_policies

Shows what may go wrong in `swarm.simulate`. `swarm study` does the same with many policies,
intervals, tables and plots, `swarm bench plan` compares planners.
"""

# %%
from __future__ import annotations

import math
import statistics

import swarm

MISSION = swarm.load("table-1")
FUTURES = 20

# %% [markdown]
"""A policy of our own: the best task that is near; if there is none, the best of all."""


# %%
def patient(turn: swarm.Turn) -> swarm.Task | None:
    """Do not go twice as far as one must."""
    nearest_s = min(turn.travel_s(task) for task in turn.open)
    near = [task for task in turn.open if turn.travel_s(task) <= 2.0 * nearest_s]
    return max(near or turn.open, key=turn.gain)


# %% [markdown]
"""UAVs are lost, attempts fail and tasks pop up by chance. With the same seed every policy meets
the same losses, failures and pop-ups, so that differences show with few futures.
"""


# %%
def values_of(policy: str | swarm.DecisionRule) -> list[float]:
    """What the mission is worth by ``policy``, in each future [value·s]."""
    return [
        swarm.simulate(MISSION, policy, seed=seed, loss=0.2, popup=0.3, outcomes=True).value
        for seed in range(FUTURES)
    ]


ours, theirs = values_of(patient), values_of("greedy")
print(f"patient {statistics.fmean(ours):.2f}, greedy {statistics.fmean(theirs):.2f} value·s")

# %% [markdown]
"""The mean difference, future by future, with its standard error."""

# %%
differences = [mine - other for mine, other in zip(ours, theirs, strict=True)]
error = statistics.stdev(differences) / math.sqrt(FUTURES)
print(f"difference {statistics.fmean(differences):+.2f} ± {error:.2f} in {FUTURES} futures")
