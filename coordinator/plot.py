"""A plan drawn over the map: starts, tasks, and every UAV's list as a path of arrows.

Colours are Okabe and Ito's, told apart by most colour-blind people, and line styles tell UAVs apart
without any colour.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm.model import Mission, Plan, TaskId, Uav, UavId

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from swarm.allocation.problem import BoolArray, FloatArray

PLOT_SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of picture, named by the file's suffix."""
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_DASHES: tuple[tuple[int, tuple[float, ...]], ...] = (
    (0, ()),
    (0, (5.0, 2.0)),
    (0, (1.2, 1.6)),
    (0, (6.0, 1.8, 1.2, 1.8)),
)
_UNPLANNED = "#888888"
_SHARED = "#333333"
_LATE = "#B00020"
_LABEL_POINTS = 8.0
_SMALLEST_TASK_POINTS, _LARGEST_TASK_POINTS = 5.0, 15.0
_LEGEND_INCHES = 3.1
_LISTED_TASKS = 24
"""Up to this many tasks the legend also gives the lists in words."""


@dataclass(frozen=True, slots=True)
class PathStyle:
    """How one UAV's path is drawn."""

    colour: str
    dashes: tuple[int, tuple[float, ...]]
    """Offset, then lengths of dashes and gaps [line widths]."""


def draw_plan(mission: Mission, plan: Plan, path: Path) -> None:
    """Write the picture of ``plan`` to ``path``; its suffix says which kind.

    Raises:
        ValueError: the suffix is not one of `PLOT_SUFFIXES`.
        OSError: the file cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    if f".{kind}" not in PLOT_SUFFIXES:
        raise ValueError(f"path must end in {', '.join(PLOT_SUFFIXES)}, not {path.name!r}")
    # without its date the same plan gives the same file
    dated: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    metadata = dated.get(kind, {})
    plan_figure(mission, plan).savefig(path, format=kind, dpi=160, metadata=metadata)


def plan_figure(mission: Mission, plan: Plan) -> Figure:
    """The picture as a matplotlib figure, without any window."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=_size_inches(mission), layout="constrained")
    axes = figure.add_subplot()
    looks = dict(zip(plan.routes, path_styles(len(plan.routes)), strict=True))
    diameters = _diameters_points(mission)
    _draw_paths(axes, mission, plan, looks)
    _draw_tasks(axes, mission, plan, looks, diameters)
    _draw_starts(axes, mission, looks)
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.09)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title(f"{plan.scenario}: lists by {plan.method}", loc="left", fontweight="bold")
    _draw_legend(figure, mission, plan, looks)
    figure.draw_without_rendering()  # settles the scale in which labels must not overlap
    _draw_labels(axes, mission, diameters)
    return figure


def path_styles(count: int) -> list[PathStyle]:
    """Looks of ``count`` UAVs; 28 differ, as 7 colours and 4 dashes share no factor."""
    return [PathStyle(_COLOURS[i % len(_COLOURS)], _DASHES[i % len(_DASHES)]) for i in range(count)]


def _size_inches(mission: Mission) -> tuple[float, float]:
    """A map as large as its number of names needs, with the legend beside it."""
    places = _places_m(mission)
    width_m, height_m = np.maximum(np.ptp(np.array(places), axis=0), 1e-9)
    ratio = float(np.clip(height_m / width_m, 0.4, 1.8))
    side = 6.4 if len(places) <= 30 else 10.0
    width, height = (side / ratio, side) if ratio >= 1.0 else (side, side * ratio)
    return width + 0.8 + _LEGEND_INCHES, max(height + 0.9, 3.2 + 0.25 * len(mission.uavs))


def _places_m(mission: Mission) -> list[tuple[float, float]]:
    """East and north [m] of all starts and all tasks."""
    starts = [uav.position_enu_m[:2] for uav in mission.uavs]
    return starts + [task.position_enu_m[:2] for task in mission.tasks] or [(0.0, 0.0)]


def _diameters_points(mission: Mission) -> dict[TaskId, float]:
    """Diameter of each task's circle [points]; its area grows with the value."""
    largest = max((task.value for task in mission.tasks), default=0.0)
    smallest = min((task.value for task in mission.tasks), default=0.0)
    shrink = 0.8 if len(mission.tasks) > 40 else 1.0
    low, high = shrink * _SMALLEST_TASK_POINTS, shrink * _LARGEST_TASK_POINTS
    if largest == smallest:
        return {task.id: 0.5 * (low + high) for task in mission.tasks}
    return {
        task.id: max(low, high * float(np.sqrt(task.value / largest))) for task in mission.tasks
    }


