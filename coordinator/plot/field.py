"""What a mission in the field has more on its map: zones, bases, lines, ways round and home, wind.

Leaves out: starts, places and names (coordinator.plot.figure).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from coordinator.plot.labels import Label
from coordinator.plot.looks import LATE, SHARED, UNPLANNED, PathStyle, marker, wrapped
from swarm.model import Mission, Plan, Task, TaskId, UavId, Zone
from swarm.model.plan import ScheduleEntry

if TYPE_CHECKING:
    import shapely
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from swarm.allocation.problem import FloatArray

_KEEP_OUT = "#C62828"
_BASE_POINTS = 11.0
_BAND_POINTS = 7.0
_BAND_ALPHA = 0.35
_HOME_POINTS = 0.8
_MOST_WINDOWS = 24
"""Up to this many tasks their windows stand below their names."""


def field_places_m(mission: Mission) -> list[tuple[float, float]]:
    """East and north [m] of what else must be on the map: bases, lines, corners of zones."""
    return [
        *(base.position_enu_m[:2] for base in mission.bases),
        *(point[:2] for task in mission.tasks for point in task.path_enu_m),
        *(corner for zone in mission.zones for corner in zone.polygon_enu_m),
    ]


def draw_zones(axes: Axes, mission: Mission) -> None:
    """Shade where nobody may fly, and draw how far away paths stay.

    The rest is on the map already, whose limits are then fixed.
    """
    if not mission.zones:
        return
    import shapely

    axes.update_datalim(field_places_m(mission))
    axes.autoscale_view()
    west_m, east_m = axes.get_xlim()
    south_m, north_m = axes.get_ylim()
    around = shapely.box(west_m, south_m, east_m, north_m).buffer(2.0 * mission.zone_margin_m + 1.0)
    for zone in mission.zones:
        closed = around.difference(zone.shape()) if zone.inclusive else zone.shape()
        _draw_area(axes, closed, face=0.13, dashes=(0, ()))
        if mission.zone_margin_m > 0.0:
            _draw_area(axes, closed.buffer(mission.zone_margin_m), face=0.0, dashes=(0, (4.0, 3.0)))
    axes.set_xlim(west_m, east_m)
    axes.set_ylim(south_m, north_m)


def _draw_area(
    axes: Axes,
    area: shapely.Geometry,
    *,
    face: float,
    dashes: tuple[int, tuple[float, ...]],
) -> None:
    """Areas with their holes, as opaque as ``face`` says, with a border of ``dashes``."""
    import shapely
    from matplotlib.colors import to_rgba
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    for part in shapely.get_parts(area):
        # Holes go round the other way, as the renderer tells inside from outside by winding.
        turned = shapely.geometry.polygon.orient(part)
        rings = [np.array(ring.coords)[:, :2] for ring in (turned.exterior, *turned.interiors)]
        path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
        axes.add_patch(
            PathPatch(
                path,
                facecolor=to_rgba(_KEEP_OUT, face),
                edgecolor=to_rgba(_KEEP_OUT, 0.8),
                linewidth=0.9,
                linestyle=dashes,
                zorder=0.7,
            )
        )


def draw_bases(axes: Axes, mission: Mission) -> None:
    """A square for each base."""
    for base in mission.bases:
        axes.plot(
            *base.position_enu_m[:2],
            marker="s",
            markersize=_BASE_POINTS,
            markerfacecolor="white",
            markeredgecolor=SHARED,
            markeredgewidth=1.8,
            linestyle="none",
            zorder=4.5,
        )


def draw_lines(
    axes: Axes, mission: Mission, owner: Mapping[TaskId, UavId], looks: Mapping[UavId, PathStyle]
) -> None:
    """A broad band along every line, in the colour of who flies it."""
    for task in mission.tasks:
        if not task.path_enu_m:
            continue
        planned = task.id in owner
        axes.plot(
            *np.array(task.path_enu_m)[:, :2].T,
            color=looks[owner[task.id]].colour if planned else UNPLANNED,
            linewidth=_BAND_POINTS,
            alpha=_BAND_ALPHA,
            solid_capstyle="round",
            zorder=1.5,
        )


def flown_m(tasks: Mapping[TaskId, Task], entry: ScheduleEntry) -> FloatArray:
    """(k, 2) places of a leg, and of the line that is flown after it [m]."""
    places = [entry.from_enu_m, *entry.via_enu_m]
    task = tasks.get(TaskId(entry.go))
    if task is not None and task.path_enu_m:
        line = [point[:2] for point in task.path_enu_m]
        places += (line[::-1] if entry.is_reversed else line)[1:]
    return np.array(places)


def draw_schedule(
    axes: Axes, mission: Mission, entries: Sequence[ScheduleEntry], look: PathStyle
) -> None:
    """The way of one UAV from its start to where it lands, the way home thin."""
    tasks = {task.id: task for task in mission.tasks}
    if not entries:
        return
    *work, home = [flown_m({} if entry is entries[-1] else tasks, entry) for entry in entries]
    if work:
        axes.plot(
            *np.concatenate(work).T,
            color=look.colour,
            linestyle=look.dashes,
            linewidth=1.7,
            zorder=2,
            solid_capstyle="round",
        )
    axes.plot(
        *home.T,
        color=look.colour,
        linewidth=_HOME_POINTS,
        zorder=1.9,
    )
    for places_m in (*work, home):
        _draw_arrow(axes, places_m, look.colour)


def _draw_arrow(axes: Axes, places_m: FloatArray, colour: str) -> None:
    """An arrow head a little after the middle of a way."""
    piece_m = np.hypot(*np.diff(places_m, axis=0).T)
    flown = np.concatenate([[0.0], np.cumsum(piece_m)])
    if flown[-1] == 0.0:
        return
    tip_m, tail_m = (
        [float(np.interp(share * flown[-1], flown, axis_m)) for axis_m in places_m.T]
        for share in (0.60, 0.595)
    )
    axes.annotate(
        "",
        xy=(tip_m[0], tip_m[1]),
        xytext=(tail_m[0], tail_m[1]),
        arrowprops={
            "arrowstyle": "-|>,head_width=0.32,head_length=0.62",
            "color": colour,
            "linewidth": 0.0,
            "mutation_scale": 13.0,
            "shrinkA": 0.0,
            "shrinkB": 0.0,
        },
        zorder=3,
    )


def draw_wind(axes: Axes, mission: Mission) -> None:
    """An arrow in a corner to where the wind blows, with its speed."""
    east_m_s, north_m_s = mission.wind_enu_m_s
    speed_m_s = math.hypot(east_m_s, north_m_s)
    if speed_m_s == 0.0:
        return
    turn_deg = math.degrees(math.atan2(north_m_s, east_m_s))
    for text, right_points, size_points, rotation_deg in (
        (f"wind {speed_m_s:.1f} m/s", 16.0, 8.0, 0.0),
        ("➤", 6.0, 11.0, turn_deg),
    ):
        axes.annotate(
            text,
            (1.0, 1.0),
            (-right_points, 10.0),
            xycoords="axes fraction",
            textcoords="offset points",
            ha="right" if text != "➤" else "center",
            va="center",
            fontsize=size_points,
            rotation=rotation_deg,
        )


def field_labels(mission: Mission) -> list[Label]:
    """Names of bases and zones."""
    bases = [
        Label(base.id, base.position_enu_m[:2], 0.5 * _BASE_POINTS, bold=True)
        for base in mission.bases
    ]
    zones = [Label(zone.id, _name_place_m(zone), 0.0, bold=False) for zone in mission.zones]
    return [*bases, *zones]


def _name_place_m(zone: Zone) -> tuple[float, float]:
    """Where an area's name belongs: well inside, or of an inclusive zone at its border."""
    if zone.inclusive:
        return max(zone.polygon_enu_m, key=lambda corner: corner[1])
    place = zone.shape().representative_point()
    return float(place.x), float(place.y)


