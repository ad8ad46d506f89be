"""One mission as it was flown, whoever decided: what studies count and value.

Leaves out: who decides (sim.study.policy) and statistics over many missions.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from sim.fate import Fate
from swarm.model import TaskId, UavId

__all__ = ["Flight", "Score", "Visit", "score", "value_of"]


@dataclass(frozen=True, slots=True)
class Visit:
    """One attempt at a task that was flown to its end."""

    uav: UavId
    task: TaskId
    completed_s: float
    """Mission time [s]."""
    done: bool
    """Whether the attempt succeeded."""


@dataclass(frozen=True, slots=True)
class Flight:
    """What a policy made of a fate."""

    visits: tuple[Visit, ...]
    """In the order in which they ended."""
    lost_uavs: tuple[UavId, ...] = ()
    """In the order in which they were lost."""
    epochs: int = 1
    """Plans in force, one after the other; 0 for a policy that plans nothing."""
    moved: int = 0
    """Tasks that re-planning moved from one UAV's list to another's, summed over all plans."""
    released: int = 0
    """Tasks given up by a living UAV that was on its way there."""
    messages: int = 0
    """Sent by all processes; 0 where none are modelled."""
    decision_s: tuple[float, ...] = ()
    """Wall time of each decision or plan [s]; the one thing that differs from run to run."""


@dataclass(frozen=True, slots=True)
class Score:
    """What a flight comes to."""

    value: float
    """See `value_of` [value·s]."""
    done: int
    failed: int
    """Tasks attempted, never with success."""
    missed: int
    """Tasks that appeared, were not withdrawn in time, and were never attempted."""
    duplicate_visits: int
    """Visits to a task that had been done before."""
    makespan_s: float
    """Latest end of a visit [s mission time]."""
    lost_uavs: int


def value_of(fate: Fate, visits: Iterable[Visit]) -> float:
    """What the visits are worth [value·s].

    Where outcomes are drawn a task is worth m·(D − t) at the first visit that succeeds. Otherwise
    the first visit to it is worth p·S·m·(D − t), eq. 1; S is left out where survival is drawn,
    since then UAVs that do not survive make no more visits. A task is worth nothing once it is
    withdrawn, also to those who have not heard of it.
    """
    mission = fate.mission
    uavs = {uav.id: uav for uav in mission.uavs}
    tasks = {task.id: task for task in mission.tasks}
    survived = dict.fromkeys(uavs, 1.0)
    counted: set[TaskId] = set()
    value = 0.0
    for visit in visits:
        uav, task = uavs[visit.uav], tasks[visit.task]
        wanted = visit.completed_s <= fate.withdrawn_at_s.get(visit.task, math.inf)
        if visit.done and wanted and visit.task not in counted:
            counted.add(visit.task)
            weight = 1.0 if fate.uncertainty.outcomes else mission.success(uav, task)
            if not fate.uncertainty.survival:
                weight *= survived[visit.uav]
            value += weight * task.value * (mission.horizon_s - visit.completed_s)
        survived[visit.uav] *= mission.survival(uav, task)
    return value


def score(fate: Fate, flight: Flight) -> Score:
    """Count and value what was flown."""
    done: Counter[TaskId] = Counter()
    tried: set[TaskId] = set()
    duplicates = 0
    for visit in flight.visits:
        tried.add(visit.task)
        duplicates += done[visit.task] > 0
        done[visit.task] += visit.done
    succeeded = {task for task, times in done.items() if times}
    there = {
        task.id
        for task in fate.mission.tasks
        if fate.withdrawn_at_s.get(task.id, math.inf) > task.appears_s
    }
    return Score(
        value=value_of(fate, flight.visits),
        done=len(succeeded),
        failed=len(tried - succeeded),
        missed=len(there - tried - set(fate.withdrawn_at_s)),
        duplicate_visits=duplicates,
        makespan_s=max((visit.completed_s for visit in flight.visits), default=0.0),
        lost_uavs=len(flight.lost_uavs),
    )
