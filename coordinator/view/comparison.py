"""What was flown beside what was planned: lists, worth, and what went otherwise.

Leaves out: how it is printed or written (coordinator.view.report, coordinator.view.report_text).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from coordinator.observer import MissionResult
from coordinator.view.story import shown_s
from swarm.model import Mission, Plan, TaskId, UavId

__all__ = ["Compared", "Fact", "Stop", "Worth", "compare_lists", "facts", "verdict", "worth"]


@dataclass(frozen=True, slots=True)
class Stop:
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
class Compared:
    """The two lists of one UAV."""

    uav: UavId
    planned: tuple[Stop, ...]
    flown: tuple[Stop, ...]
    same: bool
    lost: bool


@dataclass(frozen=True, slots=True)
class Worth:
    """One quantity, flown and planned."""

    name: str
    unit: str
    flown: float
    planned: float | None
    optimum: float | None


@dataclass(frozen=True, slots=True)
class Fact:
    """Something worth a line, with the ids it is about."""

    name: str
    text: str
    ids: tuple[str, ...] = ()
    bad: bool = False

    def shown(self, at_most: int | None = None) -> str:
        """Text and ids; of more than ``at_most`` ids the first ones, and how many more."""
        ids = self.ids if at_most is None else self.ids[:at_most]
        more = len(self.ids) - len(ids)
        listed = ", ".join(ids) + (f" and {more} more" if more else "")
        return ": ".join(part for part in (self.text, listed) if part)


def compare_lists(mission: Mission, plan: Plan | None, result: MissionResult) -> list[Compared]:
    """Every UAV's planned and flown list; without a plan the planned ones are empty."""
    compared = []
    planned_s: Mapping[TaskId, float] = {} if plan is None else plan.completion_s
    for uav in mission.uavs:
        planned = () if plan is None else plan.routes.get(uav.id, ())
        flown = result.executed_routes.get(uav.id, ())
        compared.append(
            Compared(
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
) -> tuple[Stop, ...]:
    return tuple(
        Stop(
            task=task,
            time_s=times_s.get(task),
            late=times_s.get(task, 0.0) > horizon_s,
            odd=task not in others,
        )
        for task in tasks
    )


def worth(plan: Plan | None, result: MissionResult) -> list[Worth]:
    """J and makespan."""
    makespan_s = None if plan is None else max(plan.completion_s.values(), default=0.0)
    return [
        Worth(
            "objective J",
            "value·s",
            result.executed_objective,
            None if plan is None else plan.objective,
            None if plan is None else plan.optimum,
        ),
        Worth("makespan", "s", result.makespan_s, makespan_s, None),
    ]


def verdict(mission: Mission, plan: Plan | None, result: MissionResult) -> str:
    """The whole result in one line."""
    n_task = len(result.done) + len(result.failed) + len(result.open)
    if n_task == 0:
        return "There was no task to do"
    if result.epochs == 0:
        return f"The mission never started: 0 of {n_task} tasks done"
    spent = f"in {shown_s(result.makespan_s)} s of mission time"
    if not (result.failed or result.open):
        every = "The only task" if n_task == 1 else f"All {n_task} tasks"
        exact = all(each.same for each in compare_lists(mission, plan, result))
        return f"{every} done {spent}" + (", every list as planned" if exact else "")
    rest = [
        f"{len(tasks)} {word}"
        for tasks, word in ((result.failed, "failed"), (result.open, "still open"))
        if tasks
    ]
    return f"{len(result.done)} of {n_task} tasks done {spent}; {', '.join(rest)}"


def facts(mission: Mission, result: MissionResult) -> list[Fact]:
    """What went otherwise than in a faultless mission; nothing if nothing did."""
    found = []
    if result.lost_uavs:
        found.append(Fact("lost", _count(result.lost_uavs, "UAV"), tuple(result.lost_uavs), True))
    if result.failed:
        found.append(Fact("failed", _count(result.failed, "task"), result.failed, True))
    if result.open:
        found.append(Fact("still open", _count(result.open, "task"), result.open, True))
    times_s = result.executed_completion_s
    late = sorted((t for t in times_s if times_s[t] > mission.horizon_s), key=times_s.__getitem__)
    if late:
        ids = tuple(f"{task} at {shown_s(times_s[task])} s" for task in late)
        text = f"{_count(late, 'task')} after D = {mission.horizon_s:g} s, counting against J"
        found.append(Fact("late", text, ids, True))
    if result.duplicate_visits:
        visits = Counter(task for route in result.executed_routes.values() for task in route)
        twice = tuple(task for task, number in visits.items() if number > 1)
        text = f"{result.duplicate_visits} to tasks that were already done"
        found.append(Fact("visits in vain", text, twice, True))
    known = {*result.done, *result.failed, *result.open}
    withdrawn = tuple(task.id for task in mission.tasks if task.id not in known)
    if withdrawn:
        found.append(Fact("withdrawn", _count(withdrawn, "task"), withdrawn))
    if result.added:
        found.append(Fact("by the operator", _count(result.added, "task"), result.added))
    later = (task.id for task in mission.tasks if task.appears_s > 0.0)
    popups = tuple(task for task in later if task not in result.added)
    if popups:
        text = f"{_count(popups, 'task')} unknown to the plan"
        found.append(Fact("pop-ups", text, popups))
    if result.epochs > 1:
        found.append(Fact("re-planned", f"{result.epochs} epochs"))
    return found


def _count(items: Sequence[str], noun: str) -> str:
    return f"{len(items)} {noun}" + ("" if len(items) == 1 else "s")
