"""One trial: every policy of a study on the same drawn future.

Rows depend on the study alone, wall times apart, whoever flies the trial and in whatever order.
Leaves out: which trials there are to fly, and where (sim.study.runner).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

from coordinator.planner.plan import make_plan
from sim.study.config import Study, fate_seed, span_s
from sim.study.flight import score
from sim.study.policies import Roster
from sim.study.rows import BOUND, Row, row_of
from swarm.clock import Clock
from swarm.model import Mission, Plan

__all__ = ["Briefing", "Job", "TrialRunner", "jobs_of", "rows_due"]

_PLANS_KEPT = 16


class Job(NamedTuple):
    """One drawn future, met by every policy."""

    trial: int
    world: int
    """Index of the first point with that setting."""


@dataclass(frozen=True, slots=True)
class Briefing:
    """All that whoever flies trials has to know."""

    study: Study
    roster: Roster


def jobs_of(study: Study) -> list[Job]:
    """Everything there is to fly, trial by trial, so that all points grow alike."""
    trials: dict[int, int] = {}
    for point in study.points():
        trials[point.world] = max(trials.get(point.world, 0), point.trials)
    return sorted(Job(k, world) for world, count in trials.items() for k in range(count))


def rows_due(study: Study) -> dict[Job, set[tuple[int, int, str]]]:
    """Keys of the rows that each job has to bring."""
    names = (*study.policies, BOUND) if study.bound else study.policies
    due: dict[Job, set[tuple[int, int, str]]] = {job: set() for job in jobs_of(study)}
    for point in study.points():
        for trial in range(point.trials):
            keys = ((point.index, trial, name) for name in names)
            due[Job(trial, point.world)].update(keys)
    return due


class TrialRunner:
    """Flies trials of one study, one after the other.

    Args:
        briefing: the study, and where its policies come from.
        clock: times decisions.
    """

    def __init__(self, briefing: Briefing, clock: Clock) -> None:
        study = briefing.study
        self._study = study
        self._clock = clock
        self._points = study.points()
        self._policies = [(name, briefing.roster.policy(name)) for name in study.policies]
        self._bound = briefing.roster.make_bound() if study.bound else None
        self._plans: deque[tuple[Mission, str, Plan]] = deque(maxlen=_PLANS_KEPT)

    def fly(self, job: Job) -> list[Row]:
        """The rows of one job, at every point that it stands for."""
        mission = self._study.mission(job.trial)
        world = self._points[job.world]
        seed = fate_seed(self._study.seed, job.trial)
        fate = world.uncertainty.draw(mission, span_s(mission), seed)
        rows: list[Row] = []
        for name, policy in self._policies:
            flight = policy.fly(fate, self._plan, self._clock)
            row = row_of(world, job.trial, name, score(fate, flight), flight)
            rows.append(row)
        if self._bound is not None:
            value = self._bound.value(fate, self._plan)
            rows.append(Row(world.index, world.vary, world.at, job.trial, BOUND, value))
        return list(self._at_all_points(rows, job))

    def _at_all_points(self, rows: Iterable[Row], job: Job) -> Iterable[Row]:
        points = [p for p in self._points if p.world == job.world and job.trial < p.trials]
        for row in rows:
            for point in points:
                yield replace(row, point=point.index, vary=point.vary, at=point.at)

    def _plan(self, mission: Mission, method: str) -> Plan:
        """Plans are the same for whoever asks, and in trials whose missions begin alike."""
        known = mission.known_at_start()
        for earlier, by, plan in self._plans:
            if by == method and earlier == known:
                return plan
        plan = make_plan(known, method, clock=self._clock, seed=self._study.seed, threads=1)
        self._plans.append((known, method, plan))
        return plan
