"""The picture of `swarm bench routes`: gaps by instance, a panel per family."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING

from sim.bench.instances import Family
from sim.bench.route_solvers import METHODS
from sim.bench.routes import RoutesBench

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.figure import Figure

_COLOURS = ("#0072B2", "#D55E00", "#009E73")
_MARKERS = ("o", "s", "^")
_LINEAR_PERCENT = 0.01
"""Gaps nearer to 0 than this are drawn on a linear axis, others on a logarithmic one [%]."""
_MOST_NAMES = 40


def gaps_figure(bench: RoutesBench) -> Figure:
    """Mean gaps as marks, from the least to the greatest as lines, instances by size."""
    from matplotlib.figure import Figure

    gaps: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for found in bench.found:
        gaps[found.file, found.method].append(found.gap)
    families = list(dict.fromkeys(found.family for found in bench.found))
    figure = Figure(figsize=(2.0 + 4.6 * max(1, len(families)), 4.6), layout="constrained")
    for place, family in enumerate(families):
        axes = figure.add_subplot(1, len(families), place + 1)
        files = {found.file for found in bench.found if found.family == family}
        rows = [row for row in bench.rows if row.file in files]
        order = sorted({(row.tasks, row.uavs, row.file) for row in rows})
        at = {file: x for x, (_, _, file) in enumerate(order)}
        for look, name in enumerate(METHODS):
            of = [row for row in rows if row.method == name]
            if not of:
                continue
            xs = [at[row.file] for row in of]
            axes.plot(
                xs,
                [100.0 * row.mean_gap for row in of],
                _MARKERS[look],
                color=_COLOURS[look],
                markersize=4,
                label=name,
            )
            runs = [
                [f.gap for f in bench.found if (f.file, f.method) == (row.file, name)] for row in of
            ]
            axes.vlines(
                xs,
                [100.0 * min(run) for run in runs],
                [100.0 * max(run) for run in runs],
                color=_COLOURS[look],
                linewidth=1.0,
            )
        axes.axhline(0.0, color="#000000", linewidth=0.8)
        axes.set_yscale("symlog", linthresh=_LINEAR_PERCENT)
        axes.margins(y=0.1)
        axes.set_title(f"{_TITLES[Family(family)]}, {bench.time_limit_s:g} s", loc="left")
        axes.set_ylabel("gap to the best known [%]")
        axes.grid(visible=True, axis="y", color="#e4e4e4", linewidth=0.6)
        if len(order) <= _MOST_NAMES:
            axes.set_xticks(
                range(len(order)), [file for _, _, file in order], rotation=60, ha="right"
            )
        else:
            axes.set_xlabel(f"{len(order)} instances, by number of tasks")
    entries: dict[str, Artist] = {}
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(zip(labels, handles, strict=True))
    figure.legend(list(entries.values()), list(entries), loc="outside right upper")
    return figure


_TITLES = {
    Family.TRP: "Travelling repairman",
    Family.MTRPP: "Repairmen with profits",
}
