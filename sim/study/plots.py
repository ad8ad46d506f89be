"""Plots of a study: what policies are worth, against what is varied, what they churn, how long they
think.

Colours are Okabe and Ito's, and marks differ in shape or filling too. The same rows give the same
files.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from sim.study.statistics import Estimate
from sim.study.style import (
    IDEAL,
    add_legend,
    add_title,
    error_lengths,
    interval_text,
    name_rows,
    plain_axes,
    policy_label,
    quantity_of,
    rows_figure,
    save_figures,
    style_of,
    trials_text,
    two_panels,
)
from sim.study.summary import PointSummary, PolicyResult, StudySummary
from sim.study.trial import BOUND

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_CLOSE = (0.75, 1.15)
"""Ratios that are drawn; what lies beyond is told."""
_CHURN = {
    "duplicate_visits": "tasks done twice, per mission",
    "churn": "tasks moved or released, per mission",
}
_TICK_S = 1e-9
"""A clock may have seen no time pass, which a logarithmic axis cannot show."""
_TIME_MARKS = {"median": ("o", 6.0), "99 % quantile": ("|", 11.0), "longest": (">", 6.0)}


def draw_study(summary: StudySummary, folder: Path) -> list[Path]:
    """Write the study's figures, each as PNG and as SVG, into an existing folder.

    Raises:
        OSError: a file cannot be written.
    """
    return save_figures(_figures(summary), folder)


def comparison_figure(summary: StudySummary, setting: PointSummary) -> Figure:
    """All policies in one setting, best first: ratio to the reference and its interval."""
    figure, (axes,) = rows_figure(len(setting.policies))
    ratios = [(each.policy, each.ratio) for each in summary.of(setting)]
    for place, (name, ratio) in enumerate(ratios):
        if ratio is None or math.isnan(ratio.value):
            continue
        look = style_of(name, summary.policies)
        axes.errorbar(
            ratio.value,
            place,
            xerr=error_lengths([ratio]),
            **look.marks | ({"marker": "|"} if name == BOUND else {}),
            markersize=7.0,
            capsize=4.0,
            zorder=3,
        )
        axes.annotate(
            "1 (reference)" if name == summary.reference else interval_text(ratio),
            (1.0, place),
            xycoords=("axes fraction", "data"),
            xytext=(6.0, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=9.0,
        )
    name_rows(axes, [policy_label(summary, name) for name, _ in ratios])
    axes.axvline(1.0, color="#555555", linewidth=0.8, zorder=1)
    axes.set_xlabel(f"J / {summary.reference}'s, with paired 95 % interval [–]")
    add_title(
        figure, f"What each policy is worth, {trials_text([setting])}", _ideal_note(summary, IDEAL)
    )
    return figure


def value_figure(summary: StudySummary, vary: str) -> Figure:
    """Mean value, and its ratio to the reference's, against the quantity that is varied."""
    figure, (left, right) = two_panels()
    settings = summary.varied[vary]
    for axes in (left, right):
        _against(axes, vary, settings)
    for number, name in enumerate(summary.policies):
        shown = _shown(settings, name)
        xs = [_x(setting) for setting, _ in shown]
        _line(left, summary, name, xs, [each.value.value for _, each in shown])
        ratios = [(x, each.ratio) for x, (_, each) in zip(xs, shown, strict=True) if each.ratio]
        known = [(x, ratio) for x, ratio in ratios if not math.isnan(ratio.value)]
        shift_pt = 1.6 * (number - 0.5 * (len(summary.policies) - 1))
        _intervals(right, summary, name, known, shift_pt)
    left.yaxis.set_major_formatter("{x:,.0f}")
    left.set_ylabel("mean J [value·s]")
    right.set_ylabel(f"J / {summary.reference}'s, with paired 95 % interval [–]")
    right.axhline(1.0, color="#555555", linewidth=0.8, zorder=1)
    beyond = _keep_close(right, summary, settings)
    add_legend(figure, left)
    name = quantity_of(vary).name
    note = "; ".join(filter(None, [_ideal_note(summary, "dashed:"), *beyond]))
    add_title(figure, f"Value against {name}, {trials_text(settings)}", note)
    return figure


