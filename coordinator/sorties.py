"""What a UAV flies from one take-off to the next landing, and the mission items that tell it so.

Lines are flown from end to end, with the camera triggered by distance from where they begin to
where they end, and pointed at what closed lines of the kind `structure` lead round; ways round
zones are waypoints. Waits for a task to open are hold times. An item of
MAVLink holds whole seconds on ArduPilot. Leaves out: files, and what else a plan has.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from swarm.allocation.field.network import points_over
from swarm.allocation.legs.ground import ground_of
from swarm.model import Mission, Origin, Plan, Task, Uav
from swarm.model.frames import wgs84_from_enu
from swarm.model.terrain import Terrain
from swarm.scenario.task_files.exported_tasks import ExportedTask
from swarm.scenario.task_files.mission_items import MavCommand, MavFrame
from swarm.survey.structures import structure_middle_m

_RELATIVE = 1
_GROUND_SPEED = 1
_THROTTLE_AS_IT_IS = -1
_PICTURE_AT_ONCE = 1
_LEAST_WAIT_S = 1e-6
_Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Leg:
    """The way to a task, and the task."""

    task: Task
    via_enu_m: Sequence[tuple[float, float]] = ()
    """Corners on the way there [m; east, north]."""
    wait_s: float = 0.0
    """On the spot, before the work begins [s]."""
    is_reversed: bool = False
    """A line is flown from its last point to its first."""
    up_m: Sequence[float] = ()
    """Heights at ``via_enu_m`` [m above the origin]; none where they are not known: evenly."""


@dataclass(frozen=True, slots=True)
class Sortie:
    """From one take-off to the next landing."""

    start_enu_m: _Point
    legs: Sequence[Leg]
    end_enu_m: _Point
    via_enu_m: Sequence[tuple[float, float]] = ()
    """Corners on the way to its end [m; east, north]."""
    up_m: Sequence[float] = ()
    """Heights at these, as of a leg [m]."""


def sorties_of(mission: Mission, plan: Plan, uav: Uav) -> Sequence[Sortie]:
    """The sorties of a UAV in order; none if it has no task."""
    tasks = {task.id: task for task in mission.tasks}
    route = [tasks[task] for task in plan.routes[uav.id]]
    if not route:
        return ()
    home = uav.position_enu_m
    if plan.schedule is None:
        return (Sortie(home, [Leg(task) for task in route], home),)
    bases = {base.id: base.position_enu_m for base in mission.bases}
    by_name = {str(task.id): task for task in route}
    sorties: list[Sortie] = []
    start, legs = home, list[Leg]()
    for entry in plan.schedule[uav.id]:
        via = entry.via_enu_m[:-1]
        if (task := by_name.get(entry.go)) is not None:
            wait_s = max(0.0, entry.begin_s - entry.arrive_s)
            wait_s = wait_s if wait_s > _LEAST_WAIT_S else 0.0
            legs.append(Leg(task, via, wait_s, entry.is_reversed, entry.up_m[1:-1]))
            continue
        end = home if entry.base is None else bases[entry.base]
        sorties.append(Sortie(start, legs, end, via, entry.up_m[1:-1]))
        start, legs = end, []
    return sorties


@dataclass(slots=True)
class SortieItems:
    """The mission items of a sortie."""

    sortie: Sortie
    uav: Uav
    layer_m: float
    """Height of the UAV's layer above the places that it visits [m]."""
    origin: Origin
    terrain: Terrain | None = None
    """What heights of tasks count from, and lines follow; None: the origin."""
    _items: list[dict[str, object]] = field(default_factory=list)
    _tasks: list[ExportedTask] = field(default_factory=list)

    def listed(self) -> tuple[Sequence[dict[str, object]], Sequence[ExportedTask]]:
        """The items in order, and what they are of the tasks."""
        if not self._items:
            self._list()
        return self._items, self._tasks

    def height_range_m(self) -> tuple[float, float]:
        """Lowest and greatest height that it is at, above the origin [m]."""
        ends = (self.sortie.start_enu_m, self.sortie.end_enu_m)
        flown = [point for leg in self.sortie.legs for point in self._flown(leg)]
        ways = (*self.sortie.up_m, *(up_m for leg in self.sortie.legs for up_m in leg.up_m))
        heights_m = [*(point[2] for point in (*ends, *flown)), *ways]
        return min(heights_m), max(*heights_m, *(end[2] + self.layer_m for end in ends))

    def lat_lon_deg(self, point_enu_m: Sequence[float]) -> tuple[float, float]:
        """Latitude and longitude of a place [deg]."""
        lat_deg, lon_deg, _ = wgs84_from_enu(self.origin, (point_enu_m[0], point_enu_m[1], 0.0))
        if abs(lon_deg) > 180.0:  # beyond the date line
            lon_deg -= math.copysign(360.0, lon_deg)
        return lat_deg, lon_deg

    def _list(self) -> None:
        here = _raised(self.sortie.start_enu_m, self.layer_m)
        self._at(MavCommand.TAKEOFF, 0.0, here)
        self._do(MavCommand.CHANGE_SPEED, _GROUND_SPEED, self.uav.speed_m_s, _THROTTLE_AS_IT_IS)
        for leg in self.sortie.legs:
            points = self._flown(leg)
            self._way(here, leg.via_enu_m, points[0], leg.up_m)
            self._work(leg, points)
            here = points[-1]
        end = _raised(self.sortie.end_enu_m, self.layer_m)
        self._way(here, self.sortie.via_enu_m, end, self.sortie.up_m)
        if self.terrain is not None:
            # A return to launch is straight, and LAND flies there as high as it is: not over hills.
            self._at(MavCommand.WAYPOINT, 0.0, end)
        elif self.sortie.end_enu_m == self.sortie.start_enu_m:
            self._do(MavCommand.RETURN_TO_LAUNCH)
            return
        self._at(MavCommand.LAND, 0.0, self.sortie.end_enu_m)

    def _flown(self, leg: Leg) -> Sequence[_Point]:
        """Where a task is flown, in the order of flight [m; ENU]."""
        task = leg.task
        points: Sequence[_Point] = task.path_enu_m or (task.position_enu_m,)
        if self.terrain is not None:
            points = points_over(ground_of(self.terrain), points, task.height_m)
        if leg.is_reversed:
            points = points[::-1]
        if self.terrain is not None and task.height_m is not None:
            return points
        if task.height_m is None:
            return [_raised(point, self.layer_m) for point in points]
        return [(*point[:2], task.height_m) for point in points]

    def _way(
        self,
        here: _Point,
        via: Sequence[tuple[float, float]],
        there: _Point,
        up_m: Sequence[float],
    ) -> None:
        """Waypoints at the corners of a way, which climbs or sinks evenly along it unless told."""
        corners = [here[:2], *via, there[:2]]
        along_m = np.cumsum([math.dist(*piece) for piece in pairwise(corners)])
        share = along_m / along_m[-1] if along_m[-1] > 0.0 else np.ones(len(along_m))
        evenly_m = here[2] + share * (there[2] - here[2])
        for corner, height_m in zip(via, up_m or evenly_m.tolist(), strict=False):
            self._at(MavCommand.WAYPOINT, 0.0, (*corner, height_m))

    def _work(self, leg: Leg, points: Sequence[_Point]) -> None:
        task, first = leg.task, len(self._items) + 1
        if len(points) == 1:
            self._at(MavCommand.WAYPOINT, leg.wait_s + task.service_s, points[0])
            self._remember(leg, first, first)
            return
        self._at(MavCommand.WAYPOINT, leg.wait_s, points[0])
        if (middle_m := structure_middle_m(task.kind, points)) is not None:
            # Who has no gimbal that turns points its nose there, with either firmware.
            level_with_it = (*middle_m, points[0][2])
            self._at(MavCommand.SET_ROI_LOCATION, 0.0, level_with_it, heading=0.0)
        if task.trigger_m is not None:
            self._do(MavCommand.SET_CAM_TRIGG_DIST, task.trigger_m, 0, _PICTURE_AT_ONCE)
        for point in points[1:-1]:
            self._at(MavCommand.WAYPOINT, 0.0, point)
        self._at(MavCommand.WAYPOINT, task.service_s, points[-1])
        self._remember(leg, first, len(self._items))
        if task.trigger_m is not None:
            self._do(MavCommand.SET_CAM_TRIGG_DIST, 0, 0, _PICTURE_AT_ONCE)
        if middle_m is not None:
            self._do(MavCommand.SET_ROI_NONE)

    def _remember(self, leg: Leg, first: int, last: int) -> None:
        in_layer = leg.task.height_m is None
        said = dict(_said_of(leg.task))
        self._tasks.append(ExportedTask(said, first, last, in_layer, leg.is_reversed))

    def _at(
        self,
        command: MavCommand,
        first: float,
        point_enu_m: _Point,
        heading: float | None = None,
    ) -> None:
        """An item at a place; no heading, so the vehicle keeps to its own setting.

        ArduPilot takes none but of what is flown to: there it is 0, which means nothing.
        """
        up_m = point_enu_m[2] - self.sortie.start_enu_m[2]
        self._items.append(
            {
                "AMSLAltAboveTerrain": None,
                "Altitude": up_m,
                "AltitudeMode": _RELATIVE,
                "command": int(command),
                "frame": int(MavFrame.GLOBAL_RELATIVE),
                "params": [first, 0, 0, heading, *self.lat_lon_deg(point_enu_m), up_m],
            }
        )

    def _do(self, command: MavCommand, *params: float) -> None:
        """An item without a place."""
        filled = [*params, *[0] * (7 - len(params))]
        self._items.append(
            {"command": int(command), "frame": int(MavFrame.MISSION), "params": filled}
        )


def _raised(point_enu_m: _Point, layer_m: float) -> _Point:
    east_m, north_m, up_m = point_enu_m
    return east_m, north_m, up_m + layer_m


def _said_of(task: Task) -> Iterator[tuple[str, object]]:
    """What items do not tell of a task, by the keys of a scenario; defaults left out."""
    yield "id", task.id
    yield "value", task.value
    for key, value, default in (
        ("service_s", task.service_s, 0.0),
        ("kind", task.kind, None),
        ("appears_s", task.appears_s, 0.0),
        ("due_s", task.due_s, None),
        ("opens_s", task.opens_s, 0.0),
        ("closes_s", task.closes_s, None),
        ("trigger_m", task.trigger_m, None),
    ):
        if value != default:
            yield key, value
