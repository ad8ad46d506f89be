"""Plots of `swarm bench plan`: value against the time limit or the size; time and memory by size.

Colours are Okabe and Ito's, and markers tell methods apart without any colour. Leaves out:
tables (`sim.bench.plan_report`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from sim.bench.methods import METHODS
from sim.bench.plan_bench import LONG_RUN, Measured, PlanBench, Summary, summaries

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["comparison_figure", "scaling_figure", "write_figure"]

_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#777777")
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
_STEP = 0.05
"""The axis of ratios begins at a multiple of this."""


def write_figure(figure: Figure, path: Path) -> None:
    """Write the picture; its suffix says which kind.

    Raises:
        OSError: the file cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    figure.savefig(path, format=kind, dpi=160)


def comparison_figure(bench: PlanBench) -> Figure:
    """J relative to the best: against the limit, a panel per case, where there are several limits;
    else against the case."""
    from matplotlib.figure import Figure

    found = [s for s in summaries(bench) if s.method != LONG_RUN and s.ratio is not None]
    cases = list(dict.fromkeys(s.case for s in found))
    limits_s = sorted({s.limit_s for s in found})
    against_time = len(limits_s) > 1
    panels = cases if against_time else ["all"]
    figure = Figure(figsize=(2.0 + 4.2 * max(1, len(panels)), 4.4), layout="constrained")
    for i, panel in enumerate(panels):
        axes = figure.add_subplot(1, len(panels), i + 1)
        if against_time:
            shown = [s for s in found if s.case == panel]
            _lines(axes, shown, [f"{limit_s:g}" for limit_s in limits_s], by_case=False)
            axes.set_title(panel, loc="left")
            axes.set_xlabel("time limit [s]")
        else:
            _lines(axes, found, cases, by_case=True)
            limit = f"{limits_s[0]:g} s" if limits_s else "no limit"
            axes.set_title(f"Plans after {limit}", loc="left")
            axes.set_xlabel("UAVs × tasks")
        axes.set_ylabel("J / best of the run (0: that or less)")
        axes.set_ylim(_lowest(found), 1.01)
        axes.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    _legend(figure)
    return figure


def scaling_figure(bench: PlanBench) -> Figure:
    """Time to a first plan and peak memory by size, in the order measured."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.4, 4.4), layout="constrained")
    names = list(dict.fromkeys(row.method for row in bench.measured))
    cases = list(dict.fromkeys(row.case for row in bench.measured))
    for i, (title, of) in enumerate((("first plan [s]", _first_s), ("peak memory [MiB]", _mib))):
        axes = figure.add_subplot(1, 2, i + 1)
        for name in names:
            rows = [r for r in bench.measured if r.method == name and r.objective is not None]
            points = [(cases.index(row.case), of(row)) for row in rows]
            if points:
                xs, ys = zip(*points, strict=True)
                axes.plot(xs, ys, label=name, color=_colour(name), marker=_marker(name))
        axes.set_xticks(range(len(cases)), cases, rotation=30)
        axes.set_yscale("log")
        axes.set_xlabel("UAVs × tasks")
        axes.set_title(title, loc="left")
        axes.grid(visible=True, which="both", color="#e4e4e4", linewidth=0.6)
    _legend(figure)
    return figure


def _lines(axes: Axes, shown: Sequence[Summary], ticks: Sequence[str], *, by_case: bool) -> None:
    for name in dict.fromkeys(s.method for s in shown):
        points = [
            (ticks.index(s.case if by_case else f"{s.limit_s:g}"), max(s.ratio or 0.0, 0.0))
            for s in shown
            if s.method == name
        ]
        xs, ys = zip(*sorted(points), strict=True)
        axes.plot(xs, ys, label=name, clip_on=False, color=_colour(name), marker=_marker(name))
    axes.set_xticks(range(len(ticks)), ticks)


def _lowest(found: Sequence[Summary]) -> float:
    worst = min((s.ratio for s in found if s.ratio is not None), default=0.0)
    return max(0.0, math.floor(min(worst, 0.9) / _STEP) * _STEP)


def _colour(name: str) -> str:
    return _COLOURS[_index(name) % len(_COLOURS)]


def _marker(name: str) -> str:
    return _MARKERS[_index(name) % len(_MARKERS)]


def _index(name: str) -> int:
    return list(METHODS).index(name)


def _legend(figure: Figure) -> None:
    """One for all panels, since they show the same methods."""
    entries: dict[str, Artist] = {}
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(zip(labels, handles, strict=True))
    if entries:
        figure.legend(list(entries.values()), list(entries), loc="outside right upper")


def _first_s(row: Measured) -> float:
    return max(1e-4, row.trace[0][0] if row.trace else row.elapsed_s)


def _mib(row: Measured) -> float:
    return row.peak_bytes / 2.0**20
