"""How studies look, the same in tables and plots.

Names and units of what is varied, figures as text, colours and markers of policies, and the
panels and legends that plots are made of.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any, Literal

from sim.study.field_generator import FieldShape
from sim.study.statistics import Estimate
from sim.study.summary import PointSummary, StudySummary
from sim.study.trial import BOUND
from sim.world.uncertainty import Uncertainty

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Quantity:
    """How one number is shown."""

    name: str
    """What it is, for an axis or a heading."""
    unit: str
    """``%`` is shown for shares of 1."""
    words: str
    """A clause with the number, in that unit, in place of ``{}``."""
    idle: float = 0.0
    """The number that changes nothing."""

    @property
    def label(self) -> str:
        """Name and unit, for an axis."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def shown(self, value: float) -> float:
        """``value`` in the unit."""
        return 100.0 * value if self.unit.startswith("%") else value

    def text(self, value: float) -> str:
        """``value`` with its unit: 30 %, 0.5 per min."""
        return f"{self.shown(value):g} {self.unit.split(' of')[0]}".rstrip()


QUANTITIES = {
    "loss": Quantity("UAVs lost", "%", "each UAV is lost with probability {} %"),
    "popup": Quantity(
        "tasks that pop up", "%", "each task appears only during the mission with probability {} %"
    ),
    "popups_per_min": Quantity("further pop-ups", "per min", "{} further tasks pop up per minute"),
    "withdrawals_per_min": Quantity("withdrawals", "per min", "{} tasks are withdrawn per minute"),
    "speed_frac": Quantity(
        "UAVs' speeds", "% of cruise speed", "UAVs fly at {} % of their cruise speed", 1.0
    ),
    "drain_frac": Quantity(
        "drain of batteries", "% of the planned", "batteries drain at {} % of the planned rate", 1.0
    ),
    "speed_sd_frac": Quantity(
        "spread of UAVs' speeds", "% of cruise speed", "UAVs' speeds spread by {} %"
    ),
    "leg_sd_frac": Quantity(
        "spread of speeds from leg to leg", "% of cruise speed", "speeds of legs spread by {} %"
    ),
    "wind_m_s": Quantity("wind", "m/s", "wind of {} m/s blows from a random direction"),
    "position_error_m": Quantity("position error", "m", "UAVs stop {} m (1 σ) beside their places"),
    "message_loss": Quantity("messages lost", "%", "{} % of all messages are lost"),
    "delay_s": Quantity("least delay of messages", "s", "messages take {} s or longer"),
    "jitter_s": Quantity(
        "mean further delay of messages", "s", "messages take another {} s on average"
    ),
    "partitions_per_min": Quantity(
        "partitions", "per min", "half of the fleet is cut off {} times per minute"
    ),
    "partition_s": Quantity("length of a partition", "s", "for {} s each"),
}
"""By field of `Uncertainty`."""
FIELD_QUANTITIES = {
    "endurance_frac": Quantity("endurance", "% of a list", "batteries last for {} % of a list"),
    "bases": Quantity("bases", "", "{} bases"),
    "slots": Quantity("slots of a base", "", "slots at each: {}"),
    "swap_s": Quantity("swap of a battery", "s", "a swap takes {} s"),
    "zones": Quantity("zones", "", "{} zones"),
    "windows_frac": Quantity("tasks with windows", "%", "{} % of the tasks have windows"),
    "due_frac": Quantity("tasks that are due", "%", "{} % of the tasks are due"),
    "lines_frac": Quantity("tasks that are lines", "%", "{} % of the tasks are lines"),
    "steady_wind_m_s": Quantity("known wind", "m/s", "a known wind of {} m/s"),
    "acceleration_m_s2": Quantity("acceleration", "m/s²", "accelerations of {} m/s²"),
}
"""By field of `FieldShape`."""


def quantity_of(name: str) -> Quantity:
    """What is varied under that name."""
    return QUANTITIES.get(name) or FIELD_QUANTITIES[name]


def shape_words(shape: FieldShape) -> str:
    """What constrains random missions, in one clause."""
    clauses = []
    for name, quantity in FIELD_QUANTITIES.items():
        value = getattr(shape, name)
        if value > 0.0 and (shape.bases or name not in ("slots", "swap_s")):
            clauses.append(quantity.words.format(f"{quantity.shown(value):g}"))
    return ", ".join(clauses) or "no constraints"


def uncertainty_words(uncertainty: Uncertainty) -> str:
    """What is uncertain, in one sentence without its full stop."""
    clauses = []
    for name, quantity in QUANTITIES.items():
        value = getattr(uncertainty, name)
        if name == "partition_s" and uncertainty.partitions_per_min == 0.0:
            continue  # a default without effect
        if value != quantity.idle:
            clauses.append(quantity.words.format(f"{quantity.shown(value):g}"))
    if uncertainty.outcomes:
        clauses.append("attempts succeed and fail by chance")
    if uncertainty.survival:
        clauses.append("tasks cost UAVs by chance")
    for uav, when_s in uncertainty.lost_at_s.items():
        clauses.append(f"{uav} is lost at {when_s:g} s")
    for task, when_s in uncertainty.withdrawn_at_s.items():
        clauses.append(f"{task} is withdrawn at {when_s:g} s")
    return ", ".join(clauses) or "nothing is uncertain"


