"""The story of a mission: what happened, each thing once, with whom and what it concerns.

A line of the story says it in short; an explanation adds the detail.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from coordinator.mission_view.wording import shown_s

STORY_KEPT = 20_000
"""Lines of the story that an observer remembers; there are some for each task and each loss."""


class EventKind(StrEnum):
    """What sort of thing happened; the words are those of ``swarm explain --json``."""

    NOTE = "note"
    """Nothing of the others: about processes, keys, the story itself."""
    EPOCH = "epoch"
    LEFT_OUT = "left out"
    """A plan has no place for tasks."""
    END = "end"
    COORDINATOR = "coordinator"
    """It is back, or another one has taken charge."""
    COMMAND = "command"
    """The operator said something to UAVs."""
    REMARK = "remark"
    """A UAV said something about its vehicle."""
    LOST = "lost"
    BACK = "back"
    OUT = "out"
    RETURNING = "returning"
    HOME = "home"
    BASE = "base"
    """A UAV goes to have its battery changed, or is at it."""
    CALIBRATED = "calibrated"
    """A UAV has found that it flies otherwise than planned, or as planned again."""
    FREE = "free"
    PAUSED = "paused"
    POSTED = "posted"
    WITHDRAWN = "withdrawn"
    CHOSEN = "chosen"
    """In the story only where a UAV turns aside for it."""
    PASSED_OVER = "passed over"
    CLAIMED = "claimed"
    """In the story only where it is taken over from one that was lost."""
    CONTESTED = "contested"
    HELD = "held"
    RELEASED = "released"
    DONE = "done"
    FAILED = "failed"
    LIST = "list"
    NEAR = "near"
    """Two UAVs came near to each other; in explanations alone."""
    PLANNED = "planned"


_OPENERS = frozenset(
    {"both", "coordinator", "epoch", "in", "mission", "nobody", "operator", "other", "task"}
)
"""Words that begin a sentence with a capital; whatever else begins one is an id."""
_TROUBLE = frozenset({EventKind.LOST, EventKind.FAILED})
_UNUSUAL = frozenset({EventKind.CLAIMED, EventKind.LEFT_OUT, EventKind.POSTED, EventKind.OUT})


@dataclass(frozen=True, slots=True)
class MissionEvent:
    """One thing that happened."""

    mission_s: float | None
    """Mission time [s]; None before the start."""
    text: str
    """In short, as a line of the story."""
    kind: EventKind = EventKind.NOTE
    detail: str = ""
    """What an explanation adds to the end of the text."""
    uavs: frozenset[str] = frozenset()
    tasks: frozenset[str] = frozenset()

    @property
    def sentence(self) -> str:
        """All of it, as a sentence of an explanation; ids are written as they are."""
        text = self.text + self.detail
        if text.split(" ", 1)[0] in _OPENERS:
            text = text[:1].upper() + text[1:]
        return f"{text}."

    @property
    def told_at(self) -> str:
        """When it happened, in words."""
        return "start-up" if self.mission_s is None else f"{shown_s(self.mission_s)} s"

    @property
    def is_routine(self) -> bool:
        """Whether it only says that a task was done, as tasks are."""
        return self.kind is EventKind.DONE

    @property
    def is_trouble(self) -> bool:
        """Whether something went wrong."""
        return self.kind in _TROUBLE

    @property
    def is_unusual(self) -> bool:
        """Whether it is worth a look, though nothing went wrong."""
        return self.kind in _UNUSUAL


def notable(story: Sequence[MissionEvent]) -> list[MissionEvent]:
    """The lines that are no routine."""
    return [event for event in story if not event.is_routine]


class Story:
    """What has been told, oldest first.

    ``kept`` lines are remembered, give or take half of them; all if it is None.
    """

    def __init__(self, kept: int | None = STORY_KEPT) -> None:
        self.lines: list[MissionEvent] = []
        """The newest lines; where older ones are gone, the first tells how many."""
        self._kept = kept
        self._forgotten = 0
        """Lines that were told before those."""

    @property
    def told(self) -> int:
        """How many lines there have been so far."""
        return self._forgotten + len(self.lines)

    def since(self, told: int) -> list[MissionEvent]:
        """The lines after the first ``told`` ever, as far as they are remembered."""
        return self.lines[max(0, told - self._forgotten) :]

    def add(self, event: MissionEvent) -> None:
        """Tell what happened last."""
        self.lines.append(event)
        if self._kept is not None and len(self.lines) > self._kept:
            kept = self.lines[-self._kept // 2 :]
            gone = self.told - len(kept)
            first = MissionEvent(None, f"{gone} earlier lines are no longer kept")
            self.lines, self._forgotten = [first, *kept], gone - 1

    def put_before(self, earlier: Callable[[MissionEvent], bool], within_s: float) -> None:
        """Move the last line before the newest that ``earlier`` holds for, if that is recent."""
        last = self.lines[-1]
        for place in range(len(self.lines) - 2, -1, -1):
            event = self.lines[place]
            if (last.mission_s or 0.0) - (event.mission_s or 0.0) > within_s:
                return
            if earlier(event):
                self.lines.insert(place, self.lines.pop())
                return

    def take_back(self, event: MissionEvent) -> None:
        """Forget a line that has turned out to be wrong."""
        for place in range(len(self.lines) - 1, -1, -1):
            if self.lines[place] is event:
                del self.lines[place]
                return

    def order_since(self, told: int) -> None:
        """Put the lines after the first ``told`` in the order in which things happened."""
        news = self.since(told)
        self.lines[len(self.lines) - len(news) :] = sorted(news, key=lambda e: e.mission_s or 0.0)
