"""The story of a mission, line by line: how times and sentences look, and which matter.

Leaves out: what is told (coordinator.observer).
"""

from __future__ import annotations

from collections.abc import Sequence

from coordinator.observer import Happening
from coordinator.view.signs import BAD

__all__ = [
    "clean",
    "is_routine",
    "is_trouble",
    "notable",
    "shown_s",
    "shown_value",
    "story_line",
    "story_style",
    "told_at",
]

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


def told_at(happening: Happening) -> str:
    """When it happened, in words."""
    return "start-up" if happening.mission_s is None else f"{shown_s(happening.mission_s)} s"


def story_line(happening: Happening, *, ascii_only: bool = False) -> str:
    """One line: when, and what."""
    return f"{told_at(happening):>{_TIME_CELLS}}  {clean(happening.text, ascii_only=ascii_only)}"


def is_routine(happening: Happening) -> bool:
    """Whether it only says that a task was done, as tasks are."""
    return happening.text.endswith(": done")


def is_trouble(happening: Happening) -> bool:
    """Whether something went wrong."""
    text = happening.text
    lost = text.endswith(" lost") or " lost;" in text
    return lost or text.endswith(": failed")


def story_style(happening: Happening) -> str:
    """Style that makes trouble stand out."""
    if is_trouble(happening):
        return BAD
    if "took over" in happening.text or happening.text.endswith((" appeared", "no further part")):
        return "yellow"
    return "" if is_routine(happening) else "bold"


def notable(story: Sequence[Happening]) -> list[Happening]:
    """The lines that are no routine."""
    return [happening for happening in story if not is_routine(happening)]
