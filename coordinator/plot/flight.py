"""A flight drawn over the map: where each UAV was, what it did, and what is covered of areas.

Leaves out: where that is known from (coordinator.recording.flown_tracks).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from coordinator.mission_view.approaches import Approach
from coordinator.mission_view.wording import shown_m, shown_s
from coordinator.plot.areas import area_labels, area_legend, draw_areas, lines_of_areas
from coordinator.plot.field import (
    draw_bases,
    draw_lines,
    draw_schedule,
    field_labels,
    place_legend,
)
from coordinator.plot.figure import draw_starts, finish_map, save_figure, size_inches
from coordinator.plot.labels import place_labels
from coordinator.plot.looks import LATE, SHARED, UNPLANNED, PathStyle, marker, path_styles
from swarm.model import Mission, Plan, TaskId, UavId
from swarm.model.plan import ScheduleEntry
from swarm.survey.facts import area_facts

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MapTrack = Sequence[tuple[float, float]]
"""Places on the map, one after the other [m]."""

_PLANNED = PathStyle("#9E9E9E", (0, (2.0, 2.0)))
_TRACK_POINTS = 1.1
_LABEL_POINTS = 8.0


@dataclass(frozen=True, slots=True)
class DrawnFlight:
    """What is drawn of a mission that was flown."""

    mission: Mission
    tracks: Mapping[UavId, Sequence[MapTrack]]
    """By UAV, its ways; a new one begins where nobody knows how it came there."""
    done_by: Mapping[TaskId, UavId]
    lost: Sequence[UavId] = ()
    plan: Plan | None = None
    """What was planned before the start; drawn in grey below."""
    nearest: Approach | None = None
    makespan_s: float = 0.0


def draw_flight(flight: DrawnFlight, path: Path) -> None:
    """Write the picture of ``flight`` to ``path``; its suffix says which kind.

    Raises:
        ValueError: the suffix is not one of `PLOT_SUFFIXES`.
        OSError: the file cannot be written.
    """
    save_figure(flight_figure(flight), path)


def flight_figure(flight: DrawnFlight) -> Figure:
    """The picture as a matplotlib figure, without any window."""
    from matplotlib.figure import Figure

    mission = flight.mission
    figure = Figure(figsize=size_inches(mission), layout="constrained")
    axes = figure.add_subplot()
    fleet = [uav.id for uav in mission.uavs]
    looks = dict(zip(fleet, path_styles(len(fleet)), strict=True))
    draw_areas(axes, mission, flight.done_by)
    draw_lines(axes, mission, flight.done_by, looks)
    for entries in _planned(flight):
        draw_schedule(axes, mission, entries, _PLANNED)
    _draw_tracks(axes, flight, looks)
    _draw_tasks(axes, flight, looks)
    draw_bases(axes, mission)
    draw_starts(axes, mission, looks)
    _draw_nearest(axes, flight)
    finish_map(axes, mission, f"{mission.name}: as flown")
    _draw_legend(figure, flight, looks)
    figure.draw_without_rendering()  # settles the scale in which labels must not overlap
    place_labels(axes, [*area_labels(mission), *field_labels(mission)], _LABEL_POINTS)
    return figure


def _planned(flight: DrawnFlight) -> Iterator[Sequence[ScheduleEntry]]:
    if flight.plan is not None and flight.plan.schedule is not None:
        yield from flight.plan.schedule.values()


def _draw_tracks(axes: Axes, flight: DrawnFlight, looks: Mapping[UavId, PathStyle]) -> None:
    for uav, tracks in flight.tracks.items():
        for track in tracks:
            places_m = np.array(track)
            axes.plot(*places_m.T, color=looks[uav].colour, linewidth=_TRACK_POINTS, zorder=3.0)
        if uav in flight.lost and tracks:
            axes.plot(*tracks[-1][-1], marker="X", markersize=11.0, color=LATE, zorder=6.0)


def _draw_tasks(axes: Axes, flight: DrawnFlight, looks: Mapping[UavId, PathStyle]) -> None:
    of_areas = lines_of_areas(flight.mission)
    for task in flight.mission.tasks:
        if task.id in of_areas:
            continue
        by = flight.done_by.get(task.id)
        axes.plot(
            *task.position_enu_m[:2],
            marker="o" if by else "X",
            markersize=7.0,
            markerfacecolor=looks[by].colour if by else "white",
            markeredgecolor="white" if by else UNPLANNED,
            linestyle="none",
            zorder=4.0,
        )


def _draw_nearest(axes: Axes, flight: DrawnFlight) -> None:
    if flight.nearest is None:
        return
    east_m, north_m, _ = np.mean(np.array(flight.nearest.places_enu_m), axis=0)
    axes.plot(east_m, north_m, marker="+", markersize=13.0, color=SHARED, mew=1.8, zorder=6.0)


def _draw_legend(figure: Figure, flight: DrawnFlight, looks: Mapping[UavId, PathStyle]) -> None:
    from matplotlib.lines import Line2D

    mission, done = flight.mission, list(flight.done_by.values())
    handles = [
        Line2D(
            [],
            [],
            color=looks[uav.id].colour,
            linewidth=2.0 * _TRACK_POINTS,
            label=f"{uav.id}: {done.count(uav.id)} done" + ", lost" * (uav.id in flight.lost),
        )
        for uav in mission.uavs
    ]
    if any(_planned(flight)):
        label, (colour, dashes) = "as planned before the start", (_PLANNED.colour, _PLANNED.dashes)
        handles.append(Line2D([], [], color=colour, linestyle=dashes, label=label))
    handles.append(marker("^", SHARED, "white", "start"))
    if any(task.id not in flight.done_by for task in mission.tasks):
        handles.append(marker("X", "white", UNPLANNED, "not done"))
    if (near := flight.nearest) is not None:
        told = f"nearest: {' and '.join(near.uavs)}, {shown_m(near.distance_m)} m"
        handles.append(marker("+", SHARED, SHARED, told))
    handles += [*place_legend(mission), *area_legend(mission)]
    figure.legend(
        handles=handles,
        loc="outside right upper",
        title=_title(flight),
        fontsize=_LABEL_POINTS,
        title_fontsize=_LABEL_POINTS + 1.0,
        alignment="left",
        frameon=False,
        labelspacing=0.7,
        ncols=1 + len(looks) // 31,
    ).get_title().set_fontweight("bold")


def _title(flight: DrawnFlight) -> str:
    """What was done, when, and how much is covered."""
    mission, done = flight.mission, flight.done_by
    lines = [f"{len(done)} of {len(mission.tasks)} tasks in {shown_s(flight.makespan_s)} s"]
    planned = () if flight.plan is None else flight.plan.completion_s
    lines += [
        f"{facts.area}: {100.0 * facts.coverage_flown:.2f} % covered"
        for facts in area_facts(mission, planned, done)
        if facts.coverage_flown is not None
    ]
    return "\n".join(lines)
