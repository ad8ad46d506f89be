"""What a mission has come to: after each task, at its end, and beside what was planned.

With what a run's protection refused, which the report tells too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType

from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.wording import (
    approach_in_words,
    counted,
    listed,
    rates_in_words,
    shown_m,
    shown_s,
)
from swarm.allocation.objective import evaluate
from swarm.allocation.problem import Problem
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.protocol.calibration import FlightRates
from swarm.protocol.uav_messages import AttemptResult, Outcome


@dataclass(frozen=True, slots=True)
class MissionResult:
    """What was executed, as far as it is known; DESIGN of the JSON: README, `swarm run`."""

    executed_routes: dict[UavId, tuple[TaskId, ...]]
    """Visits that ended done, in order, duplicates included."""
    executed_completion_s: dict[TaskId, float]
    """First successful visit of each task [s mission time]."""
    executed_objective: float
    """Eq. 1 over the tasks done, with the completion times that came about [value·s]."""
    done: tuple[TaskId, ...]
    failed: tuple[TaskId, ...]
    open: tuple[TaskId, ...]
    """Neither done nor failed nor withdrawn; pop-ups that never appeared included."""
    duplicate_visits: int
    """Visits to a task that had already been done, by another UAV or by the same one again."""
    makespan_s: float
    """Latest completion [s mission time]; 0 when nothing was done."""
    lost_uavs: tuple[UavId, ...]
    """UAVs that disappeared while they took part and did not come back; who came back and
    took part again is none of them, however long it was gone."""
    epochs: int
    """Epochs in which the mission ran; one that a new coordinator restates is the same."""
    added: tuple[TaskId, ...] = ()
    """Tasks that the operator has added to the scenario's, whatever became of them."""
    done_by: Mapping[TaskId, UavId] = field(default_factory=dict)
    rates: Mapping[str, FlightRates] = field(default_factory=dict)
    """UAVs that flew otherwise than the brief says, by their parameters or as they measured."""

    @property
    def is_complete(self) -> bool:
        """Whether every task was done or withdrawn."""
        return not self.failed and not self.open


@dataclass(frozen=True, slots=True)
class Progress:
    """What has been done so far."""

    flown: dict[str, list[str]]
    """UAV id -> tasks whose visits ended done, in order."""
    completed: dict[str, tuple[str, float]]
    """Task id -> UAV that did it first, and when [s mission time]."""
    curve: list[tuple[float, float]]
    """Mission time [s] and J so far [value·s] after each first successful visit."""

    @property
    def objective(self) -> float:
        """Eq. 1 over the tasks done [value·s]."""
        return self.curve[-1][1] if self.curve else 0.0

    @property
    def worths(self) -> dict[str, float]:
        """What each task done has added to J [value·s]."""
        values = [0.0, *(objective for _, objective in self.curve)]
        return {
            task: after - before
            for task, (before, after) in zip(self.completed, pairwise(values), strict=True)
        }


def lists_objective(problem: Problem, lists: Mapping[str, Sequence[str]]) -> float | None:
    """J of lists flown from the start as planned [value·s]; tasks the problem lacks count nothing.

    Returns:
        None where a task is on two lists: what two have visited is, and such lists are no plan.
    """
    index = {str(task): number for number, task in enumerate(problem.task_ids)}
    routes = [
        [index[task] for task in lists.get(uav, ()) if task in index] for uav in problem.uav_ids
    ]
    listed = [task for route in routes for task in route]
    return evaluate(problem, routes)[0] if len(set(listed)) == len(listed) else None


def dues_of(mission: Mission) -> dict[str, float]:
    """Task -> when it is due [s mission time], of those that are before the horizon."""
    return {task.id: task.due_s for task in mission.tasks if task.due_s is not None}


