"""One mission in virtual time, from a scenario and one seed.

Leaves out: the world itself (sim.fated_world) and studies of many missions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from coordinator.observer import MissionResult
from coordinator.planner.plan import make_plan
from sim.fated_world import FatedWorld, OnlookerMaker
from sim.study.flight import value_of
from sim.study.tally import Tally
from sim.uncertainty import Uncertainty
from sim.world import World
from swarm.clock import SystemClock
from swarm.model import Mission, Plan, UavId

__all__ = ["SimulatedMission", "simulate_mission"]


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedMission:
    """A mission that is over."""

    world: World
    result: MissionResult
    """What was executed; the lost are those that really were."""
    lost_because: dict[UavId, str]
    """When and why, in the order of the losses."""
    value: float
    """Of what was flown: where outcomes are drawn only success counts [value·s]."""
    in_time: bool
    """Whether it ended by itself; else somebody would have waited for ever."""


def simulate_mission(
    mission: Mission,
    *,
    method: str,
    seed: int,
    uncertainty: Uncertainty,
    coordinator_lost_s: float | None = None,
    make_onlooker: OnlookerMaker | None = None,
) -> SimulatedMission:
    """Fly ``mission`` in virtual time to its end.

    Args:
        mission: the scenario, pop-ups included.
        method: planning method whose rule the agents use.
        seed: of the planner and of all that is uncertain.
        uncertainty: what may go wrong; moments are spread over the time the scenario's plan takes.
        coordinator_lost_s: mission time at which the coordinator dies [s]; None if it lives.
        make_onlooker: makes the core that looks on, as for a recording; nothing that is flown
            depends on it.
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
    tally = Tally()
    flown = FatedWorld(
        fate,
        planner,
        method=method,
        seed=seed,
        coordinator_lost_s=coordinator_lost_s,
        watch=tally,
        make_onlooker=make_onlooker,
    )
    in_time = flown.run()
    return SimulatedMission(
        world=flown.world,
        result=replace(flown.world.observer.result(), lost_uavs=tuple(flown.lost)),
        lost_because=dict(flown.lost),
        value=value_of(fate, tally.visits),
        in_time=in_time,
    )
