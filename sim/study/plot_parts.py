"""What the plots of studies are made of: looks of policies, panels, legends and titles.

Leaves out: what is drawn (sim.study.study_plot).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from math import isfinite
from textwrap import fill
from typing import TYPE_CHECKING, Literal

from sim.study.rows import BOUND
from sim.study.statistics import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "ROW_IN",
    "Look",
    "add_legend",
    "add_title",
    "error_lengths",
    "look_of",
    "name_rows",
    "plain",
    "rows_figure",
    "two_panels",
]

ROW_IN = 0.32
"""Height of a policy's row in a chart of rows [in]."""
_LETTERS_PER_IN = 13


@dataclass(frozen=True, slots=True)
class Look:
    """How one policy is drawn, in every figure."""

    colour: str
    marker: str
    filled: bool = True

    @property
    def face(self) -> str:
        """Colour within its marks."""
        return self.colour if self.filled else "white"


_LOOKS = {
    "guided": Look("#009E73", "s"),
    "guided-alone": Look("#56B4E9", "D"),
    "greedy": Look("#0072B2", "o"),
    "lookahead": Look("#D55E00", "^"),
    "central": Look("#000000", "P"),
    "central-divert": Look("#000000", "D", filled=False),
    "interval": Look("#777777", "X"),
    "cbba": Look("#CC79A7", "v"),
    "frozen": Look("#E69F00", "p"),
    "nearest": Look("#0072B2", "<", filled=False),
    "value-per-time": Look("#D55E00", ">", filled=False),
    BOUND: Look("#000000", "_"),
}
_MORE_LOOKS = (
    Look("#777777", "o", filled=False),
    Look("#E69F00", "s", filled=False),
    Look("#56B4E9", "^", filled=False),
    Look("#CC79A7", "D", filled=False),
    Look("#009E73", "v", filled=False),
    Look("#000000", "p", filled=False),
)


def look_of(policy: str, among: Collection[str]) -> Look:
    """Its own, or one of those left, by its place among the policies of the study.

    A number behind a colon changes nothing, unless the policy is there with several numbers.
    """
    if _known(policy, among):
        return _LOOKS[_stem(policy)]
    others = sorted(name for name in among if not _known(name, among))
    return _MORE_LOOKS[others.index(policy) % len(_MORE_LOOKS)]


def _known(policy: str, among: Collection[str]) -> bool:
    stem = _stem(policy)
    alone = [_stem(name) for name in among].count(stem) == 1
    return stem in _LOOKS and (alone or stem == policy)


def _stem(policy: str) -> str:
    return policy.partition(":")[0]


def two_panels() -> tuple[Figure, tuple[Axes, Axes]]:
    """A figure of two panels side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    return figure, (left, right)


def rows_figure(rows: int, panels: int = 1) -> tuple[Figure, list[Axes]]:
    """A figure with a row per policy, in each of its panels."""
    from matplotlib.figure import Figure

    size_in = (6.6 + 2.0 * panels, 1.5 + ROW_IN * max(2, rows))
    figure = Figure(figsize=size_in, layout="constrained")
    row = figure.subplots(1, panels, sharey=True, squeeze=False)[0]
    for axes in row:
        plain(axes, "x")
    return figure, list(row)


def plain(axes: Axes, along: Literal["x", "y"]) -> None:
    """Leave the frame out, and draw a faint grid for values ``along`` that axis."""
    axes.grid(visible=True, axis=along, color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def name_rows(axes: Axes, labels: Sequence[str]) -> None:
    """Name rows 0, 1, …, the first on top."""
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)


def error_lengths(estimates: Sequence[Estimate]) -> list[list[float]]:
    """(2, n) lengths below and above the values; an unbounded interval is not drawn."""
    below = [each.value - each.low if isfinite(each.low) else 0.0 for each in estimates]
    above = [each.high - each.value if isfinite(each.high) else 0.0 for each in estimates]
    return [below, above]


def add_legend(figure: Figure, axes: Axes) -> None:
    """To the right of all panels, where it hides nothing."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", frameon=False)


def add_title(figure: Figure, text: str, note: str) -> None:
    """Title above, and a note below if there is one."""
    figure.suptitle(text, x=0.01, ha="left", fontweight="bold")
    if note:
        note = fill(note, int(_LETTERS_PER_IN * figure.get_figwidth()))
        figure.supxlabel(note, x=0.01, ha="left", fontsize=8.5, color="#444444")
