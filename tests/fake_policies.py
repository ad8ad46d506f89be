"""Policies for tests of studies: cheap, plain, and some that misbehave."""

from __future__ import annotations

import os
from dataclasses import dataclass

from sim.fate import Fate
from sim.study.flight import Flight, Visit
from sim.study.policies import Entry, Roster
from sim.study.policy import Planner
from swarm.clock import Clock


@dataclass(frozen=True)
class InOrder:
    """One task after the other, each after ``pace_s``, by whichever UAV lives then."""

    pace_s: float = 10.0
    name: str = "in-order"
    what: str = "tasks in their order"

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        visits: list[Visit] = []
        for number, task in enumerate(fate.mission.tasks, start=1):
            when_s = max(number * self.pace_s, task.appears_s)
            alive = [u for u in fate.mission.uavs if fate.lost_at_s.get(u.id, 1e9) > when_s]
            if alive:
                uav = alive[number % len(alive)]
                done = fate.succeeds(uav, task, 1)
                visits.append(Visit(uav.id, task.id, when_s, done))
        began_s = clock.now_s()
        decision_s = (clock.now_s() - began_s,) if visits else ()
        return Flight(tuple(visits), tuple(fate.lost_at_s), decision_s=decision_s)


class ByPlan(InOrder):
    """Asks for an offline plan and does as it likes."""

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        assert plan(fate.mission, "greedy") is plan(fate.mission, "greedy")
        return super().fly(fate, plan, clock)


class Deadly(InOrder):
    """Ends its process."""

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        os._exit(3)


class Interrupted(InOrder):
    """Is interrupted in its third mission."""

    flown = 0

    def fly(self, fate: Fate, plan: Planner, clock: Clock) -> Flight:
        Interrupted.flown += 1
        if Interrupted.flown == 3:
            raise KeyboardInterrupt
        return super().fly(fate, plan, clock)


class Everything:
    """More than anybody can reach."""

    name = "clairvoyant"
    what = "everything at once"

    def value(self, fate: Fate, plan: Planner) -> float:
        return sum(task.value for task in fate.mission.tasks) * fate.mission.horizon_s


_HERE = "tests.fake_policies"
FAKES = Roster(
    policies={
        "in-order": Entry(_HERE, "InOrder", parameter="a pace [s]"),
        "same": Entry(_HERE, "InOrder"),
        "by-plan": Entry(_HERE, "ByPlan", ideal=True),
        "deadly": Entry(_HERE, "Deadly"),
        "interrupted": Entry(_HERE, "Interrupted"),
    },
    bound=Entry(_HERE, "Everything"),
)
