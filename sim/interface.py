"""What ``import swarm`` offers of this package: flying a mission in virtual time.

Found by an entry point (swarm.interface, which documents it).
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Unpack

from agent.core.agent_core import AgentCore
from coordinator.interface import flight_of
from coordinator.planner.plan import ONLINE_METHODS, make_plan
from sim.world.simulation import plan_once, recording_simulation, simulate_mission
from sim.world.uncertainty import Uncertainty
from swarm.allocation import Rule
from swarm.allocation.own_rule import DecisionRule, FunctionRule
from swarm.interface import Flight, UncertaintyOptions
from swarm.model import Mission, Plan
from swarm.runtime.clock import SystemClock
from swarm.runtime.errors import remedy_for_name


def simulate(
    mission: Mission,
    policy: str | Plan | DecisionRule = "guided",
    *,
    seed: int = 0,
    coordinator_lost_s: float | None = None,
    record: str | os.PathLike[str] | None = None,
    **uncertainty: Unpack[UncertaintyOptions],
) -> Flight:
    """Fly a mission in virtual time; see `swarm.interface.simulate`."""
    if seed < 0:
        raise ValueError(f"seed must be >= 0, not {seed}")
    if coordinator_lost_s is not None and not 0.0 <= coordinator_lost_s < math.inf:
        raise ValueError(f"coordinator_lost_s must be >= 0 and finite, not {coordinator_lost_s}")
    what = _uncertainty(mission, uncertainty)
    make_agent: Callable[..., AgentCore] = AgentCore
    made = [(mission, policy)] if isinstance(policy, Plan) else []
    by: Rule | None = None
    if isinstance(policy, str | Plan):
        method = _method(mission, policy)
    else:
        by = FunctionRule.of(policy, mission)
        # What is published is the paper's simplest rule, but nobody asks it: all have this one.
        method, coordinator_lost_s = "greedy", 0.0
        make_agent = partial(AgentCore, make_rule=partial(_whatever_is_published, by))

    def planner(known: Mission, method: str, planner_seed: int) -> Plan:
        wanted = method if by is None else by
        return make_plan(known, wanted, clock=SystemClock(), seed=planner_seed)

    path = None if record is None else Path(record)
    if path is not None:
        from coordinator.recording.options import check_new_recording

        check_new_recording(path)
    with recording_simulation(mission.name, mission.name, path) as looks_on:
        flown = simulate_mission(
            mission,
            method=method,
            seed=seed,
            uncertainty=what,
            coordinator_lost_s=coordinator_lost_s,
            make_observer=looks_on,
            make_agent=make_agent,
            planner=plan_once(planner, made),
        )
        return flight_of(
            flown.world.mission_state,
            flown.result,
            value=flown.value,
            mission=flown.world.mission,
            cut_short=None if flown.in_time else "broken off: somebody would have waited for ever",
        )


def _whatever_is_published(rule: Rule, name: str, routes: Mapping[str, Sequence[str]]) -> Rule:
    del name, routes
    return rule


def _method(mission: Mission, policy: str | Plan) -> str:
    """By which the fleet is to fly."""
    if isinstance(policy, str):
        if policy not in ONLINE_METHODS:
            remedy = remedy_for_name(policy, ONLINE_METHODS)
            raise ValueError(f"no fleet can fly by {policy!r}; {remedy}")
        return policy
    known = mission.known_at_start()
    uavs, tasks = {uav.id for uav in known.uavs}, {task.id for task in known.tasks}
    listed = {task for route in policy.routes.values() for task in route}
    if policy.scenario != mission.name or set(policy.routes) != uavs or not listed <= tasks:
        raise ValueError(f"the plan is for another mission than {mission.name}")
    if policy.method not in ONLINE_METHODS:
        remedy = f"plan by {', '.join(ONLINE_METHODS)}, or give the rule itself"
        raise ValueError(f"no fleet can fly by a plan of {policy.method!r}; {remedy}")
    return policy.method


def _uncertainty(mission: Mission, options: UncertaintyOptions) -> Uncertainty:
    """What was asked for, checked against the mission."""
    known = [item.name for item in fields(Uncertainty)]
    for name in options:
        if name not in known:
            raise ValueError(f"no such uncertainty {name!r}; {remedy_for_name(name, known)}")
    what = Uncertainty(**options)
    uavs, tasks = {uav.id for uav in mission.uavs}, {task.id for task in mission.tasks}
    for kind, ids, there in (
        ("UAV", set[str](what.lost_at_s), set[str](uavs)),
        ("task", set[str](what.withdrawn_at_s), set[str](tasks)),
    ):
        if unknown := sorted(ids - there):
            raise ValueError(f"no such {kind} in {mission.name}: {', '.join(unknown)}")
    return what