def churn_figure(summary: StudySummary, vary: str) -> Figure:
    """Tasks done twice, and tasks moved or released, against the quantity that is varied."""
    figure, panels = two_panels()
    settings = summary.varied[vary]
    for axes, (column, label) in zip(panels, _CHURN.items(), strict=True):
        _against(axes, vary, settings)
        for name in summary.policies:
            shown = [(s, m.means[column]) for s, m in _shown(settings, name) if column in m.means]
            if shown:
                points = [_x(setting) for setting, _ in shown], [mean.value for _, mean in shown]
                _line(axes, summary, name, *points)
        _from_zero(axes, "y")
        axes.set_ylabel(label)
    add_legend(figure, panels[0])
    name = quantity_of(vary).name
    add_title(
        figure,
        f"Duplicates and churn against {name}, {trials_text(settings)}",
        _ideal_note(summary, "dashed:"),
    )
    return figure


def churn_bars_figure(summary: StudySummary, setting: PointSummary) -> Figure:
    """Tasks done twice, and tasks moved or released, of all policies in one setting."""
    from matplotlib.colors import to_rgba

    found = [each for each in summary.of(setting) if _CHURN.keys() <= each.means.keys()]
    figure, panels = rows_figure(len(found), panels=2)
    for axes, (column, label) in zip(panels, _CHURN.items(), strict=True):
        for place, each in enumerate(found):
            look, mean = style_of(each.policy, summary.policies), each.means[column]
            axes.barh(
                place,
                mean.value,
                xerr=error_lengths([mean]),
                color=to_rgba(look.colour, 0.35),
                edgecolor=look.colour,
                error_kw={"ecolor": "#333333", "elinewidth": 0.9, "capsize": 2.5},
                height=0.62,
                zorder=2,
            )
        _from_zero(axes, "x")
        axes.set_xlabel(f"{label}, with 95 % interval")
    name_rows(panels[0], [policy_label(summary, each.policy) for each in found])
    add_title(
        figure, f"Duplicates and churn, {trials_text([setting])}", _ideal_note(summary, IDEAL)
    )
    return figure


def time_figure(summary: StudySummary, setting: PointSummary) -> Figure | None:
    """Wall time of decisions in one setting, quickest first; None if none was timed."""
    walls = [(name, each.wall) for name, each in setting.policies.items() if each.wall is not None]
    if not walls:
        return None
    walls.sort(key=lambda each: (each[1].median_s, each[0]))
    figure, (axes,) = rows_figure(len(walls))
    for place, (name, wall) in enumerate(walls):
        look = style_of(name, summary.policies)
        times_s = (wall.median_s, wall.p99_s, wall.max_s)
        times_ms = [1e3 * max(_TICK_S, time_s) for time_s in times_s]
        axes.plot(times_ms, [place] * 3, color=look.colour, linewidth=1.6, zorder=2)
        for time_ms, (marker, size) in zip(times_ms, _TIME_MARKS.values(), strict=True):
            axes.plot(time_ms, place, marker=marker, color=look.colour, markersize=size, zorder=3)
    for name, (marker, size) in _TIME_MARKS.items():
        axes.plot(
            [], [], marker=marker, linestyle="none", color="#333333", markersize=size, label=name
        )
    name_rows(axes, [policy_label(summary, name) for name, _ in walls])
    axes.set_xscale("log")
    axes.set_xlabel("wall time of one decision or plan [ms]")
    figure.legend(loc="outside right upper", frameon=False)
    add_title(figure, f"How long deciding takes, {trials_text([setting])}", _times_note(summary))
    return figure


def _figures(summary: StudySummary) -> dict[str, Figure]:
    figures = {}
    own = summary.own
    if own is not None:
        figures["policies"] = comparison_figure(summary, own)
        figures["duplicates-and-churn"] = churn_bars_figure(summary, own)
        times = time_figure(summary, own)
        if times is not None:
            figures["decision-times"] = times
    for vary in summary.varied:
        name = vary.replace("_", "-")
        figures[f"value-against-{name}"] = value_figure(summary, vary)
        figures[f"duplicates-and-churn-against-{name}"] = churn_figure(summary, vary)
    return figures


# -- lines and panels -------------------------------------------------------------------


