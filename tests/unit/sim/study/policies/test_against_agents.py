"""The paper's rules in both worlds: with ideal communication agents do what this package says."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coordinator.planner.plan import make_plan
from sim.study.generator import mission_of, random_mission
from sim.study.policies.agents import GREEDY, LOOKAHEAD, AgentsPolicy
from sim.study.policies.dispatchers import RuleDispatcher
from sim.study.policies.situation import Account
from sim.study.policies.team import fly_team
from sim.world.outcome import FlightOutcome
from sim.world.uncertainty import Uncertainty
from swarm.allocation import rule_by_name
from swarm.model import Mission, Plan
from tests.unit.sim.study.policies.play import StillClock

CLOCK = StillClock()
LATER_S = 0.5
"""Agents that were idle may wait for each other's word."""


def visits(flight: FlightOutcome) -> list[tuple[str, str, bool]]:
    return [(visit.uav, visit.task, visit.done) for visit in flight.visits]


@pytest.mark.parametrize("seed", range(1, 3))
@pytest.mark.parametrize("policy", [GREEDY, LOOKAHEAD], ids=lambda policy: policy.name)
@pytest.mark.parametrize(
    ("uncertainty", "reattempt_failed"),
    [
        (Uncertainty(loss=0.4, popup=0.4, outcomes=True), True),
        (Uncertainty(loss=0.2, popup=0.2, outcomes=True, survival=True), False),
        (Uncertainty(withdrawals_per_min=3.0, popups_per_min=3.0), False),
    ],
    ids=["losses", "survival", "withdrawals"],
)
def test_agents_do_the_same(
    uncertainty: Uncertainty, reattempt_failed: bool, policy: AgentsPolicy, seed: int
) -> None:
    problem = random_mission(4, 12, seed, lowest_survival=0.8)
    scenario = replace(mission_of(problem, "both"), reattempt_failed=reattempt_failed)
    fate = uncertainty.draw(scenario, 120.0, seed)
    plan = make_plan(fate.mission, policy.method, clock=CLOCK)

    def planner(mission: Mission, method: str) -> Plan:
        return plan

    by_agents = policy.fly(fate, planner, CLOCK)
    dispatcher = RuleDispatcher(rule_by_name(policy.method), Account(CLOCK))
    as_team = fly_team(fate, dispatcher, sequence=plan.sequence)
    assert visits(as_team) == visits(by_agents)
    ends_s = [visit.completed_s for visit in as_team.visits]
    assert ends_s == pytest.approx([v.completed_s for v in by_agents.visits], abs=LATER_S)