def task_label(mission: Mission, task: Task) -> tuple[str, tuple[float, float]]:
    """Name and window of a task, and where they belong [m]: of a line at its middle."""
    points = np.array(task.path_enu_m or [task.position_enu_m])[:, :2]
    middle = points[0] if len(points) == 1 else _middle_m(points)
    window = when(task) if len(mission.tasks) <= _MOST_WINDOWS else ""
    return f"{task.id}\n{window}" if window else task.id, (float(middle[0]), float(middle[1]))


def _middle_m(points: FloatArray) -> FloatArray:
    flown = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return np.array([np.interp(0.5 * flown[-1], flown, axis) for axis in points.T])


def when(task: Task) -> str:
    """When work on a task may begin, and when it is due; nothing of one without limits."""
    parts = []
    if task.closes_s is not None:
        parts.append(f"{task.opens_s:g}-{task.closes_s:g} s")
    elif task.opens_s > 0.0:
        parts.append(f"from {task.opens_s:g} s")
    if task.due_s is not None:
        parts.append(f"due {task.due_s:g} s")
    return ", ".join(parts)


def stops(entries: Sequence[ScheduleEntry]) -> list[str]:
    """The list of a UAV in words, bases in brackets, without its way home."""
    return [entry.go if entry.base is None else f"[{entry.base}]" for entry in entries[:-1]]


def field_legend(mission: Mission, plan: Plan) -> Iterator[Line2D]:
    """What the marks of the field in a plan mean."""
    from matplotlib.lines import Line2D

    yield from place_legend(mission)
    if any((plan.schedule or {}).values()):
        yield Line2D([], [], color=SHARED, linewidth=_HOME_POINTS, label="way home")
    if plan.left_out:
        yield marker("X", "white", LATE, wrapped("left out:", list(plan.left_out)))


def place_legend(mission: Mission) -> Iterator[Line2D]:
    """What the marks of lines, bases and zones mean."""
    from matplotlib.lines import Line2D

    if any(task.path_enu_m for task in mission.tasks):
        yield Line2D(
            [],
            [],
            color=SHARED,
            linewidth=_BAND_POINTS,
            alpha=_BAND_ALPHA,
            label="line to fly along",
        )
    if mission.bases:
        yield marker("s", "white", SHARED, "base: batteries are swapped")
    if mission.zones:
        margin = f", paths {mission.zone_margin_m:g} m away" if mission.zone_margin_m else ""
        yield marker("s", "#F4D4D4", _KEEP_OUT, f"no flying{margin}")
