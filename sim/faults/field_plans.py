"""Quick plans of missions in the field: greedy lists of a random sequence, as good as any here."""

from __future__ import annotations

from sim.world.engine import stream
from swarm.allocation.field import FieldProblem, FieldState
from swarm.kernels.field import FIELD_GREEDY, fly_lists, run_rule
from swarm.model import Mission, Plan


def quick_field_plan(mission: Mission, method: str, seed: int) -> Plan:
    """Greedy lists, whatever ``method`` the agents are told to decide by."""
    problem = FieldProblem.from_mission(mission.known_at_start())
    sequence = stream(seed, "sequence").permutation(problem.n_uav).tolist()
    team = FieldState.at_start(problem, sequence)
    lists = run_rule(problem.kernel, team, FIELD_GREEDY).lists(problem.n_uav)
    flown = fly_lists(problem.kernel, team, lists)
    items = [item for each in lists for item in each]
    ends_s = flown.times_s[:, 3].tolist()
    return Plan(
        scenario=mission.name,
        method=method,
        routes={
            uav: tuple(problem.task_ids[item >> 1] for item in each if item >= 0)
            for uav, each in zip(problem.uav_ids, lists, strict=True)
        },
        objective=float(flown.value.sum()),
        completion_s={
            problem.task_ids[item >> 1]: end_s
            for item, end_s in zip(items, ends_s, strict=True)
            if item >= 0
        },
        sequence=tuple(problem.uav_ids[uav] for uav in sequence),
        optimum=None,
        evaluations=1,
        elapsed_s=0.0,
        seed=seed,
    )
