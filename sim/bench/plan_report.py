"""What `swarm bench plan` shows: tables, Markdown, JSON, and plots.

Plots are of value against the time limit or the size, and of time and memory by size.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.text import Text

from sim.bench.plans import LONG_RUN, MethodSummary, PlanBench, PlanMeasurement, summaries
from sim.bench.results import BenchResult
from sim.bench.solvers import HORIZON_SHARE, METHODS, MissionSource, methods_for
from sim.study.baselines import ortools_field
from sim.study.baselines.ortools_routing import SHORTFALL
from swarm.runtime.table import Column, ResultTable

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MIB = 2.0**20
_SIZE = re.compile(r"\d+×\d+")

_RANDOM = (
    "Random missions: UAVs and tasks uniform over a square (5 km for 500 tasks, its area in "
    "proportion to their number), speeds 8–15 m/s, p 0.6–1, values 1–10, service 0–20 s, "
    f"D = {HORIZON_SHARE:g} × the makespan of value-per-time."
)

_MEASURED = (
    "Each method runs alone, in a process of its own, one after another, with the same limit in "
    "wall time; imports are not counted, and OR-Tools' building of its model comes on top of its "
    "limit. peak: memory of the whole process, interpreter and mission included. late: tasks "
    "completed after D. guided uses every core, and so does greedy of plain missions; the others "
    "one."
)

_FIELD = (
    "In the field plans compare by (fewest tasks left out, then J), all flown by the evaluator of "
    "plans; broken: tasks of lists that cannot be flown, from the first on that cannot be done. "
    "Then base visits are chosen anew, the best for the list's order, and only tasks for which "
    "there are none are dropped."
)

_RANDOM_FIELD = (
    "Random missions in the field: UAVs, places, values and services as in plain ones of the same "
    "size, p = 1 and survival 1; batteries, less their reserve, last for 40 % of the mean list, "
    "two bases without a limit of slots, swaps of 15 s, four zones, half of the tasks begin in a "
    "window; D = 1.2 × what the mission takes by value per time."
)

_SCALING_TITLE = "Time and memory by size"

_SCALING = (
    "first plan: when the method can first tell how good its best lists are, from the problem's "
    "arrays on; its J and that of half the time over the J at the end."
)


def comparison_grids(bench: PlanBench) -> list[ResultTable]:
    """One table per case and limit; the long run is told in each of its case."""
    found = summaries(bench)
    long_runs = {s.case: s for s in found if s.method == LONG_RUN}
    groups: dict[tuple[str, float], list[MethodSummary]] = {}
    for summary in found:
        if summary.method != LONG_RUN:
            groups.setdefault((summary.case, summary.limit_s), []).append(summary)
    grids = []
    for (case, limit_s), group in groups.items():
        long_run = long_runs.get(case)
        rows = [*group, long_run] if long_run is not None else group
        columns = [Column("method", words=True), *_ratios("J / best", "worst")]
        columns += _ratios("J / long run") if long_run is not None else []
        columns += [
            Column("time", _duration, "s"),
            Column("CPU", ".1f", "s"),
            Column("peak", ".0f", "MiB", 1 / _MIB),
            *([Column("left out", ".1f"), Column("broken")] if bench.field else [Column("late")]),
            Column("notes", words=True),
        ]
        found_rows = [_comparison_row(row, long_run is not None, bench.field) for row in rows]
        grids.append(ResultTable(columns, found_rows, f"{case}, {limit_s:g} s"))
    return grids


def scaling_grid(bench: PlanBench) -> ResultTable:
    """Time to a first plan, growth of J and memory by size."""
    rows: list[tuple[object, ...]] = []
    for row in bench.measured:
        if row.objective is None:
            rows.append((row.case, row.method, *[None] * 6, row.note))
            continue
        first = row.trace[0] if row.trace else (row.elapsed_s, row.objective)
        half = [worth for time_s, worth in row.trace if time_s <= row.limit_s / 2.0]
        rows.append(
            (
                row.case,
                row.method,
                first[0],
                _share(first[1], row.objective),
                _share(half[-1] if half else None, row.objective),
                row.ratio,
                row.elapsed_s,
                row.peak_bytes,
                row.note,
            )
        )
    columns = (
        Column("size", words=True),
        Column("method", words=True),
        Column("first plan", ".3f", "s"),
        *_ratios("its J / last", "half time's", "J / best"),
        Column("time", ".2f", "s"),
        Column("peak", ".0f", "MiB", 1 / _MIB),
        Column("notes", words=True),
    )
    return ResultTable(columns, rows, _SCALING_TITLE)


@dataclass(frozen=True, slots=True)
class PlanReport(BenchResult):
    """A run in tables."""

    bench: PlanBench
    grids: Sequence[ResultTable]

    def as_json(self) -> dict[str, Any]:
        """Everything, ready for `json.dumps`."""
        return {
            **asdict(self.bench),
            "summaries": [asdict(summary) for summary in summaries(self.bench)],
            "notes": _notes(self.bench, ()),
        }

    def parts(self) -> Iterable[RenderableType]:
        """See `BenchResult`."""
        yield _seeds(self.bench)
        for grid in self.grids:
            # A column of notes would take the width that figures need.
            yield ""
            yield ResultTable(grid.columns[:-1], [row[:-1] for row in grid.rows], grid.title)
            for cells in grid.cells():
                if cells[-1]:
                    yield Text(f"{_name(cells)}: {cells[-1]}", style="dim")
        yield ""
        yield from _notes(self.bench, self.grids)

    def as_markdown(self) -> str:
        """Everything for a document."""
        about = f"Measured on {self.machine}. {_seeds(self.bench)}"
        tables = (grid.as_markdown() for grid in self.grids)
        return "\n\n".join([about, *tables, *_notes(self.bench, self.grids)]) + "\n"


def _comparison_row(
    summary: MethodSummary, with_long_run: bool, in_field: bool
) -> tuple[object, ...]:
    if not summary.runs:
        return (summary.method, *[None] * (6 + with_long_run + in_field), summary.note)
    notes = summary.note
    if summary.unassigned and not in_field:
        notes += f"; {summary.unassigned} tasks on no list"
    return (
        summary.method,
        summary.ratio,
        summary.worst_ratio,
        *([summary.ratio_long] if with_long_run else []),
        summary.elapsed_s,
        summary.cpu_s,
        summary.peak_bytes,
        *((summary.left_out, summary.broken) if in_field else (summary.late,)),
        notes,
    )


def _ratios(*names: str) -> list[Column]:
    return [Column(name, ".4f") for name in names]


def _duration(time_s: float) -> str:
    return f"{time_s:.2f}" if time_s >= 0.01 else f"{time_s:.4f}"


def _notes(bench: PlanBench, grids: Sequence[ResultTable]) -> list[str]:
    """What the figures mean, as far as it concerns methods and cases that are there."""
    methods = list(dict.fromkeys(row.method for row in bench.measured))
    known = methods_for(MissionSource(field=bench.field))
    told = [f"{name}: {known[name].what}" for name in methods if name in known]
    notes = [_MEASURED, "; ".join(told) + "."]
    if any(grid.title == _SCALING_TITLE for grid in grids):
        notes.append(_SCALING)
    if any(name.startswith("ortools") for name in methods):
        notes.append(ortools_field.LEFT_OUT if bench.field else SHORTFALL)
    if bench.field:
        notes.append(_FIELD)
    if any(_SIZE.fullmatch(row.case) for row in bench.measured):
        notes.append(_RANDOM_FIELD if bench.field else _RANDOM)
    return notes


def _seeds(bench: PlanBench) -> str:
    seeds = list(dict.fromkeys(row.seed for row in bench.measured))
    return f"Seeds {', '.join(map(str, seeds))}; J / best: mean over seeds, best of this run = 1."


def _name(row: Sequence[str]) -> str:
    """What a note is about: the method, and in a table by size the size too."""
    return f"{row[0]} {row[1]}" if row[1] in METHODS else row[0]


def _share(worth: float | None, last: float) -> float | None:
    return None if worth is None or last <= 0.0 else worth / last


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
    panels: tuple[tuple[str, Callable[[PlanMeasurement], float]], ...] = (
        ("first plan [s]", lambda row: max(1e-4, row.trace[0][0] if row.trace else row.elapsed_s)),
        ("peak memory [MiB]", lambda row: row.peak_bytes / _MIB),
    )
    for i, (title, of) in enumerate(panels):
        axes = figure.add_subplot(1, 2, i + 1)
        for name in names:
            rows = [r for r in bench.measured if r.method == name and r.objective is not None]
            points = [(cases.index(row.case), of(row)) for row in rows]
            if points:
                xs, ys = zip(*points, strict=True)
                axes.plot(xs, ys, label=name, **_look(name))
        axes.set_xticks(range(len(cases)), cases, rotation=30)
        axes.set_yscale("log")
        axes.set_xlabel("UAVs × tasks")
        axes.set_title(title, loc="left")
        axes.grid(visible=True, which="both", color="#e4e4e4", linewidth=0.6)
    _legend(figure)
    return figure


def _lines(
    axes: Axes, shown: Sequence[MethodSummary], ticks: Sequence[str], *, by_case: bool
) -> None:
    for name in dict.fromkeys(s.method for s in shown):
        points = [
            (ticks.index(s.case if by_case else f"{s.limit_s:g}"), max(s.ratio or 0.0, 0.0))
            for s in shown
            if s.method == name
        ]
        xs, ys = zip(*sorted(points), strict=True)
        axes.plot(xs, ys, label=name, clip_on=False, **_look(name))
    axes.set_xticks(range(len(ticks)), ticks)


def _lowest(found: Sequence[MethodSummary]) -> float:
    worst = min((s.ratio for s in found if s.ratio is not None), default=0.0)
    return max(0.0, math.floor(min(worst, 0.9) / _STEP) * _STEP)


def _look(name: str) -> dict[str, Any]:
    names = list(dict.fromkeys([*METHODS, *methods_for(MissionSource(field=True))]))
    place = names.index(name)
    return {"color": _COLOURS[place % len(_COLOURS)], "marker": _MARKERS[place % len(_MARKERS)]}


def _legend(figure: Figure) -> None:
    """One for all panels, since they show the same methods."""
    entries: dict[str, Artist] = {}
    for axes in figure.axes:
        handles, labels = axes.get_legend_handles_labels()
        entries.update(zip(labels, handles, strict=True))
    if entries:
        figure.legend(list(entries.values()), list(entries), loc="outside right upper")
