"""How a mission looks wherever it is shown: characters, colours, numbers, lines of its story.

States differ in shape, never in colour alone; UAV colours are Okabe and Ito's, as in plots.
Leaves out: what is told (coordinator.mission_view.mission_state), and where things are put
(coordinator.terminal).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from swarm.protocol.board import TaskState

__all__ = [
    "ASCII",
    "BAD",
    "UNICODE",
    "Signs",
    "StoryLine",
    "clean",
    "is_routine",
    "is_trouble",
    "notable",
    "short_names",
    "shown_s",
    "shown_value",
    "signs_for",
    "story_line",
    "story_style",
    "told_at",
    "uav_colour",
]


@dataclass(frozen=True, slots=True)
class StoryLine:
    """One line of the story."""

    mission_s: float | None
    """Mission time [s]; None before the start."""
    text: str


_UAV_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")

BAD = "bold red"
"""Style of losses and failures."""


@dataclass(frozen=True, slots=True)
class Signs:
    """One set of characters; each is one cell wide."""

    open: str
    taken: str
    """A task that a UAV is on its way to or serves."""
    done: str
    failed: str
    uav: str
    uav_lost: str
    bar_full: str
    bar_empty: str
    bar_mark: str
    horizontal: str
    vertical: str
    corners: tuple[str, str, str, str]
    """Top left, top right, bottom left, bottom right."""
    scale: tuple[str, str]
    """Left and right end of the scale bar."""
    dot: str
    """Between parts of one line."""
    nothing: str
    cut: str
    """Where text was cut off."""
    times: str
    product: str
    braille: bool
    """Whether lines may be drawn with braille characters."""

    def task(self, state: TaskState, taken: bool) -> str:
        """Sign of a task."""
        if state is TaskState.OPEN:
            return self.taken if taken else self.open
        return self.done if state is TaskState.DONE else self.failed


UNICODE = Signs(
    open="○",
    taken="◎",
    done="●",
    failed="×",
    uav="▲",
    uav_lost="▽",
    bar_full="█",
    bar_empty="░",
    bar_mark="┃",
    horizontal="─",
    vertical="│",
    corners=("╭", "╮", "╰", "╯"),
    scale=("├", "┤"),
    dot="·",
    nothing="–",
    cut="…",
    times="×",
    product="·",
    braille=True,
)


ASCII = Signs(
    open="o",
    taken="@",
    done="*",
    failed="x",
    uav="^",
    uav_lost="!",
    bar_full="#",
    bar_empty=".",
    bar_mark="|",
    horizontal="-",
    vertical="|",
    corners=("+", "+", "+", "+"),
    scale=("|", "|"),
    dot="-",
    nothing="-",
    cut="~",
    times="x",
    product="*",
    braille=False,
)


def signs_for(ascii_only: bool) -> Signs:
    """The set a console with or without UTF-8 can show."""
    return ASCII if ascii_only else UNICODE


def uav_colour(number: int) -> str:
    """Colour of the UAV at that place of the fleet; distinct for the first six."""
    return _UAV_COLOURS[number % len(_UAV_COLOURS)]


def short_names(names: Sequence[str]) -> list[str]:
    """What tells each name from the others: ``uav07`` of many is ``07``.

    The common beginning is cut off, but no number is cut in two.
    """
    if len(names) < 2:
        return list(names)
    first, last = min(names), max(names)
    shared = 0
    while shared < min(len(first), len(last)) and first[shared] == last[shared]:
        shared += 1
    while shared > 0 and first[shared - 1].isdigit():
        shared -= 1
    return [name[shared:].lstrip("-_.") or name for name in names]


_TIME_CELLS = 9


def shown_s(time_s: float) -> str:
    """Seconds with as many digits as anyone reads."""
    if abs(time_s) < 9.995:
        return f"{time_s:.2f}"
    return f"{time_s:.1f}" if abs(time_s) < 999.95 else f"{time_s:.0f}"


def shown_value(value: float) -> str:
    """J with as many digits as anyone reads."""
    if abs(value) < 1000.0:
        return f"{value:.2f}"
    return f"{value:.1f}" if abs(value) < 10_000.0 else f"{value:.0f}"


def clean(text: str, *, ascii_only: bool = False) -> str:
    """``text`` on one line, without anything a terminal would obey."""
    line = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    return line.encode("ascii", "replace").decode("ascii") if ascii_only else line


def told_at(happening: StoryLine) -> str:
    """When it happened, in words."""
    return "start-up" if happening.mission_s is None else f"{shown_s(happening.mission_s)} s"


def story_line(happening: StoryLine, *, ascii_only: bool = False) -> str:
    """One line: when, and what."""
    return f"{told_at(happening):>{_TIME_CELLS}}  {clean(happening.text, ascii_only=ascii_only)}"


def is_routine(happening: StoryLine) -> bool:
    """Whether it only says that a task was done, as tasks are."""
    return happening.text.endswith(": done")


def is_trouble(happening: StoryLine) -> bool:
    """Whether something went wrong."""
    text = happening.text
    lost = text.endswith(" lost") or " lost;" in text
    return lost or text.endswith(": failed")


def story_style(happening: StoryLine) -> str:
    """Style that makes trouble stand out."""
    if is_trouble(happening):
        return BAD
    if "took over" in happening.text or happening.text.endswith((" appeared", "no further part")):
        return "yellow"
    return "" if is_routine(happening) else "bold"


def notable(story: Sequence[StoryLine]) -> list[StoryLine]:
    """The lines that are no routine."""
    return [happening for happening in story if not is_routine(happening)]
