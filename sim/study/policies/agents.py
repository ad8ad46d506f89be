"""Policies in which the real agents decide for themselves, each by its rule, in virtual time.

The coordinator plans once, before the mission; under `guided` it lives on and plans anew, under the
others it dies as the mission begins, and tasks that appear or are withdrawn come from an operator's
seat. A UAV that has set out for a task is diverted by nobody's plan. Decisions are timed as whole
steps of an agent in which it decided.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from typing import Any

from agent.core.agent_core import AgentCore
from agent.core.field_decision import FieldRuleMaker, field_rule_of
from agent.core.interface import Action, Event
from sim.faults.field_judge import FieldJudge
from sim.study.policies.roster import Planner
from sim.world.outcome import FlightOutcome, TaskVisit
from sim.world.stochastic_world import StochasticWorld
from sim.world.uncertainty import Realization
from swarm.model import Mission, Plan
from swarm.protocol.events import LogLine
from swarm.runtime.clock import Clock

_CLEARS_SLOTS_S = 30.0
"""Until who is lost on a slot of a base has been carried away."""


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
        lost_s = self.coordinator_lost_s
        return fly_agents(fate, plan, clock, method=self.method, coordinator_lost_s=lost_s)


def fly_agents(
    fate: Realization,
    plan: Planner,
    clock: Clock,
    *,
    method: str,
    coordinator_lost_s: float | None,
    make_rule: FieldRuleMaker = field_rule_of,
) -> FlightOutcome:
    """Fly a mission to its end with the real agents.

    Args:
        fate: what happens.
        plan: makes the offline plan, by method.
        clock: times decisions.
        method: of that plan.
        coordinator_lost_s: mission time at which the coordinator dies [s]; None if it lives.
        make_rule: what agents decide by in the field.
    """

    def make_plan(mission: Mission, method: str, seed: int) -> Plan:
        del seed  # the planner has its own
        return plan(mission, method)

    taken_s: list[float] = []
    flown = StochasticWorld(
        fate,
        make_plan,
        method=method,
        seed=fate.seed,
        coordinator_lost_s=coordinator_lost_s,
        clears_slots_s=_CLEARS_SLOTS_S,
        make_agent=partial(_TimedAgent, clock=clock, taken_s=taken_s, make_field_rule=make_rule),
    )
    flown.run()
    tally = flown.tally
    in_field = not fate.mission.is_plain
    return FlightOutcome(
        visits=tuple(tally.visits),
        lost_uavs=tuple(flown.lost),
        epochs=tally.epochs,
        moved=tally.moved,
        released=tally.released,
        messages=tally.messages,
        decision_s=tuple(taken_s),
        required_left=_required_left(fate, tally.visits) if in_field else None,
        breaches=len(FieldJudge(flown.world).complaints()) if in_field else None,
    )


def _required_left(fate: Realization, visits: Collection[TaskVisit]) -> int:
    """Tasks without due time that were there to the end and were not done."""
    done = {visit.task for visit in visits if visit.done}
    gone = fate.withdrawn_at_s
    return sum(
        task.due_s is None and task.id not in done and task.id not in gone
        for task in fate.mission.tasks
    )


GREEDY = AgentsPolicy("greedy", "the paper's greedy rule, best sequence, no coordinator", "greedy")
LOOKAHEAD = AgentsPolicy(
    "lookahead", "the paper's lookahead rule, best sequence, no coordinator", "lookahead"
)
GUIDED_ALONE = AgentsPolicy("guided-alone", "guided agents, coordinator dead", "guided")
GUIDED = AgentsPolicy("guided", "guided agents, coordinator plans anew", "guided", None)
