"""One trial: every policy of a study on the same drawn future, and the rows that come of it.

Rows depend on the study alone, wall times apart, whoever flies the trial and in whatever order.
"""

from __future__ import annotations

from collections import deque
from dataclasses import asdict, dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from coordinator.planner.plan import make_plan
from sim.study.design import DesignPoint, Study, fate_seed, span_s
from sim.study.policies.roster import PolicyRoster
from sim.world.outcome import FlightOutcome, Score, score
from swarm.model import Mission, Plan
from swarm.runtime.clock import Clock

BOUND = "clairvoyant"
"""In place of a policy's name in rows of the bound, which have a value and nothing else."""


@dataclass(frozen=True, slots=True)
class TrialRow:
    """What one policy made of one realization. What a bound does not have is None."""

    point: int
    """Which setting of the uncertainty: 0 for the study's own, then those that it varies to."""
    vary: str
    """The number that is varied there, such as ``loss``; empty for the study's own setting."""
    at: float | None
    """And its value; None for the study's own setting."""
    trial: int
    """From 0. Rows of one point and trial met the same realization."""
    policy: str
    value: float
    """See sim.world.outcome.value_of [value·s]."""
    done: int | None = None
    failed: int | None = None
    missed: int | None = None
    duplicate_visits: int | None = None
    makespan_s: float | None = None
    """Latest end of a visit [s mission time]."""
    lost_uavs: int | None = None
    epochs: int | None = None
    moved: int | None = None
    """Tasks that re-planning moved from one UAV's list to another's, summed over all plans."""
    released: int | None = None
    """Tasks given up by a living UAV that was on its way there."""
    messages: int | None = None
    decisions: int | None = None
    """How many were made and timed."""
    decision_median_wall_s: float | None = None
    """None where nothing was decided; the wall times alone differ from run to run [s]."""
    decision_p99_wall_s: float | None = None
    decision_max_wall_s: float | None = None
    required_left: int | None = None
    """In the field: tasks without due time that appeared, were not withdrawn, and were not done."""
    breaches: int | None = None
    """In the field: what vehicles truly did against energy, zones, windows and slots."""

    @property
    def key(self) -> tuple[int, int, str]:
        """Which row of a study it is."""
        return self.point, self.trial, self.policy


FIELD_COLUMNS = ("required_left", "breaches")
"""Of studies in the field alone."""
COLUMNS = tuple(field.name for field in fields(TrialRow) if field.name not in FIELD_COLUMNS)


def columns_of(study: Study) -> tuple[str, ...]:
    """What the rows of a study have."""
    return (*COLUMNS, *FIELD_COLUMNS) if study.in_field else COLUMNS


def row_of(
    point: DesignPoint, trial: int, policy: str, scored: Score, flight: FlightOutcome
) -> TrialRow:
    """The row of a flight."""
    wall_s = np.asarray(flight.decision_s, dtype=float)
    some = wall_s.size > 0
    return TrialRow(
        point=point.index,
        vary=point.vary,
        at=point.at,
        trial=trial,
        policy=policy,
        **asdict(scored),
        required_left=flight.required_left,
        breaches=flight.breaches,
        epochs=flight.epochs,
        moved=flight.moved,
        released=flight.released,
        messages=flight.messages,
        decisions=int(wall_s.size),
        decision_median_wall_s=float(np.median(wall_s)) if some else None,
        decision_p99_wall_s=float(np.quantile(wall_s, 0.99)) if some else None,
        decision_max_wall_s=float(wall_s.max()) if some else None,
    )


_PLANS_KEPT = 16


class TrialJob(NamedTuple):
    """One drawn future, met by every policy."""

    trial: int
    world: int
    """Index of the first point with that setting."""


@dataclass(frozen=True, slots=True)
class TrialContext:
    """All that whoever flies trials has to know."""

    study: Study
    roster: PolicyRoster


def jobs_of(study: Study) -> list[TrialJob]:
    """Everything there is to fly, trial by trial, so that all points grow alike."""
    trials: dict[int, int] = {}
    for point in study.points():
        trials[point.world] = max(trials.get(point.world, 0), point.trials)
    return sorted(TrialJob(k, world) for world, count in trials.items() for k in range(count))


def rows_due(study: Study) -> dict[TrialJob, set[tuple[int, int, str]]]:
    """Keys of the rows that each job has to bring."""
    names = (*study.policies, BOUND) if study.bound else study.policies
    due: dict[TrialJob, set[tuple[int, int, str]]] = {job: set() for job in jobs_of(study)}
    for point in study.points():
        for trial in range(point.trials):
            keys = ((point.index, trial, name) for name in names)
            due[TrialJob(trial, point.world)].update(keys)
    return due


class TrialRunner:
    """Flies trials of one study, one after the other; the clock times decisions."""

    def __init__(self, briefing: TrialContext, clock: Clock) -> None:
        study = briefing.study
        self._study = study
        self._clock = clock
        self._points = study.points()
        roster = briefing.roster
        self._policies = [(name, roster.policy(name)) for name in study.policies]
        self._in_field = (
            [(name, roster.policy(name, in_field=True)) for name in study.policies]
            if study.in_field
            else []
        )
        self._bound = briefing.roster.make_bound() if study.bound else None
        self._plans: deque[tuple[Mission, str, Plan]] = deque(maxlen=_PLANS_KEPT)

    def fly(self, job: TrialJob) -> list[TrialRow]:
        """The rows of one job, at every point that it stands for."""
        world = self._points[job.world]
        mission = self._study.mission(job.trial, world.missions)
        seed = fate_seed(self._study.seed, job.trial)
        fate = world.uncertainty.draw(mission, span_s(mission), seed)
        rows: list[TrialRow] = []
        for name, policy in self._in_field if not mission.is_plain else self._policies:
            flight = policy.fly(fate, self._plan, self._clock)
            row = row_of(world, job.trial, name, score(fate, flight), flight)
            rows.append(row)
        if self._bound is not None:
            value = self._bound.value(fate)
            rows.append(TrialRow(world.index, world.vary, world.at, job.trial, BOUND, value))
        points = [p for p in self._points if p.world == job.world and job.trial < p.trials]
        return [
            replace(row, point=point.index, vary=point.vary, at=point.at)
            for row in rows
            for point in points
        ]

    def _plan(self, mission: Mission, method: str) -> Plan:
        """Plans are the same for whoever asks, and in trials whose missions begin alike."""
        known = mission.known_at_start()
        for earlier, by, plan in self._plans:
            if by == method and earlier == known:
                return plan
        plan = make_plan(known, method, clock=self._clock, seed=self._study.seed, threads=1)
        self._plans.append((known, method, plan))
        return plan
