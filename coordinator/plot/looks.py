"""Colours, dashes and markers of a map.

Colours are Okabe and Ito's, told apart by most colour-blind people, and line styles tell UAVs apart
without any colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.lines import Line2D

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_DASHES: tuple[tuple[int, tuple[float, ...]], ...] = (
    (0, ()),
    (0, (5.0, 2.0)),
    (0, (1.2, 1.6)),
    (0, (6.0, 1.8, 1.2, 1.8)),
)
UNPLANNED = "#888888"
SHARED = "#333333"
LATE = "#B00020"


@dataclass(frozen=True, slots=True)
class PathStyle:
    """How one UAV's path is drawn."""

    colour: str
    dashes: tuple[int, tuple[float, ...]]
    """Offset, then lengths of dashes and gaps [line widths]."""


def path_styles(count: int) -> list[PathStyle]:
    """Looks of ``count`` UAVs; 28 differ, as 7 colours and 4 dashes share no factor."""
    return [PathStyle(_COLOURS[i % len(_COLOURS)], _DASHES[i % len(_DASHES)]) for i in range(count)]


def marker(kind: str, face: str, edge: str, label: str) -> Line2D:
    """A marker as the legend shows it."""
    from matplotlib.lines import Line2D

    return Line2D(
        [],
        [],
        marker=kind,
        markersize=8.0,
        markerfacecolor=face,
        markeredgecolor=edge,
        markeredgewidth=1.6,
        linestyle="none",
        label=label,
    )


def wrapped(head: str, names: Sequence[str], width: int = 36) -> str:
    """Head and names, broken into lines of at most about ``width`` characters."""
    lines = [head]
    for name in names or ("nothing",):
        if len(lines[-1]) + 1 + len(name) > width:
            lines.append("   ")
        lines[-1] += f" {name}"
    return "\n".join(lines)
