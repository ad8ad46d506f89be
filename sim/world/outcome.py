"""What a fleet made of a mission: the visits it flew, and what they are worth.

Visits come from a policy, or are counted from what the processes of a virtual world say.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from sim.world.engine import Process
from sim.world.uncertainty import Realization
from swarm.model import TaskId, UavId
from swarm.model.ids import COORDINATOR
from swarm.protocol.events import LogLine
from swarm.protocol.messages import Message, MissionPhase, PlanEpoch, TaskEdit, TaskEntry
from swarm.protocol.uav_messages import AttemptResult, Choice, Claim, Outcome


@dataclass(frozen=True, slots=True)
class TaskVisit:
    """One attempt at a task that was flown to its end."""

    uav: UavId
    task: TaskId
    completed_s: float
    """Mission time [s]."""
    done: bool
    """Whether the attempt succeeded."""


@dataclass(frozen=True, slots=True)
class FlightOutcome:
    """What a policy made of a realization."""

    visits: tuple[TaskVisit, ...]
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
    required_left: int | None = None
    """Tasks without due time that were there and not done; None where no constraints count."""
    breaches: int | None = None
    """What vehicles did against the field's constraints; None where none count."""


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


def value_of(fate: Realization, visits: Iterable[TaskVisit]) -> float:
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
            until_s = mission.horizon_s if task.due_s is None else task.due_s
            value += weight * task.value * (until_s - visit.completed_s)
        survived[visit.uav] *= mission.survival(uav, task)
    return value


def score(fate: Realization, flight: FlightOutcome) -> Score:
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


class Tally:
    """Counts what is flown and said in a world."""

    def __init__(self) -> None:
        self.visits: list[TaskVisit] = []
        self.messages = 0
        self.released = 0
        self.epochs = 0
        self.moved = 0
        self._zero_s: float | None = None
        self._attempts: set[tuple[str, str, int]] = set()
        self._closed: set[str] = set()
        self._claimed: dict[str, tuple[Process, str | None]] = {}
        self._epoch: PlanEpoch | None = None

    def said(self, process: Process, message: Message) -> None:
        """Count a message, unless it is for observers alone, and what it tells that is new."""
        self.messages += not isinstance(message.body, Choice)
        match message.body:
            case Claim(task=task):
                self._claimed[message.writer] = process, task
            case Outcome() as outcome:
                self._end_attempt(process, message.writer, outcome)
            case PlanEpoch(phase=MissionPhase.RUNNING) as epoch:
                self._take_epoch(process, epoch)
            case TaskEntry(task=task, withdrawn=True) | TaskEdit(task=task, withdrawn=True):
                self._closed.add(task)
            case _:
                pass

    def noted(self, process: Process, note: LogLine) -> None:
        """Count a task that is given up on the way."""
        self.released += note.text in ("released", "turns aside") and process.name != COORDINATOR

    def _end_attempt(self, process: Process, uav: str, outcome: Outcome) -> None:
        attempt = uav, outcome.task, outcome.attempt
        if attempt in self._attempts or self._zero_s is None:
            return
        self._attempts.add(attempt)
        done = outcome.result is AttemptResult.DONE
        # By the world's clock, whatever the UAV's shows.
        completed_s = process.now_s() - self._zero_s
        self.visits.append(TaskVisit(UavId(uav), TaskId(outcome.task), completed_s, done))
        if done:
            self._closed.add(outcome.task)

    def _take_epoch(self, process: Process, epoch: PlanEpoch) -> None:
        if self._zero_s is None:
            self._zero_s = process.now_s()
        before, self._epoch = self._epoch, epoch
        if before is not None and before.number == epoch.number:
            return  # said again
        self.epochs += 1
        if before is not None:
            under_way = {task for by, task in self._claimed.values() if task and not by.over}
            settled = self._closed | under_way
            old, new = _whose(before.routes), _whose(epoch.routes)
            self.moved += sum(
                old.get(task, uav) != uav for task, uav in new.items() if task not in settled
            )


def _whose(routes: Mapping[str, tuple[str, ...]]) -> dict[str, str]:
    return {task: uav for uav, tasks in routes.items() for task in tasks}
