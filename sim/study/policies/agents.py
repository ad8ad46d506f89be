"""Policies in which the real agents decide for themselves, each by its rule, in virtual time.

The coordinator plans once, before the mission; under `guided` it lives on and plans anew, under the
others it dies as the mission begins, and tasks that appear or are withdrawn come from an operator's
seat. A UAV that has set out for a task is diverted by nobody's plan. Decisions are timed as whole
steps of an agent in which it decided.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

from agent.core.agent_core import AgentCore
from agent.core.interface import Action, Event
from sim.study.policies.roster import Planner
from sim.world.outcome import FlightOutcome
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Realization
from swarm.model import Mission, Plan
from swarm.protocol.events import LogLine
from swarm.runtime.clock import Clock


class _TimedAgent(AgentCore):
    """An agent that notes how long it takes to decide."""

    def __init__(self, *args: Any, clock: Clock, taken_s: list[float], **settings: Any) -> None:
        super().__init__(*args, **settings)
        self._clock = clock
        self._taken_s = taken_s

    def step(self, event: Event, now_s: float) -> list[Action]:
        """React to one event."""
        began_s = self._clock.now_s()
        actions = super().step(event, now_s)
        if actions and any(
            isinstance(action, LogLine) and action.text == "decided" for action in actions
        ):
            self._taken_s.append(self._clock.now_s() - began_s)
        return actions


@dataclass(frozen=True, slots=True)
class AgentsPolicy:
    """Agents that decide by one rule, with or without a coordinator."""

    name: str
    what: str
    method: str
    """Planning method, whose rule the agents decide by."""
    coordinator_lost_s: float | None = 0.0
    """Mission time at which the coordinator dies [s]; None if it lives."""

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        """Fly a mission to its end; see `sim.study.policies.roster.Policy`."""

        def make_plan(mission: Mission, method: str, seed: int) -> Plan:
            del seed  # the planner has its own
            return plan(mission, method)

        taken_s: list[float] = []
        flown = StochasticWorld(
            fate,
            make_plan,
            method=self.method,
            seed=fate.seed,
            coordinator_lost_s=self.coordinator_lost_s,
            make_agent=partial(_TimedAgent, clock=clock, taken_s=taken_s),
        )
        flown.run()
        tally = flown.tally
        return FlightOutcome(
            visits=tuple(tally.visits),
            lost_uavs=tuple(flown.lost),
            epochs=tally.epochs,
            moved=tally.moved,
            released=tally.released,
            messages=tally.messages,
            decision_s=tuple(taken_s),
        )


GREEDY = AgentsPolicy("greedy", "the paper's greedy rule, best sequence, no coordinator", "greedy")
LOOKAHEAD = AgentsPolicy(
    "lookahead", "the paper's lookahead rule, best sequence, no coordinator", "lookahead"
)
GUIDED_ALONE = AgentsPolicy("guided-alone", "guided agents, coordinator dead", "guided")
GUIDED = AgentsPolicy("guided", "guided agents, coordinator plans anew", "guided", None)
