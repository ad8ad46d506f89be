"""The story of one task or UAV of a recorded mission: what happened, why, and what came of it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.approaches import NEAR_M, Approach
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.observation import MissionObserver
from coordinator.mission_view.presentation import BAD
from coordinator.mission_view.results import dues_of, progress_of
from coordinator.mission_view.story import EventKind, MissionEvent
from coordinator.mission_view.wording import (
    approach_in_words,
    clean,
    listed,
    seconds_in_words,
    shown_value,
    why_left_out,
)
from coordinator.recording.reader import Recording
from swarm.protocol.board import TaskState
from swarm.protocol.uav_messages import AttemptResult, StatusPhase
from swarm.runtime.errors import Fault, InputError

_MOST_NAMED = 12
_MOST_PASSED_OVER = 3
"""Choices that passed a task over are told so often; of more only the number."""


@dataclass(frozen=True, slots=True)
class Explanation:
    """The story of one task or UAV."""

    mission: str
    subject: str
    """``task`` or ``uav``."""
    id: str
    events: tuple[MissionEvent, ...]
    state: str
    worth: float
    """What it adds to J [value·s]."""
    objective: float
    """J of all that was done [value·s]."""
    ending: str
    approaches: tuple[Approach, ...] = ()
    """How near other UAVs came to it, or to who did it on the way there."""

    def render(self, console: Console) -> None:
        """Print it for people, in the width of ``console``."""
        noun = "Task" if self.subject == "task" else "UAV"
        story = Table.grid(padding=(0, 2, 0, 0))
        story.add_column(justify="right", no_wrap=True, style="dim")
        story.add_column()
        for event in self.events:
            style = BAD if event.is_trouble else ""
            story.add_row(event.told_at, Text(clean(event.sentence), style))
        title = Text(f"{noun} {self.id} of mission {self.mission}", "bold")
        ending = Text(clean(self.ending), "bold")
        console.print(Group(title, "", story, "", ending) if self.events else Group(title, ending))

    def as_json(self) -> dict[str, Any]:
        """For programs, ready for `json.dumps`."""
        return {
            "mission": self.mission,
            self.subject: self.id,
            "state": self.state,
            "worth": self.worth,
            "objective": self.objective,
            "events": [
                {
                    "mission_s": event.mission_s,
                    "kind": event.kind.value,
                    "text": event.sentence,
                    "uavs": sorted(event.uavs),
                    "tasks": sorted(event.tasks),
                }
                for event in self.events
            ],
            "approaches": [near.as_json() for near in self.approaches],
            "ending": self.ending,
        }


def explain_task(recording: Recording, task: str, near_m: float = NEAR_M) -> Explanation:
    """The story of ``task``.

    Args:
        recording: of a mission.
        task: which.
        near_m: how near others came to who did it is told from here on [m].

    Raises:
        InputError: the recording has no such task.
    """
    mission_state = _explained(recording, near_m)
    states = mission_state.board.states
    if task not in states:
        raise _unknown(recording, "--task", task, states)
    objective = mission_state.result().executed_objective
    by, at_s, worth = _worths(mission_state).get(task, ("", 0.0, 0.0))
    events = _without_most_passings(
        [event for event in mission_state.story if task in event.tasks], task
    )
    approaches = _on_the_way(mission_state, events, by, at_s)
    state, share = states[task], _share(worth, objective)
    match state:
        case TaskState.DONE:
            ending = (
                f"So {task} was done by {by} at {seconds_in_words(at_s)}. That is worth {share}."
            )
        case TaskState.FAILED:
            ending = f"So {task} failed, and is worth nothing."
        case TaskState.WITHDRAWN:
            ending = f"So {task} was withdrawn, and is worth nothing."
        case TaskState.OPEN:
            holder = mission_state.holders.get(task)
            who = f"with {holder} on its way to it" if holder else "with nobody on the way to it"
            ending = f"So {task} is still open as the recording ends, {who}."
            if (why := mission_state.left_out.get(task)) is not None:
                ending = f"The plan leaves {task} out: {why_left_out(why)}. {ending}"
    return Explanation(
        mission=recording.mission,
        subject="task",
        id=task,
        events=_with(events, approaches),
        state=state.value,
        worth=worth,
        objective=objective,
        ending=ending,
        approaches=approaches,
    )


def explain_uav(recording: Recording, uav: str, near_m: float = NEAR_M) -> Explanation:
    """The story of ``uav``.

    Args:
        recording: of a mission.
        uav: which.
        near_m: how near others came to it is told from here on [m].

    Raises:
        InputError: the recording has no such UAV.
    """
    mission_state = _explained(recording, near_m)
    approaches = tuple(mission_state.flights.approaches.of(uav))
    fleet = [each.id for each in mission_state.mission.uavs]
    if uav not in fleet:
        raise _unknown(recording, "--uav", uav, fleet)
    objective = mission_state.result().executed_objective
    mine = {task: worth for task, (who, _, worth) in _worths(mission_state).items() if who == uav}
    worth = sum(mine.values())
    failed = [
        task
        for (who, task), outcome in mission_state.replica.outcomes.items()
        if who == uav and outcome.result is AttemptResult.FAILED
    ]
    if uav in mission_state.lost:
        state, how = "lost", "was lost"
    elif uav in mission_state.present:
        state, how = "there", "was there to the end"
    elif (status := mission_state.statuses.get(uav)) and status.phase is StatusPhase.HOME:
        state, how = "home", "came home"
    else:
        state, how = "gone", "had left by the end"
    did = (
        f"did {listed(list(mine), _MOST_NAMED)}, worth {_share(worth, objective)}"
        if mine
        else "did no task"
    )
    but = f", failed at {listed(failed, _MOST_NAMED)}" if failed else ""
    return Explanation(
        mission=recording.mission,
        subject="uav",
        id=uav,
        events=_with([event for event in mission_state.story if uav in event.uavs], approaches),
        state=state,
        worth=worth,
        objective=objective,
        ending=f"So {uav} {did}{but}, and {how}.",
        approaches=approaches,
    )


def _on_the_way(
    mission_state: MissionState, events: Sequence[MissionEvent], uav: str, done_s: float
) -> tuple[Approach, ...]:
    """How near others came to ``uav`` from its first claim on the task until that was done."""
    claimed_s = [
        event.mission_s or 0.0
        for event in events
        if event.kind is EventKind.CLAIMED and uav in event.uavs
    ]
    return tuple(
        near
        for near in mission_state.flights.approaches.of(uav)
        if claimed_s and near.at_s is not None and min(claimed_s) <= near.at_s <= done_s
    )


def _with(
    events: Sequence[MissionEvent], approaches: Sequence[Approach]
) -> tuple[MissionEvent, ...]:
    """The story with how near UAVs came to each other, each before what happened later."""
    told = list(events)
    for near in approaches:
        text = approach_in_words(near, told_at=False)
        line = MissionEvent(near.at_s, text, EventKind.NEAR, uavs=frozenset(near.uavs))
        at_s = near.at_s or 0.0
        later = (place for place, event in enumerate(told) if (event.mission_s or 0.0) > at_s)
        told.insert(next(later, len(told)), line)
    return tuple(told)


def _explained(recording: Recording, near_m: float) -> MissionState:
    """All that was known in the end, its story told with all reasons."""
    observer = MissionObserver(
        recording.mission, recording.timing, None, explains=True, near_m=near_m
    )
    observer.start(recording.start_s)
    for entry in recording.entries:
        observer.step(entry.fact, entry.now_s)
    return observer.mission_state


def _without_most_passings(events: Sequence[MissionEvent], task: str) -> tuple[MissionEvent, ...]:
    """``events``, with those that passed the task over only as far as one wants to read."""
    kept: list[MissionEvent] = []
    passed: list[MissionEvent] = []
    for event in events:
        if event.kind is not EventKind.PASSED_OVER:
            kept.append(event)
            continue
        passed.append(event)
        if len(passed) <= _MOST_PASSED_OVER:
            kept.append(event)
    if (more := len(passed) - _MOST_PASSED_OVER) > 0:
        times = "once" if more == 1 else f"{more} times"
        text = f"other tasks were preferred to {task} {times} more by then"
        kept.append(MissionEvent(passed[-1].mission_s, text, EventKind.PASSED_OVER))
        order = {id(event): place for place, event in enumerate(events)}
        last = order[id(passed[-1])]
        kept.sort(key=lambda event: order.get(id(event), last))
    return tuple(kept)


def _worths(mission_state: MissionState) -> dict[str, tuple[str, float, float]]:
    """Of each task done: who did it first, when [s mission time], and what that adds to J."""
    problem = mission_state.board.problem
    if problem is None:
        return {}
    due_s = dues_of(mission_state.mission)
    progress = progress_of(problem, mission_state.replica.outcomes, due_s)
    worths = progress.worths
    return {task: (*by_at, worths[task]) for task, by_at in progress.completed.items()}


def _share(worth: float, objective: float) -> str:
    of_all = ""
    if objective > 0.0:
        of_all = f", {100.0 * worth / objective:.1f} % of J = {shown_value(objective)}"
    return f"{shown_value(worth)} value·s{of_all}"


def _unknown(recording: Recording, option: str, name: str, there: Iterable[str]) -> InputError:
    names = list(there)
    near = difflib.get_close_matches(name, names, n=3)
    what = option.removeprefix("--")
    if near:
        remedy = f"did you mean {' or '.join(near)}?"
    elif names:
        remedy = f"choose one of {listed(names, _MOST_NAMED)}"
    else:
        remedy = "there are none in it"
    return InputError(Fault(option, name, f"{recording.path} has no such {what}", remedy))
