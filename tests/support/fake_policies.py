"""Policies for tests of studies: cheap, plain, and some that misbehave."""

from __future__ import annotations

import os
from dataclasses import dataclass

from sim.study.policies.roster import Planner, PolicyEntry, PolicyRoster
from sim.world.outcome import FlightOutcome, TaskVisit
from sim.world.uncertainty import Realization
from swarm.runtime.clock import Clock


@dataclass(frozen=True)
class InOrder:
    """One task after the other, each after ``pace_s``, by whichever UAV lives then."""

    pace_s: float = 10.0
    name: str = "in-order"
    what: str = "tasks in their order"

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        visits: list[TaskVisit] = []
        for number, task in enumerate(fate.mission.tasks, start=1):
            when_s = max(number * self.pace_s, task.appears_s)
            alive = [u for u in fate.mission.uavs if fate.lost_at_s.get(u.id, 1e9) > when_s]
            if alive:
                uav = alive[number % len(alive)]
                done = fate.succeeds(uav, task, 1)
                visits.append(TaskVisit(uav.id, task.id, when_s, done))
        began_s = clock.now_s()
        decision_s = (clock.now_s() - began_s,) if visits else ()
        return FlightOutcome(tuple(visits), tuple(fate.lost_at_s), decision_s=decision_s)


class ByPlan(InOrder):
    """Asks for an offline plan and does as it likes."""

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        assert plan(fate.mission, "greedy") is plan(fate.mission, "greedy")
        return super().fly(fate, plan, clock)


class Deadly(InOrder):
    """Ends its process."""

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        os._exit(3)


class Interrupted(InOrder):
    """Is interrupted in its third mission."""

    flown = 0

    def fly(self, fate: Realization, plan: Planner, clock: Clock) -> FlightOutcome:
        Interrupted.flown += 1
        if Interrupted.flown == 3:
            raise KeyboardInterrupt
        return super().fly(fate, plan, clock)


class Everything:
    """More than anybody can reach."""

    name = "clairvoyant"
    what = "everything at once"

    def value(self, fate: Realization) -> float:
        return sum(task.value for task in fate.mission.tasks) * fate.mission.horizon_s


_HERE = "tests.support.fake_policies"
FAKES = PolicyRoster(
    policies={
        "in-order": PolicyEntry(_HERE, "InOrder", parameter="a pace [s]"),
        "same": PolicyEntry(_HERE, "InOrder"),
        "by-plan": PolicyEntry(_HERE, "ByPlan", ideal=True),
        "deadly": PolicyEntry(_HERE, "Deadly"),
        "interrupted": PolicyEntry(_HERE, "Interrupted"),
    },
    bound=PolicyEntry(_HERE, "Everything"),
)
