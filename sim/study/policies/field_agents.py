"""Policies for missions in the field: the real agents, following lists or a rule made elsewhere.

Everybody flies the same vehicles by the same evaluator, visits bases through the same slots, and
knows the same; see `sim.study.policies.field_captains`. The coordinator plans once and dies as the
mission begins, as under `guided-alone`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from agent.core.field_decision import FieldRule
from sim.study.policies.agents import fly_agents
from sim.study.policies.field_captains import (
    AuctionCaptain,
    Captain,
    CentralCaptain,
    FrozenCaptain,
)
from sim.study.policies.roster import Planner
from sim.world.outcome import FlightOutcome
from sim.world.uncertainty import Realization
from swarm.runtime.clock import Clock

_PLANNED_BY = "guided"
"""Method of the offline plan, which gives the sequence to all."""


@dataclass(frozen=True, slots=True)
class CaptainPolicy:
    """All agents of a flight follow the lists of one captain."""

    name: str
    what: str
    make: Callable[[int], Captain]
    """Makes one from a seed."""

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        """Fly a mission to its end; see `sim.study.policies.roster.Policy`."""
        captain = self.make(fate.seed)
        flight = fly_agents(
            fate, plan, clock, method=_PLANNED_BY, coordinator_lost_s=0.0, make_rule=captain.rule
        )
        return replace(flight, epochs=captain.epochs, moved=captain.moved)


@dataclass(frozen=True, slots=True)
class IndexPolicy:
    """Every UAV that is free takes the task with the largest index."""

    name: str
    what: str

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        """Fly a mission to its end; see `sim.study.policies.roster.Policy`."""

        def rule(_name: str, routes: Mapping[str, Sequence[str]]) -> FieldRule:
            return FieldRule(self.name, routes)

        flight = fly_agents(
            fate, plan, clock, method=_PLANNED_BY, coordinator_lost_s=0.0, make_rule=rule
        )
        return replace(flight, epochs=0)


NEAREST = IndexPolicy("nearest", "every free UAV takes the task that it can begin soonest")
VALUE_PER_TIME = IndexPolicy(
    "value-per-time", "every free UAV takes the task worth most per time until its end"
)
FROZEN = CaptainPolicy(
    "frozen", "the best offline plan, never changed; gaps by value per time", FrozenCaptain
)
CBBA = CaptainPolicy(
    "cbba",
    "consensus-based bundle algorithm with windows and energy, re-bidding at every event",
    AuctionCaptain,
)
CENTRAL = CaptainPolicy(
    "central", "central re-optimisation whenever anybody is to decide", CentralCaptain
)
