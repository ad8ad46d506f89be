"""A plan drawn over the map: starts, tasks, and every UAV's list as a path of arrows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from coordinator.plot.areas import (
    area_labels,
    area_legend,
    area_places_m,
    draw_areas,
    lines_of_areas,
)
from coordinator.plot.field import (
    draw_bases,
    draw_lines,
    draw_schedule,
    draw_wind,
    draw_zones,
    field_labels,
    field_legend,
    field_places_m,
    stops,
    task_label,
)
from coordinator.plot.labels import Label, place_labels
from coordinator.plot.looks import LATE, SHARED, UNPLANNED, PathStyle, marker, path_styles, wrapped
from swarm.model import Mission, Plan, Task, TaskId, Uav, UavId

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


PLOT_SUFFIXES = (".png", ".svg", ".pdf")
"""Kinds of picture, named by the file's suffix."""
_LABEL_POINTS = 8.0
_SMALLEST_TASK_POINTS, _LARGEST_TASK_POINTS = 5.0, 15.0
_LEGEND_INCHES = 3.1
_LISTED_TASKS = 24
"""Up to this many tasks the legend also gives the lists in words."""


def draw_plan(mission: Mission, plan: Plan, path: Path) -> None:
    """Write the picture of ``plan`` to ``path``; its suffix says which kind.

    Raises:
        ValueError: the suffix is not one of `PLOT_SUFFIXES`.
        OSError: the file cannot be written.
    """
    save_figure(plan_figure(mission, plan), path)


def save_figure(figure: Figure, path: Path) -> None:
    """Write a picture to ``path``; its suffix says which kind.

    Raises:
        ValueError: the suffix is not one of `PLOT_SUFFIXES`.
        OSError: the file cannot be written.
    """
    kind = path.suffix.lower().lstrip(".")
    if f".{kind}" not in PLOT_SUFFIXES:
        raise ValueError(f"path must end in {', '.join(PLOT_SUFFIXES)}, not {path.name!r}")
    # without its date the same picture gives the same file
    dated: dict[str, dict[str, str | None]] = {
        "svg": {"Date": None},
        "pdf": {"CreationDate": None},
    }
    figure.savefig(path, format=kind, dpi=160, metadata=dated.get(kind, {}))


def plan_figure(mission: Mission, plan: Plan) -> Figure:
    """The picture as a matplotlib figure, without any window."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_inches(mission), layout="constrained")
    axes = figure.add_subplot()
    looks = dict(zip(plan.routes, path_styles(len(plan.routes)), strict=True))
    diameters = _diameters_points(mission)
    if plan.schedule is None:
        _draw_paths(axes, mission, plan, looks)
    else:
        for uav, entries in plan.schedule.items():
            draw_schedule(axes, mission, entries, looks[uav])
    draw_areas(axes, mission, plan.completion_s)
    _draw_tasks(axes, mission, plan, looks, diameters)
    draw_bases(axes, mission)
    draw_starts(axes, mission, looks)
    finish_map(axes, mission, f"{plan.scenario}: lists by {plan.method}")
    _draw_legend(figure, mission, plan, looks)
    figure.draw_without_rendering()  # settles the scale in which labels must not overlap
    _draw_labels(axes, mission, diameters)
    return figure


def finish_map(axes: Axes, mission: Mission, title: str) -> None:
    """Add zones, wind, scale [m] and title to a map on which all else is drawn."""
    axes.set_aspect("equal", adjustable="box")
    axes.margins(0.09)
    draw_zones(axes, mission)
    draw_wind(axes, mission)
    axes.set_xlabel("east [m]")
    axes.set_ylabel("north [m]")
    axes.grid(visible=True, color="#e4e4e4", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_title(title, loc="left", fontweight="bold")


def size_inches(mission: Mission) -> tuple[float, float]:
    """A map as large as its number of names needs, with the legend beside it."""
    places = _places_m(mission)
    width_m, height_m = np.maximum(np.ptp(np.array(places), axis=0), 1e-9)
    ratio = float(np.clip(height_m / width_m, 0.4, 1.8))
    side = 6.4 if len(places) <= 30 else 10.0
    width, height = (side / ratio, side) if ratio >= 1.0 else (side, side * ratio)
    return width + 0.8 + _LEGEND_INCHES, max(height + 0.9, 3.2 + 0.25 * len(mission.uavs))


def _places_m(mission: Mission) -> list[tuple[float, float]]:
    """East and north [m] of all that has a place."""
    starts = [uav.position_enu_m[:2] for uav in mission.uavs]
    tasks = [task.position_enu_m[:2] for task in mission.tasks]
    return [*starts, *tasks, *field_places_m(mission), *area_places_m(mission)] or [(0.0, 0.0)]


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
    draw_lines(axes, mission, owner, looks)
    of_areas = lines_of_areas(mission)
    for task in mission.tasks:
        if task.id in of_areas:
            continue
        planned = task.id in owner
        bad = _is_late(mission, plan, task) if planned else task.id in plan.left_out
        axes.plot(
            *task.position_enu_m[:2],
            marker="o" if planned else "X",
            markersize=diameters[task.id],
            markerfacecolor=looks[owner[task.id]].colour if planned else "white",
            markeredgecolor=LATE if bad else "white" if planned else UNPLANNED,
            markeredgewidth=2.0 if bad and planned else 0.9,
            linestyle="none",
            zorder=4,
        )


def _is_late(mission: Mission, plan: Plan, task: Task) -> bool:
    return task.due_s is None and plan.completion_s[task.id] > mission.horizon_s


def draw_starts(axes: Axes, mission: Mission, looks: Mapping[UavId, PathStyle]) -> None:
    """A triangle for each start, or for several that are close together."""
    for uavs in _start_groups(mission):
        colour = looks[uavs[0].id].colour if len(uavs) == 1 else SHARED
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
        handles.append(Line2D([], [], linestyle="none", label=wrapped("sequence:", plan.sequence)))
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
                label=count if long else wrapped(f"{uav}:", _stops(plan, uav)),
            )
        )
    handles.append(marker("^", SHARED, "white", "start"))
    if len(lines_of_areas(mission)) < len(mission.tasks):
        handles.append(marker("o", "#777777", "white", "task; its area shows its value"))
    if any(_is_late(mission, plan, t) for t in mission.tasks if t.id in plan.completion_s):
        handles.append(marker("o", "#777777", LATE, "completed after the horizon"))
    if any(
        task.id not in plan.completion_s for task in mission.tasks if task.id not in plan.left_out
    ):
        handles.append(marker("X", "white", UNPLANNED, "in no list (appears later)"))
    handles += field_legend(mission, plan)
    handles += area_legend(mission)
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


def _stops(plan: Plan, uav: UavId) -> Sequence[str]:
    return plan.routes[uav] if plan.schedule is None else stops(plan.schedule[uav])


def _draw_labels(axes: Axes, mission: Mission, diameters: Mapping[TaskId, float]) -> None:
    """Name every place where its name hides nothing, as far as there is room."""
    of_areas = lines_of_areas(mission)
    labels = [
        Label(*task_label(mission, task), 0.5 * diameters[task.id], bold=False)
        for task in mission.tasks
        if task.id not in of_areas
    ]
    labels += [*area_labels(mission), *field_labels(mission)]
    for uavs in _start_groups(mission):
        name = ", ".join(uav.id for uav in uavs) if len(uavs) <= 3 else f"{len(uavs)} UAVs"
        labels.insert(0, Label(name, _middle_m(uavs), 6.0, bold=True))
    place_labels(axes, labels, _LABEL_POINTS if len(labels) <= 40 else _LABEL_POINTS - 1.5)
