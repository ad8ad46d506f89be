"""Characters and colours of everything shown in a terminal.

States differ in shape, never in colour alone; UAV colours are Okabe and Ito's, as in
plots. Leaves out: where things are put (coordinator.view.map_panel, coordinator.view.live).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from swarm.state.board import TaskState

__all__ = ["ASCII", "BAD", "UNICODE", "Signs", "short_names", "signs_for", "uav_colour"]

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