def _draw_paths(
    axes: Axes,
    mission: Mission,
    plan: Plan,
    looks: Mapping[UavId, PathStyle],
) -> None:
    places_m = {task.id: task.position_enu_m[:2] for task in mission.tasks}
    for uav in mission.uavs:
        look = looks[uav.id]
        route = (places_m[task] for task in plan.routes[uav.id])
        points = np.array([uav.position_enu_m[:2], *route])
        axes.plot(
            *points.T,
            color=look.colour,
            linestyle=look.dashes,
            linewidth=1.7,
            zorder=2,
            solid_capstyle="round",
        )
        for begin, end in pairwise(points):
            if np.allclose(begin, end):
                continue
            axes.annotate(
                "",
                xy=tuple(begin + 0.60 * (end - begin)),
                xytext=tuple(begin + 0.55 * (end - begin)),
                arrowprops={
                    "arrowstyle": "-|>,head_width=0.32,head_length=0.62",
                    "color": look.colour,
                    "linewidth": 0.0,
                    "mutation_scale": 13.0,
                    "shrinkA": 0.0,
                    "shrinkB": 0.0,
                },
                zorder=3,
            )


def _draw_tasks(
    axes: Axes,
    mission: Mission,
    plan: Plan,
    looks: Mapping[UavId, PathStyle],
    diameters: Mapping[TaskId, float],
) -> None:
    owner = {task: uav for uav, route in plan.routes.items() for task in route}
    for task in mission.tasks:
        planned = task.id in owner
        late = planned and plan.completion_s[task.id] > mission.horizon_s
        axes.plot(
            *task.position_enu_m[:2],
            marker="o" if planned else "X",
            markersize=diameters[task.id],
            markerfacecolor=looks[owner[task.id]].colour if planned else "white",
            markeredgecolor=_LATE if late else "white" if planned else _UNPLANNED,
            markeredgewidth=2.0 if late else 0.9,
            linestyle="none",
            zorder=4,
        )


def _draw_starts(axes: Axes, mission: Mission, looks: Mapping[UavId, PathStyle]) -> None:
    for uavs in _start_groups(mission):
        colour = looks[uavs[0].id].colour if len(uavs) == 1 else _SHARED
        axes.plot(
            *_middle_m(uavs),
            marker="^",
            markersize=10.0,
            markerfacecolor=colour,
            markeredgecolor="white",
            markeredgewidth=0.9,
            linestyle="none",
            zorder=5,
        )


def _start_groups(mission: Mission) -> list[list[Uav]]:
    """UAVs whose starts are too close to be told apart on the map, drawn as one."""
    close_m = 0.03 * float(np.ptp(np.array(_places_m(mission)), axis=0).max())
    groups: list[list[Uav]] = []
    for uav in mission.uavs:
        east_m, north_m = uav.position_enu_m[:2]
        for group in groups:
            first_m = group[0].position_enu_m
            if np.hypot(east_m - first_m[0], north_m - first_m[1]) <= close_m:
                group.append(uav)
                break
        else:
            groups.append([uav])
    return groups


def _middle_m(uavs: Sequence[Uav]) -> tuple[float, float]:
    east_m, north_m, _ = np.mean([uav.position_enu_m for uav in uavs], axis=0)
    return float(east_m), float(north_m)


def _draw_legend(
    figure: Figure, mission: Mission, plan: Plan, looks: Mapping[UavId, PathStyle]
) -> None:
    from matplotlib.lines import Line2D

    handles: list[Line2D] = []
    if plan.sequence is not None:
        handles.append(Line2D([], [], linestyle="none", label=_wrapped("sequence:", plan.sequence)))
    long = len(plan.completion_s) > _LISTED_TASKS
    for uav, route in plan.routes.items():
        count = f"{uav}: {len(route)} task" + ("s" if len(route) != 1 else "")
        handles.append(
            Line2D(
                [],
                [],
                color=looks[uav].colour,
                linestyle=looks[uav].dashes,
                linewidth=1.7,
                label=count if long else _wrapped(f"{uav}:", route),
            )
        )
    handles.append(_marker("^", _SHARED, "white", "start"))
    handles.append(_marker("o", "#777777", "white", "task; its area shows its value"))
    if any(time_s > mission.horizon_s for time_s in plan.completion_s.values()):
        handles.append(_marker("o", "#777777", _LATE, "completed after the horizon"))
    if len(plan.completion_s) < len(mission.tasks):
        handles.append(_marker("X", "white", _UNPLANNED, "in no list (appears later)"))
    title = f"J = {plan.objective:.4f}"
    if plan.optimum is not None:
        gap = "" if plan.gap is None else f", gap {100.0 * plan.gap:.2f} %"
        title += f"\noptimum {plan.optimum:.4f}{gap}"
    legend = figure.legend(
        handles=handles,
        loc="outside right upper",
        title=title,
        fontsize=_LABEL_POINTS,
        title_fontsize=_LABEL_POINTS + 1.0,
        alignment="left",
        frameon=False,
        handlelength=3.4,
        labelspacing=0.7,
        ncols=1 + len(plan.routes) // 31,
    )
    legend.get_title().set_fontweight("bold")


def _marker(kind: str, face: str, edge: str, label: str) -> Line2D:
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