def progress_of(
    problem: Problem,
    outcomes: Mapping[tuple[str, str], Outcome],
    due_s: Mapping[str, float] = MappingProxyType({}),
) -> Progress:
    """Eq. 1 along the visits, in the order in which they ended.

    Args:
        problem: the mission, with every task that may have been done.
        outcomes: newest of each UAV at each task.
        due_s: of tasks that are due before the horizon [s mission time].

    Returns:
        Lists and times of the `MissionResult`, and the same J but for the order of its sum.
    """
    columns = {str(task): number for number, task in enumerate(problem.task_ids)}
    rows = {str(uav): number for number, uav in enumerate(problem.uav_ids)}
    visits = [
        (outcome.completed_s, uav, task)
        for (uav, task), outcome in outcomes.items()
        if outcome.result is AttemptResult.DONE and task in columns and uav in rows
    ]
    # Tasks at one place may end at one instant: those stay in the order they were told in.
    visits.sort(key=lambda visit: visit[:2])
    flown: dict[str, list[str]] = {uav: [] for uav in rows}
    survived = dict.fromkeys(rows, 1.0)
    completed: dict[str, tuple[str, float]] = {}
    curve: list[tuple[float, float]] = []
    objective = 0.0
    for completed_s, uav, task in visits:
        at = rows[uav], columns[task]
        flown[uav].append(task)
        if task not in completed:
            completed[task] = uav, completed_s
            left_s = due_s.get(task, problem.horizon_s) - completed_s
            objective += survived[uav] * float(problem.weight[at]) * left_s
            curve.append((completed_s, objective))
        survived[uav] *= float(problem.survival[at])
    return Progress(flown, completed, curve)


@dataclass(frozen=True, slots=True)
class RouteStop:
    """One task on a list."""

    task: TaskId
    time_s: float | None
    """Completion, planned or real [s mission time]."""
    late: bool
    """After the horizon, so that it counts against J."""
    odd: bool
    """On one of the UAV's two lists only."""

    def shown(self, *, planned: bool) -> str:
        """Task @ time, with marks where it is late or odd."""
        time = "" if self.time_s is None else f"@{shown_s(self.time_s)}"
        text = f"{self.task}{time}" + ("!" if self.late else "")
        if not self.odd:
            return text
        return f"({text})" if planned else f"+{text}"


@dataclass(frozen=True, slots=True)
class RouteComparison:
    """The two lists of one UAV."""

    uav: UavId
    planned: tuple[RouteStop, ...]
    flown: tuple[RouteStop, ...]
    same: bool
    lost: bool


@dataclass(frozen=True, slots=True)
class QuantityComparison:
    """One quantity, flown and planned."""

    name: str
    unit: str
    flown: float
    planned: float | None
    optimum: float | None


@dataclass(frozen=True, slots=True)
class ReportFact:
    """Something worth a line, with the ids it is about."""

    name: str
    text: str
    ids: tuple[str, ...] = ()
    bad: bool = False

    def shown(self, at_most: int | None = None) -> str:
        """Text and ids; of more than ``at_most`` ids the first ones, and how many more."""
        return ": ".join(part for part in (self.text, listed(self.ids, at_most)) if part)


def compare_routes(
    mission: Mission, plan: Plan | None, result: MissionResult
) -> list[RouteComparison]:
    """Every UAV's planned and flown list; without a plan the planned ones are empty."""
    compared = []
    planned_s: Mapping[TaskId, float] = {} if plan is None else plan.completion_s
    for uav in mission.uavs:
        planned = () if plan is None else plan.routes.get(uav.id, ())
        flown = result.executed_routes.get(uav.id, ())
        compared.append(
            RouteComparison(
                uav=uav.id,
                planned=_stops(planned, flown, planned_s, mission.horizon_s),
                flown=_stops(flown, planned, result.executed_completion_s, mission.horizon_s),
                same=plan is not None and flown == planned,
                lost=uav.id in result.lost_uavs,
            )
        )
    return compared


def _stops(
    tasks: Iterable[TaskId],
    others: tuple[TaskId, ...],
    times_s: Mapping[TaskId, float],
    horizon_s: float,
) -> tuple[RouteStop, ...]:
    return tuple(
        RouteStop(
            task=task,
            time_s=times_s.get(task),
            late=times_s.get(task, 0.0) > horizon_s,
            odd=task not in others,
        )
        for task in tasks
    )


def compare_quantities(plan: Plan | None, result: MissionResult) -> list[QuantityComparison]:
    """J and makespan."""
    makespan_s = None if plan is None else max(plan.completion_s.values(), default=0.0)
    return [
        QuantityComparison(
            "objective J",
            "value·s",
            result.executed_objective,
            None if plan is None else plan.objective,
            None if plan is None else plan.optimum,
        ),
        QuantityComparison("makespan", "s", result.makespan_s, makespan_s, None),
    ]


