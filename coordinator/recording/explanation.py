"""The story of one task or one UAV of a recorded mission: what happened, why, and what came of it.

Leaves out: finding what happened (coordinator.recording.event_log).
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console, Group
from rich.table import Table
from rich.text import Text

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.presentation import BAD, clean, shown_s, shown_value
from coordinator.mission_view.results import progress_of
from coordinator.recording.event_log import LoggedEvent, events_of
from coordinator.recording.reader import Recording
from coordinator.recording.wording import seconds_in_words
from swarm.protocol.board import TaskState
from swarm.protocol.uav_messages import AttemptResult, StatusPhase
from swarm.runtime.errors import Fault, InputError

__all__ = ["Explanation", "explain_task", "explain_uav"]


_TROUBLE = ("failed", "lost")
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
    events: tuple[LoggedEvent, ...]
    state: str
    """How it stands in the end."""
    worth: float
    """What it adds to J [value·s]."""
    objective: float
    """J of all that was done [value·s]."""
    ending: str
    """The same in a sentence."""

    def render(self, console: Console) -> None:
        """Print it for people, in the width of ``console``."""
        noun = "Task" if self.subject == "task" else "UAV"
        story = Table.grid(padding=(0, 2, 0, 0))
        story.add_column(justify="right", no_wrap=True, style="dim")
        story.add_column()
        for event in self.events:
            when = "start-up" if event.mission_s is None else f"{shown_s(event.mission_s)} s"
            story.add_row(when, Text(clean(event.text), BAD if event.kind in _TROUBLE else ""))
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
                    "kind": event.kind,
                    "text": event.text,
                    "uavs": sorted(event.uavs),
                    "tasks": sorted(event.tasks),
                }
                for event in self.events
            ],
            "ending": self.ending,
        }


def explain_task(recording: Recording, task: str) -> Explanation:
    """The story of ``task``.

    Raises:
        InputError: the recording has no such task.
    """
    told = events_of(recording)
    mission_state = told.mission_state
    states = mission_state.board.states
    if task not in states:
        raise _unknown(recording, "--task", task, states)
    objective = mission_state.result().executed_objective
    by, at_s, worth = _worths(mission_state).get(task, ("", 0.0, 0.0))
    events = _without_most_passings([event for event in told.events if task in event.tasks], task)
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
    return Explanation(
        mission=recording.mission,
        subject="task",
        id=task,
        events=events,
        state=state.value,
        worth=worth,
        objective=objective,
        ending=ending,
    )


def explain_uav(recording: Recording, uav: str) -> Explanation:
    """The story of ``uav``.

    Raises:
        InputError: the recording has no such UAV.
    """
    told = events_of(recording)
    mission_state = told.mission_state
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
    did = f"did {_named(list(mine))}, worth {_share(worth, objective)}" if mine else "did no task"
    but = f", failed at {_named(failed)}" if failed else ""
    return Explanation(
        mission=recording.mission,
        subject="uav",
        id=uav,
        events=tuple(event for event in told.events if uav in event.uavs),
        state=state,
        worth=worth,
        objective=objective,
        ending=f"So {uav} {did}{but}, and {how}.",
    )


def _without_most_passings(events: Sequence[LoggedEvent], task: str) -> tuple[LoggedEvent, ...]:
    """``events``, with those that passed the task over only as far as one wants to read."""
    kept: list[LoggedEvent] = []
    passed: list[LoggedEvent] = []
    for event in events:
        if event.kind != "passed over":
            kept.append(event)
            continue
        passed.append(event)
        if len(passed) <= _MOST_PASSED_OVER:
            kept.append(event)
    if (more := len(passed) - _MOST_PASSED_OVER) > 0:
        times = "once" if more == 1 else f"{more} times"
        text = f"Other tasks were preferred to {task} {times} more by then."
        kept.append(
            LoggedEvent(passed[-1].mission_s, "passed over", text, frozenset(), frozenset())
        )
        order = {id(event): place for place, event in enumerate(events)}
        last = order[id(passed[-1])]
        kept.sort(key=lambda event: order.get(id(event), last))
    return tuple(kept)


def _worths(mission_state: MissionState) -> dict[str, tuple[str, float, float]]:
    """Of each task done: who did it first, when [s mission time], and what that adds to J."""
    problem = mission_state.board.problem
    if problem is None:
        return {}
    progress = progress_of(problem, mission_state.replica.outcomes)
    found, before = {}, 0.0
    for (task, (uav, completed_s)), (_, objective) in zip(
        progress.completed.items(), progress.curve, strict=True
    ):
        found[task] = uav, completed_s, objective - before
        before = objective
    return found


def _share(worth: float, objective: float) -> str:
    of_all = ""
    if objective > 0.0:
        of_all = f", {100.0 * worth / objective:.1f} % of J = {shown_value(objective)}"
    return f"{shown_value(worth)} value·s{of_all}"


def _named(tasks: Sequence[str]) -> str:
    shown = ", ".join(tasks[:_MOST_NAMED])
    more = len(tasks) - _MOST_NAMED
    return shown if more <= 0 else f"{shown} and {more} more"


def _unknown(recording: Recording, option: str, name: str, there: Iterable[str]) -> InputError:
    names = list(there)
    near = difflib.get_close_matches(name, names, n=3)
    what = option.removeprefix("--")
    if near:
        remedy = f"did you mean {' or '.join(near)}?"
    elif names:
        remedy = f"choose one of {_named(names)}"
    else:
        remedy = "there are none in it"
    return InputError(Fault(option, name, f"{recording.path} has no such {what}", remedy))
