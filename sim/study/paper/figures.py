"""Figures 2, 3 and 4 of the paper, drawn from a reproduction.

2 and 3 are maps of Table I: the lists of the hierarchy, and the optimal ones. 4 shows for every
random problem how close each method comes to the optimum, and the averages beside the paper's.
Colours are Okabe and Ito's, and marks differ in shape too.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from coordinator.plot import plan_figure
from sim.study.paper.random_problems import STUDIED, RandomResults
from sim.study.paper.reproduction import Reproduction
from sim.study.paper.tables import RULES, PaperFigures, TableResults
from sim.study.style import add_title, plain_axes, save_figures, style_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FEW_PROBLEMS = 100


def draw_figures(found: Reproduction, folder: Path) -> list[Path]:
    """Write the figures, each as PNG and as SVG, into an existing folder.

    Raises:
        OSError: a file cannot be written.
    """
    figures = {
        "figure-2-hierarchical-plan": hierarchical_figure(found.table),
        "figure-3-optimal-plan": optimal_figure(found.table),
        "figure-4-random-problems": random_figure(found.random, found.expected.paper),
    }
    return save_figures(figures, folder)


def hierarchical_figure(table: TableResults) -> Figure:
    """Figure 2: the lists of the better of the paper's rules in its best sequence."""
    rule = max(RULES, key=lambda each: table.plans[each].objective)
    return _map(table, rule, f"Fig. 2: hierarchical plan, {rule}")


def optimal_figure(table: TableResults) -> Figure:
    """Figure 3: the proven best lists."""
    return _map(table, "exact", "Fig. 3: optimal plan")


def random_figure(random: RandomResults, paper: PaperFigures) -> Figure:
    """Figure 4: all random problems, in the order of greedy's values, and the averages."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(3.2, 1.0))
    _draw_problems(left, random)
    _draw_averages(right, random, paper)
    lowest = min(
        *(float(random.normalised(method).min()) for method in STUDIED),
        *(printed.value for printed in paper.normalised.values()),
    )
    left.set_ylim(lowest - 0.02, 1.01)
    for axes in (left, right):
        axes.axhline(1.0, color="#555555", linewidth=0.8, zorder=1)
        plain_axes(axes, "y")
    add_title(figure, "Fig. 4: how close the methods come to the optimum on random problems", "")
    return figure


def _map(table: TableResults, method: str, title: str) -> Figure:
    figure = plan_figure(table.mission, table.plans[method])
    figure.axes[0].set_title(title, loc="left", fontweight="bold")
    return figure


def _draw_problems(axes: Axes, random: RandomResults) -> None:
    order = np.argsort(random.normalised("greedy"), kind="stable")
    n = len(order)
    size = 5.0 if n <= _FEW_PROBLEMS else 2.5
    # guided lies on 1 nearly everywhere: wide and hollow, it hides no other mark
    for method in STUDIED:
        mark, hollow = style_of(method, STUDIED), method == "guided"
        axes.plot(
            np.arange(1, n + 1),
            random.normalised(method)[order],
            linestyle="none",
            marker=mark.marker,
            markersize=size * (1.3 if hollow else 1.0),
            markerfacecolor="none" if hollow else mark.colour,
            markeredgecolor=mark.colour if hollow else "white",
            markeredgewidth=1.0 if hollow else 0.4,
            label=method,
            zorder=2 if hollow else 3,
        )
    axes.margins(x=0.02)
    axes.set_xlabel(f"random problem, of {n} in the order of greedy's J")
    axes.set_ylabel("J, worst plan = 0, optimum = 1 [–]")
    axes.legend(loc="lower right", frameon=False, ncols=len(STUDIED))


def _draw_averages(axes: Axes, random: RandomResults, paper: PaperFigures) -> None:
    for place, method in enumerate(STUDIED):
        mark, average = style_of(method, STUDIED), random.average(method)
        axes.errorbar(
            place,
            average.mean,
            yerr=average.half_width,
            color=mark.colour,
            marker=mark.marker,
            markersize=7.0,
            capsize=5.0,
            zorder=3,
        )
        _name(axes, place, average.mean, f"{average.mean:.3f}")
        printed = paper.normalised.get(method)
        if printed is not None:
            axes.plot(place, printed.value, marker="x", color=mark.colour, markersize=8.0, mew=2.0)
            _name(axes, place, printed.value, str(printed))
    axes.set_xlim(-0.5, len(STUDIED) - 0.3)
    axes.set_xticks(range(len(STUDIED)), STUDIED)
    axes.set_xlabel("average and 95 % interval;\n× as the paper reports")


def _name(axes: Axes, place: int, value: float, text: str) -> None:
    """Write a value to the right of its mark."""
    axes.annotate(
        text,
        (place, value),
        xytext=(8.0, 0.0),
        textcoords="offset points",
        va="center",
        fontsize=9.0,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5},
    )
