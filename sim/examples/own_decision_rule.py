# %% [markdown]
"""# Write a decision rule of one's own, and let a whole fleet fly by it.

    python -m sim.examples.own_decision_rule

Shows `swarm.Turn`, and `swarm.simulate` beside the rules of the project.
"""

# %%
from __future__ import annotations

import swarm

# %% [markdown]
"""A rule is a function: it gets a UAV's turn to decide and gives one of the tasks that are open to
it. Every agent works out what the others before it will take, by the same function, so a rule
must give the same answer for the same turn.
"""


# %%
def soonest(turn: swarm.Turn) -> swarm.Task | None:
    """Take whatever is done first."""
    return min(turn.open, key=turn.completion_s)


def value_per_time(turn: swarm.Turn) -> swarm.Task | None:
    """Take what is worth most for each second that it costs."""
    return max(turn.open, key=lambda task: task.value / (turn.completion_s(task) - turn.now_s))


# %% [markdown]
"""In virtual time, by the agents' real code: two rules of our own, and two of the project."""

# %%
mission = swarm.load("table-1")
for policy in (soonest, value_per_time, "greedy", "guided"):
    flight = swarm.simulate(mission, policy)
    name = policy if isinstance(policy, str) else policy.__name__
    print(f"{name:>14}: J {flight.objective:.2f} value·s in {flight.makespan_s:.2f} s")
    for uav, route in flight.routes.items():
        print(f"{'':>16}{uav}: {' '.join(route)}")

# %% [markdown]
"""The same rule plans, too: `swarm.plan(mission, value_per_time)`. One that is to fly real vehicles
is an entry in `swarm/allocation/index_rules.py`, and has a name then (`--method NAME`).
"""
