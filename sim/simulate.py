"""One mission in virtual time, from a scenario and one seed.

Leaves out: the world itself (sim.world) and studies of many missions.
"""

from __future__ import annotations

from coordinator.planner.plan import make_plan
from sim.uncertainty import Uncertainty
from sim.world import Faults, World
from swarm.clock import SystemClock
from swarm.model import Mission, Plan

__all__ = ["simulate_mission"]


def simulate_mission(
    mission: Mission, *, method: str, seed: int, uncertainty: Uncertainty, latency_s: float
) -> World:
    """Fly ``mission`` in virtual time to its end.

    Args:
        mission: the scenario, pop-ups included.
        method: planning method whose rule the agents use.
        seed: of the planner and of all that is uncertain.
        uncertainty: what may go wrong; moments are spread over the time the scenario's plan takes.
        latency_s: delay of every message [virtual s].

    Returns:
        The world after the mission.
    """
    clock = SystemClock()
    made: list[tuple[Mission, Plan]] = []

    def planner(what: Mission, how: str, with_seed: int) -> Plan:
        known = what.known_at_start()
        for earlier, plan in made:
            if earlier == known:
                return plan
        plan = make_plan(known, how, clock=clock, seed=with_seed)
        made.append((known, plan))
        return plan

    span_s = max(planner(mission, method, seed).completion_s.values(), default=0.0)
    fate = uncertainty.draw(mission, span_s, seed)
    faults = Faults(fate.lost_at_s)
    world = World(
        fate.mission, planner, method=method, seed=seed, faults=faults, latency_s=latency_s
    )
    world.run()
    return world