def summary_line(mission: Mission, plan: Plan | None, result: MissionResult) -> str:
    """The whole result in one line."""
    n_task = len(result.done) + len(result.failed) + len(result.open)
    if n_task == 0:
        return "There was no task to do"
    if result.epochs == 0:
        return f"The mission never started: 0 of {n_task} tasks done"
    spent = f"in {shown_s(result.makespan_s)} s of mission time"
    if result.is_complete:
        every = "The only task" if n_task == 1 else f"All {n_task} tasks"
        exact = all(each.same for each in compare_routes(mission, plan, result))
        return f"{every} done {spent}" + (", every list as planned" if exact else "")
    rest = [
        f"{len(tasks)} {word}"
        for tasks, word in ((result.failed, "failed"), (result.open, "still open"))
        if tasks
    ]
    return f"{len(result.done)} of {n_task} tasks done {spent}; {', '.join(rest)}"


def deviations(mission: Mission, result: MissionResult) -> list[ReportFact]:
    """What went otherwise than in a faultless mission; nothing if nothing did."""
    found = [
        ReportFact(name, counted(len(ids), noun), tuple(ids), True)
        for name, noun, ids in (
            ("lost", "UAV", result.lost_uavs),
            ("failed", "task", result.failed),
            ("still open", "task", result.open),
        )
        if ids
    ]
    times_s = result.executed_completion_s
    late = sorted((t for t in times_s if times_s[t] > mission.horizon_s), key=times_s.__getitem__)
    if late:
        ids = tuple(f"{task} at {shown_s(times_s[task])} s" for task in late)
        text = f"{counted(len(late), 'task')} after D = {mission.horizon_s:g} s, counting against J"
        found.append(ReportFact("late", text, ids, True))
    if result.duplicate_visits:
        visits = Counter(task for route in result.executed_routes.values() for task in route)
        twice = tuple(task for task, number in visits.items() if number > 1)
        text = f"{result.duplicate_visits} to tasks that were already done"
        found.append(ReportFact("visits in vain", text, twice, True))
    known = {*result.done, *result.failed, *result.open}
    withdrawn = tuple(task.id for task in mission.tasks if task.id not in known)
    if withdrawn:
        found.append(ReportFact("withdrawn", counted(len(withdrawn), "task"), withdrawn))
    if result.added:
        found.append(
            ReportFact("by the operator", counted(len(result.added), "task"), result.added)
        )
    later = (task.id for task in mission.tasks if task.appears_s > 0.0)
    popups = tuple(task for task in later if task not in result.added)
    if popups:
        text = f"{counted(len(popups), 'task')} unknown to the plan"
        found.append(ReportFact("pop-ups", text, popups))
    otherwise = [item for item in sorted(result.rates.items()) if not item[1].as_measured]
    if otherwise:
        text = f"{counted(len(otherwise), 'UAV')} otherwise than planned"
        how = tuple(f"{uav} {rates_in_words(each)}" for uav, each in otherwise)
        found.append(ReportFact("measured", text, how))
    if result.epochs > 1:
        found.append(ReportFact("re-planned", f"{result.epochs} epochs"))
    return found


def nearest_fact(near: Approach, separation_m: float | None) -> ReportFact:
    """How near two UAVs came to each other, beside what was asked for."""
    if separation_m is None:
        return ReportFact("nearest", approach_in_words(near))
    asked = f"; {shown_m(separation_m)} m were to be kept"
    return ReportFact("nearest", approach_in_words(near) + asked, bad=near.is_within(separation_m))


_HARMLESS = frozenset({"stale", "not forwarded"})
"""Reasons for which honest messages are dropped as well."""


def refusals(dropped: Iterable[Mapping[str, int]]) -> Counter[str]:
    """What was refused, by reason: all that was dropped but what honest ones drop, too."""
    total: Counter[str] = Counter()
    for counts in dropped:
        total.update({reason: n for reason, n in counts.items() if reason not in _HARMLESS})
    return +total


@dataclass(frozen=True, slots=True)
class ProtectionSummary:
    """Of a run with keys."""

    measures: tuple[str, ...]
    lacking: tuple[str, ...] = ()
    refused: Mapping[str, int] = field(default_factory=dict)
    """Messages and MAVLink frames refused by the UAVs and the observer, by reason."""

    @property
    def fact(self) -> ReportFact:
        """In a line of a report."""
        total = sum(self.refused.values())
        told = f"{total} refused" if total else "nothing was refused"
        by = tuple(f"{count} {reason}" for reason, count in sorted(self.refused.items()))
        parts = "; ".join((", ".join(self.measures), *self.lacking, told))
        return ReportFact("secure", parts, by, bad=bool(total))

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "measures": list(self.measures),
            "lacking": list(self.lacking),
            "refused": dict(self.refused),
        }
