"""The picture of `swarm bench areas`: coverage over time of one seed, and all seeds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sim.bench.area_methods import METHODS
from sim.bench.areas import COVERED_FRAC, AreaRun, AreasBench, covered_ratios

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = dict(
    zip(
        METHODS,
        ("#0072B2", "#D55E00", "#8C510A", "#009E73", "#56B4E9", "#CC79A7", "#E69F00"),
        strict=True,
    )
)
_MARKERS = dict(zip(METHODS, ("o", "s", "X", "^", "v", "D", "P"), strict=True))
_POINTS = 600


def areas_figure(bench: AreasBench) -> Figure:
    """Curves of the first seed, undisturbed and with its loss, and ratios of all seeds."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14.0, 4.6), layout="constrained")
    cases = dict.fromkeys(run.case for run in bench.runs)
    panels = figure.subplots(1, len(cases) + 1, squeeze=False)[0].tolist()
    for axes, case in zip(panels, cases, strict=False):
        _curves(axes, case, [run for run in bench.runs if run.case == case])
    _ratios(panels[-1], bench)
    entries: dict[str, Artist] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(zip(labels, handles, strict=True))
    figure.legend(list(entries.values()), list(entries), loc="outside right upper")
    return figure


def _curves(axes: Axes, case: str, runs: list[AreaRun]) -> None:
    first = next((run.seed for run in runs if run.seed is not None), None)
    shown = [run for run in runs if run.seed in (first, None)]
    times_s = np.linspace(0.0, max(run.makespan_s for run in shown), _POINTS)
    for run in shown:
        covered = 100.0 * run.curve.at(times_s)
        axes.plot(times_s, covered, color=_COLOURS[run.method], label=run.method)
        if run.covered_s is not None:
            axes.plot(run.covered_s, 100.0 * COVERED_FRAC, **_mark(run.method))
    title = case if first is None else f"{case}, seed {first}"
    lost_s = next((run.lost_s for run in shown if run.lost_s is not None), None)
    if lost_s is not None:
        axes.axvline(lost_s, color="#000000", linewidth=0.8, linestyle=":")
        title += f": {shown[0].lost} lost at {lost_s:.0f} s"
    axes.axhline(100.0 * COVERED_FRAC, color="#000000", linewidth=0.6)
    axes.set_title(title[0].upper() + title[1:], loc="left", fontsize=10)
    axes.set_xlabel("mission time [s]")
    axes.set_ylabel("covered of what is allowed [%]")
    axes.set_ylim(0.0, 102.0)
    axes.grid(visible=True, color="#e4e4e4", linewidth=0.6)


def _ratios(axes: Axes, bench: AreasBench) -> None:
    """Times to full coverage of all seeds, as ratios to the best method with the same seed."""
    methods = list(dict.fromkeys(run.method for run in bench.runs))
    cases = list(dict.fromkeys(run.case for run in bench.runs))
    for case, method in dict.fromkeys((run.case, run.method) for run in bench.runs):
        place = cases.index(case) + 0.6 * ((methods.index(method) + 0.5) / len(methods) - 0.5)
        ratios = [ratio for ratio in covered_ratios(bench.runs, case, method) if ratio is not None]
        axes.plot([place] * len(ratios), ratios, **_mark(method))
    axes.axhline(1.0, color="#000000", linewidth=0.6)
    axes.set_xticks(range(len(cases)), cases)
    axes.set_xlim(-0.5, len(cases) - 0.5)
    axes.set_title(f"Time to {COVERED_FRAC:.1%}, all seeds", loc="left", fontsize=10)
    axes.set_ylabel("ratio to the best of the seed")
    axes.grid(visible=True, axis="y", color="#e4e4e4", linewidth=0.6)


def _mark(method: str) -> dict[str, Any]:
    look = {"marker": _MARKERS[method], "color": _COLOURS[method]}
    return {**look, "linestyle": "none", "markersize": 5, "alpha": 0.8}