IDEAL = "†"
"""Behind the names of policies that are modelled with ideal communication only."""
NONE = "–"
_DECIMALS = 2


def interval_text(estimate: Estimate | None) -> str:
    """A ratio as ``0.981 [0.977, 0.985]``; a dash for none."""
    if estimate is None or math.isnan(estimate.value):
        return NONE
    digits = _digits(estimate)
    value, low, high = (_end(x, digits) for x in (estimate.value, estimate.low, estimate.high))
    return value if estimate.low == estimate.high else f"{value} [{low}, {high}]"


def spread_text(estimate: Estimate | None) -> str:
    """A ratio as ``0.981 ± 0.004``: the further end of its interval on both sides."""
    if estimate is None or math.isnan(estimate.value):
        return NONE
    digits, half = _digits(estimate), estimate.half_width
    return f"{_end(estimate.value, digits)} ± {_end(half, digits) if half else 0}"


def number_text(value: float, decimals: int = _DECIMALS) -> str:
    """With three digits or all before the point, and at most so many decimals."""
    if value == 0.0 or (value.is_integer() and decimals == _DECIMALS):
        return f"{value:,.0f}"
    digits = min(decimals, max(0, 2 - math.floor(math.log10(abs(value)))))
    return f"{value:,.{digits}f}"


def policy_label(summary: StudySummary, policy: str) -> str:
    """Its name, and what is special about it."""
    if policy == BOUND:
        return f"{policy} (bound)"
    return f"{policy} {IDEAL}" if policy in summary.about.ideal else policy


def trials_text(settings: Sequence[PointSummary]) -> str:
    """How many trials these have, one or more settings."""
    counts = [each.trials for each in settings]
    least, most = min(counts), max(counts)
    noun = "trial" if most == 1 else "trials"
    return f"{most} {noun}" if least == most else f"{least} to {most} {noun}"


def _digits(estimate: Estimate) -> int:
    """Decimals that suit an interval."""
    return 4 if 0.00005 <= estimate.half_width < 0.001 else 3


def _end(value: float, digits: int) -> str:
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    return f"{value:.{digits}f}"


ROW_IN = 0.32
"""Height of a policy's row in a chart of rows [in]."""
_LETTERS_PER_IN = 13


@dataclass(frozen=True, slots=True)
class PolicyStyle:
    """How one policy is drawn, in every figure."""

    colour: str
    marker: str
    filled: bool = True

    @property
    def marks(self) -> dict[str, Any]:
        """Of a line of matplotlib's."""
        face = self.colour if self.filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face}


_STYLES = {
    "guided": PolicyStyle("#009E73", "s"),
    "guided-alone": PolicyStyle("#56B4E9", "D"),
    "greedy": PolicyStyle("#0072B2", "o"),
    "lookahead": PolicyStyle("#D55E00", "^"),
    "central": PolicyStyle("#000000", "P"),
    "central-divert": PolicyStyle("#000000", "D", filled=False),
    "interval": PolicyStyle("#777777", "X"),
    "cbba": PolicyStyle("#CC79A7", "v"),
    "frozen": PolicyStyle("#E69F00", "p"),
    "nearest": PolicyStyle("#0072B2", "<", filled=False),
    "value-per-time": PolicyStyle("#D55E00", ">", filled=False),
    BOUND: PolicyStyle("#000000", "_"),
}

_MORE_STYLES = (
    PolicyStyle("#777777", "o", filled=False),
    PolicyStyle("#E69F00", "s", filled=False),
    PolicyStyle("#56B4E9", "^", filled=False),
    PolicyStyle("#CC79A7", "D", filled=False),
    PolicyStyle("#009E73", "v", filled=False),
    PolicyStyle("#000000", "p", filled=False),
)


def style_of(policy: str, among: Collection[str]) -> PolicyStyle:
    """Its own, or one of those left, by its place among the policies of the study.

    A number behind a colon changes nothing, unless the policy is there with several numbers.
    """
    if _known(policy, among):
        return _STYLES[_stem(policy)]
    others = sorted(name for name in among if not _known(name, among))
    return _MORE_STYLES[others.index(policy) % len(_MORE_STYLES)]


def _known(policy: str, among: Collection[str]) -> bool:
    stem = _stem(policy)
    alone = [_stem(name) for name in among].count(stem) == 1
    return stem in _STYLES and (alone or stem == policy)


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
        plain_axes(axes, "x")
    return figure, list(row)


def plain_axes(axes: Axes, along: Literal["x", "y"]) -> None:
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


def save_figures(figures: Mapping[str, Figure], folder: Path) -> list[Path]:
    """Write figures by their names, each as PNG and as SVG, into an existing folder.

    Raises:
        OSError: a file cannot be written.
    """
    import matplotlib as mpl

    drawn = []
    # without date and with fixed ids the same results give the same files
    with mpl.rc_context({"svg.hashsalt": "peckorder"}):
        for name, figure in figures.items():
            for kind, metadata in ((".png", {}), (".svg", {"Date": None})):
                path = folder / f"{name}{kind}"
                figure.savefig(path, dpi=160, metadata=metadata)
                drawn.append(path)
    return drawn