def _against(axes: Axes, vary: str, settings: Sequence[PointSummary]) -> None:
    plain_axes(axes, "y")
    xs = [_x(setting) for setting in settings]
    axes.set_xticks(xs, [f"{x:g}" for x in xs])
    pad = 0.06 * (max(xs) - min(xs)) or 1.0
    axes.set_xlim(min(xs) - pad, max(xs) + pad)
    axes.set_xlabel(quantity_of(vary).label)


def _from_zero(axes: Axes, along: Literal["x", "y"]) -> None:
    """For counts: as far as they reach, and to 1 where there are none."""
    limits = axes.dataLim.intervalx if along == "x" else axes.dataLim.intervaly
    most = float(limits[1])  # minus infinity where nothing is drawn
    axes.set(**{f"{along}lim": (0.0, 1.05 * most if most > 0.0 else 1.0)})


def _line(
    axes: Axes, summary: StudySummary, name: str, xs: Sequence[float], ys: Sequence[float]
) -> None:
    axes.plot(
        xs,
        ys,
        **style_of(name, summary.policies).marks,
        markersize=6.0,
        linewidth=1.4,
        linestyle=_style(summary, name),
        label=f"{name} (bound)" if name == BOUND else name,
        zorder=2 if name == BOUND else 3,
    )


def _intervals(
    axes: Axes,
    summary: StudySummary,
    name: str,
    ratios: Sequence[tuple[float, Estimate]],
    shift_pt: float,
) -> None:
    """A line with capped intervals, shifted sideways so that those of others stay visible."""
    from matplotlib.transforms import ScaledTranslation

    if not ratios:
        return
    known = [ratio for _, ratio in ratios]
    aside = ScaledTranslation(shift_pt / 72.0, 0.0, axes.figure.dpi_scale_trans)
    axes.errorbar(
        [x for x, _ in ratios],
        [ratio.value for ratio in known],
        yerr=error_lengths(known),
        **style_of(name, summary.policies).marks,
        markersize=5.0,
        linewidth=1.2,
        linestyle=_style(summary, name),
        capsize=2.5,
        elinewidth=1.0,
        transform=axes.transData + aside,
        zorder=2 if name == BOUND else 3,
    )


def _keep_close(axes: Axes, summary: StudySummary, settings: Sequence[PointSummary]) -> list[str]:
    """Show what lies close to the reference; of whom there is more."""
    low, high = _CLOSE
    ratios = {
        name: [
            each.ratio
            for _, each in _shown(settings, name)
            if each.ratio is not None and not math.isnan(each.ratio.value)
        ]
        for name in summary.policies
    }
    below = [name for name, them in ratios.items() if any(each.value < low for each in them)]
    above = [name for name, them in ratios.items() if any(each.value > high for each in them)]
    every = [each for them in ratios.values() for each in them]
    lengths = zip(every, *error_lengths(every), strict=True)
    ends = [(each.value - down, each.value + up) for each, down, up in lengths]
    low = max(low, min((end for end, _ in ends), default=low))
    high = min(high, max((end for _, end in ends), default=high))
    pad = 0.04 * (high - low) or 0.01
    axes.set_ylim(low - pad, high + pad)
    told = (("below", below), ("above", above))
    return [f"{side} the right panel too: {', '.join(names)}" for side, names in told if names]


# -- words and looks --------------------------------------------------------------------


def _shown(settings: Sequence[PointSummary], name: str) -> list[tuple[PointSummary, PolicyResult]]:
    return [(each, each.policies[name]) for each in settings if name in each.policies]


def _x(setting: PointSummary) -> float:
    return quantity_of(setting.vary).shown(setting.at or 0.0)


def _style(summary: StudySummary, name: str) -> str:
    if name == BOUND:
        return ":"
    return "--" if name in summary.about.ideal else "-"


def _ideal_note(summary: StudySummary, sign: str) -> str:
    """Told of those of the figure that are drawn with ``sign``."""
    if summary.about.ideal.isdisjoint(summary.policies):
        return ""
    return f"{sign} modelled with ideal communication only"


def _times_note(summary: StudySummary) -> str:
    on = f"; {summary.about.machine}" if summary.about.machine else ""
    return f"median and 99 % quantile: the median over trials of each trial's{on}"