def _wrapped(head: str, names: Sequence[str], width: int = 36) -> str:
    """Head and names, broken into lines of at most about ``width`` characters."""
    lines = [head]
    for name in names or ("nothing",):
        if len(lines[-1]) + 1 + len(name) > width:
            lines.append("   ")
        lines[-1] += f" {name}"
    return "\n".join(lines)


def _draw_labels(axes: Axes, mission: Mission, diameters: Mapping[TaskId, float]) -> None:
    """Name every place where its name hides nothing, as far as there is room."""
    labels = [
        Label(task.id, task.position_enu_m[:2], 0.5 * diameters[task.id], bold=False)
        for task in mission.tasks
    ]
    for uavs in _start_groups(mission):
        name = ", ".join(uav.id for uav in uavs) if len(uavs) <= 3 else f"{len(uavs)} UAVs"
        labels.insert(0, Label(name, _middle_m(uavs), 6.0, bold=True))
    place_labels(axes, labels, _LABEL_POINTS if len(labels) <= 40 else _LABEL_POINTS - 1.5)


_DIRECTIONS = tuple(
    (float(np.cos(angle)), float(np.sin(angle)))
    for angle in np.radians([0, 90, 180, 270, 45, 315, 135, 225, 22, 158, 202, 338])
)
_GAPS_POINTS = (1.5, 5.0, 10.0, 17.0)
_LABEL_COST, _MARKER_COST, _LINE_COST, _OUTSIDE_COST = 100.0, 40.0, 3.0, 60.0


@dataclass(frozen=True, slots=True)
class Label:
    """A name to write near a point."""

    text: str
    point_m: tuple[float, float]
    """Where the point is, in the axes' data [m]."""
    radius_points: float
    """How far its marker reaches [points]."""
    bold: bool


def place_labels(axes: Axes, labels: Sequence[Label], size_points: float) -> list[FloatArray]:
    """Write ``labels`` on ``axes``, whose layout must be settled and whose lines must be drawn.

    Each tries a ring of places around its point, nearest first, and takes the one that hides least
    of other names and of the map.

    Returns:
        Per label, the box it takes as (left, bottom, right, top) [pixels].
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.patheffects import withStroke

    figure = axes.get_figure(root=True)
    if figure is None or not labels:
        return []
    FigureCanvasAgg(figure)  # measures text in the pixels of a picture
    pixels = figure.dpi / 72.0
    points = axes.transData.transform([label.point_m for label in labels])
    reach = np.array([label.radius_points for label in labels])[:, None] * pixels
    markers = np.hstack([points - reach, points + reach])
    trail = _trail(axes)
    frame = np.array(axes.get_window_extent().extents)
    placed: list[FloatArray] = []
    for label, point, marker_reach in zip(labels, points, reach[:, 0], strict=True):
        text = axes.annotate(
            label.text,
            label.point_m,
            xytext=(0.0, 0.0),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=size_points,
            fontweight="bold" if label.bold else "normal",
            color="#1a1a1a",
            zorder=6,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )
        extent = text.get_window_extent()
        half = np.array([extent.width, extent.height]) / 2.0
        best_cost, best_offset, best_box = np.inf, np.zeros(2), np.zeros(4)
        for gap in _GAPS_POINTS:
            for direction in _DIRECTIONS:
                # the box touches a circle around the point from outside
                offset = np.array(direction) * (marker_reach + gap * pixels + half)
                box = np.concatenate([point + offset - half, point + offset + half])
                cost = 0.4 * gap + _cost(box, placed, markers, trail, frame)
                if cost < best_cost:
                    best_cost, best_offset, best_box = cost, offset, box
        text.set_position(tuple(best_offset / pixels))
        placed.append(best_box)
    return placed


def _cost(
    box: FloatArray,
    placed: Sequence[FloatArray],
    markers: FloatArray,
    trail: FloatArray,
    frame: FloatArray,
) -> float:
    cost = _MARKER_COST * float(_overlaps(box, markers).sum())
    if placed:
        cost += _LABEL_COST * float(_overlaps(box, np.array(placed)).sum())
    if (box[:2] < frame[:2]).any() or (box[2:] > frame[2:]).any():
        cost += _OUTSIDE_COST
    inside = (trail >= box[:2]).all(axis=1) & (trail <= box[2:]).all(axis=1)
    return cost + _LINE_COST * min(5.0, float(inside.sum()) / 4.0)


def _overlaps(box: FloatArray, others: FloatArray) -> BoolArray:
    reaches = (box[:2] < others[:, 2:]) & (box[2:] > others[:, :2])
    return np.logical_and(reaches[:, 0], reaches[:, 1])


def _trail(axes: Axes) -> FloatArray:
    """Points every few pixels along all lines [pixels]."""
    parts = [np.empty((0, 2))]
    for line in axes.get_lines():
        corners = axes.transData.transform(np.column_stack(line.get_data()))
        for begin, end in pairwise(corners):
            steps = max(2, int(np.hypot(*(end - begin)) / 3.0))
            parts.append(begin + np.linspace(0.0, 1.0, steps)[:, None] * (end - begin))
    return np.concatenate(parts)
