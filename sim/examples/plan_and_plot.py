"""Plan a mission by three methods, compare them, and draw the best plan over the map.

    python -m sim.examples.plan_and_plot [SCENARIO [FILE.png]]

Shows `swarm.load`, `swarm.plan` with a limit in time and a bound, and a picture (which needs the
extra ``ground``); leave FILE out for the table alone.
"""

from __future__ import annotations

import sys
from pathlib import Path

import swarm


def main(scenario: str = "table-1", picture: str | None = None) -> None:
    """Print a line for each method; draw the plan with the largest J."""
    mission = swarm.load(scenario)
    print(f"{mission.name}: {len(mission.uavs)} UAVs, {len(mission.tasks)} tasks")
    plans = [
        swarm.plan(mission, method, seed=1, time_limit_s=10.0)
        for method in ("greedy", "lookahead", "guided")
    ]
    for plan in plans:
        best = plan.bound if plan.optimum is None else plan.optimum
        share = "" if best is None else f", {plan.objective / best:.1%} of {best:.2f}"
        print(f"{plan.method:>9}: J {plan.objective:.2f} value·s{share} ({plan.basis})")
    if picture is not None:
        from coordinator.plot import draw_plan

        draw_plan(mission, max(plans, key=lambda plan: plan.objective), Path(picture))
        print(f"drawn: {picture}")


if __name__ == "__main__":
    main(*sys.argv[1:3])
