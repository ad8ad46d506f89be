# %% [markdown]
"""# Plan a mission by three methods, and draw the best plan over the map.

    python -m sim.examples.plan_a_mission

Shows `swarm.load`, `swarm.plan` with a limit in time and a bound, and a picture, which needs the
extra ``ground``.
"""

# %%
from __future__ import annotations

import swarm
from coordinator.plot import plan_figure

# %% [markdown]
"""A mission is a scenario file, or one that ships. `swarm new` writes a file of your own."""

# %%
mission = swarm.load("table-1")
print(f"{mission.name}: {len(mission.uavs)} UAVs, {len(mission.tasks)} tasks")

# %% [markdown]
"""`greedy` and `lookahead` are the rules of the paper, with the best priority sequence; `guided`
optimises the lists themselves. J is what a plan is worth, in value·seconds; beside it stands the
proven optimum, or a number that no plan can exceed.
"""

# %%
plans = [
    swarm.plan(mission, method, seed=1, time_limit_s=10.0)
    for method in ("greedy", "lookahead", "guided")
]
for plan in plans:
    best_known = plan.bound if plan.optimum is None else plan.optimum
    share = "" if best_known is None else f", {plan.objective / best_known:.1%} of {best_known:.2f}"
    print(f"{plan.method:>9}: J {plan.objective:.2f} value·s{share} ({plan.basis})")

# %% [markdown]
"""Every UAV has a list of tasks, in order, and a time for each."""

# %%
best = max(plans, key=lambda plan: plan.objective)
for uav, route in best.routes.items():
    print(f"{uav}: " + ", ".join(f"{task} at {best.completion_s[task]:.2f} s" for task in route))

# %% [markdown]
"""The lists over the map. The figure is matplotlib's: a notebook shows it."""

# %%
figure = plan_figure(mission, best)
figure.savefig("plan.png", dpi=100)
print("drawn: plan.png")
figure
