"""How a mission looks wherever it is shown: characters, colours, styles of lines.

States differ in shape, never in colour alone; UAV colours are Okabe and Ito's, as in plots.
"""

from __future__ import annotations

from dataclasses import dataclass

from coordinator.mission_view.story import MissionEvent
from coordinator.mission_view.wording import clean

_UAV_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
BAD = "bold red"
"""Style of losses and failures."""


@dataclass(frozen=True, slots=True)
class Signs:
    """One set of characters; each is one cell wide."""

    open: str
    taken: str
    """A task that a UAV is on its way to or serves."""
    left_out: str
    """An open task for which the plan has no place."""
    done: str
    failed: str
    uav: str
    uav_lost: str
    base: str
    conflict: str
    """Where two UAVs would come too near to each other."""
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

    def task(self, stands: str) -> str:
        """Sign of a task, by how it stands."""
        signs = {"open": self.open, "taken": self.taken, "done": self.done}
        signs["left_out"] = self.left_out
        return signs.get(stands, self.failed)


UNICODE = Signs(
    open="○",
    taken="◎",
    left_out="◌",
    done="●",
    failed="×",
    uav="▲",
    uav_lost="▽",
    base="⌂",
    conflict="╳",
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
    left_out="%",
    done="*",
    failed="x",
    uav="^",
    uav_lost="!",
    base="B",
    conflict="X",
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


_TIME_CELLS = 9


def story_line(event: MissionEvent, *, ascii_only: bool = False) -> str:
    """One line: when, and what."""
    return f"{event.told_at:>{_TIME_CELLS}}  {clean(event.text, ascii_only=ascii_only)}"


def story_style(event: MissionEvent) -> str:
    """Style that makes trouble stand out."""
    if event.is_trouble:
        return BAD
    if event.is_unusual:
        return "yellow"
    return "" if event.is_routine else "bold"
