"""QGroundControl's plans (``.plan``): waypoints, surveys, scans and the geofence.

Format: https://docs.qgroundcontrol.com/master/en/qgc-dev-guide/file_formats/plan.html.
Surveys and scans become areas and lines (swarm.scenario.task_files.survey_patterns). Of other
complex items the mission items that QGroundControl has stored with them are taken; without them,
the corners of their transects. Rally points and what a vehicle does on the way (regions of
interest, gimbals) are left out.

A plan that Peckorder has exported says which of its waypoints are tasks and which lead round zones
(coordinator.export writes it); saved by QGroundControl it says so no more.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.exported_tasks import exported_tasks
from swarm.scenario.task_files.fences import circle_zone, polygon_zone
from swarm.scenario.task_files.mission_items import (
    BELOW_M,
    Heights,
    MavCommand,
    MavFrame,
    WaypointItem,
    left_out_of,
    tasks_of,
    whole_of,
)
from swarm.scenario.task_files.survey_patterns import TRANSECTS, PatternReader
from swarm.scenario.task_files.task_file import (
    FileEntry,
    ReadOptions,
    TaskFile,
    gather,
    member,
    parse_object,
)

LAYER_KEY = "peckorder"
"""Top-level key under which an exported plan keeps its height layer, for the way back."""

_WHAT = "a plan saved by QGroundControl"
_HOME = "mission.plannedHomePosition"
_LANDINGS = ("fwLandingPattern", "vtolLandingPattern")
_FIXED_WING = 1


def read_plan(text: str, request: ReadOptions) -> TaskFile:
    """What is in a plan.

    Raises:
        InputError: with every fault of the plan.
    """
    document = parse_object(text, request.source, _WHAT)
    mission = _mission(document, request.source)
    home = request.home or _home(mission)
    ours = member(document, LAYER_KEY)
    below_m = request.below_m
    if below_m is None:
        layer_m = number_of(member(ours, "layer_m"))
        below_m = BELOW_M if layer_m is None else layer_m
    homeless = Fault(
        request.source,
        _HOME,
        "is no place with a height, and heights are counted from it",
        "give the home in QGroundControl, or --home LAT,LON,ALT, or [origin] in the scenario",
    )
    heights = Heights(home, below_m, homeless, request.has_terrain)
    patterns = PatternReader(request.source, heights)
    reading = _PlanItems(request, heights, patterns)
    for place, value in _numbered("mission.items", mission["items"]):
        reading.take(place, value)
    tasks = None if request.visits_alone else exported_tasks(ours, reading.items, heights)
    found = [*reading.found, *reading.visits()] if tasks is None else [*reading.found, *tasks]
    zones, unfenced = _fence(document, request.source)
    rally = Counter("rally point" for _ in _numbered("", member(document, "rallyPoints", "points")))
    return gather(
        request,
        [*found, *zones],
        "add waypoints or a survey in QGroundControl",
        home=home,
        speed_m_s=_speed_m_s(mission),
        below_m=below_m,
        left_out=left_out_of(reading.items, visits_alone=request.visits_alone)
        + reading.left_out
        + patterns.left_out
        + unfenced
        + rally,
        notes=patterns.notes,
    )


class _PlanItems:
    """Sorts the entries of ``items`` into what is flown to and what is covered."""

    def __init__(self, request: ReadOptions, heights: Heights, patterns: PatternReader) -> None:
        self.items: list[WaypointItem] = []
        """All that are waypoints, or tell something of them."""
        self.found: list[FileEntry | Fault] = []
        self.left_out: Counter[str] = Counter()
        self._request, self._heights, self._patterns = request, heights, patterns

    def take(self, place: str, value: object) -> None:
        """One entry more."""
        if member(value, "complexItemType") in _LANDINGS:
            self.left_out["landing pattern"] += 1
            return
        entries = None
        if member(value, "type") == "ComplexItem" and not self._request.visits_alone:
            entries = self._patterns.entries(place, value)
        if entries is not None:
            self.found += entries
            return
        for item in _items(place, value, self._request.source):
            if isinstance(item, WaypointItem):
                self.items.append(item)
            else:
                self.found.append(item)

    def visits(self) -> Sequence[FileEntry | Fault]:
        """Tasks of the waypoints."""
        return tasks_of(self.items, self._heights, visits_alone=self._request.visits_alone)


def _fence(
    document: Mapping[str, object], source: str
) -> tuple[list[FileEntry | Fault], Counter[str]]:
    """Polygons and circles of the geofence as zones, and how much of the rest of it there is."""
    zones: list[FileEntry | Fault] = []
    rest: Counter[str] = Counter()
    fence = document.get("geoFence")
    for place, value in _numbered("geoFence.polygons", member(fence, "polygons")):
        corners, inclusion = member(value, "polygon"), member(value, "inclusion")
        if not isinstance(corners, list) or not isinstance(inclusion, bool):
            rest["geofence polygon"] += 1
            continue
        zones.append(polygon_zone(corners, source, place, inclusive=inclusion))
    for place, value in _numbered("geoFence.circles", member(fence, "circles")):
        center, radius = member(value, "circle", "center"), member(value, "circle", "radius")
        inclusion = member(value, "inclusion")
        if not isinstance(inclusion, bool) or not number_of(radius):
            rest["geofence circle"] += 1
            continue
        zones.append(circle_zone(center, radius, source, place, inclusive=inclusion))
    rest.update("geofence return point" for _ in [0] if member(fence, "breachReturn"))
    return zones, rest


def _mission(document: Mapping[str, object], source: str) -> Mapping[str, object]:
    mission = document.get("mission")
    if document.get("fileType") != "Plan":
        problem = f"{shown(document.get('fileType', 'nothing'))} is not 'Plan'"
        fault = Fault(source, "fileType", problem, f"give {_WHAT}")
    elif document.get("version") != 1:
        problem = f"version {shown(document.get('version', 'missing'))} of the format is not known"
        fault = Fault(source, "version", problem, "give version 1, as QGroundControl writes")
    elif not isinstance(mission, Mapping):
        fault = Fault(source, "mission", "is not an object", f"give {_WHAT}")
    elif mission.get("version", 2) != 2:
        problem = f"version {shown(mission['version'])} of the format is not known"
        fault = Fault(
            source, "mission.version", problem, "give version 2, as QGroundControl writes"
        )
    elif not isinstance(mission.get("items"), list):
        fault = Fault(source, "mission.items", "is not an array", f"give {_WHAT}")
    else:
        return mission
    raise InputError(fault)


def _home(mission: Mapping[str, object]) -> Origin | None:
    """The planned home; None unless it is a place with a height."""
    place = mission.get("plannedHomePosition")
    numbers = [number_of(value) for value in place] if isinstance(place, list) else []
    match numbers:
        case [float(lat_deg), float(lon_deg), float(alt_m)]:
            try:
                return Origin(lat_deg, lon_deg, alt_m)
            except ValueError:
                return None
        case _:
            return None


def _speed_m_s(mission: Mapping[str, object]) -> float | None:
    fixed_wing = mission.get("vehicleType") == _FIXED_WING
    speed_m_s = number_of(mission.get("cruiseSpeed" if fixed_wing else "hoverSpeed"))
    return speed_m_s if speed_m_s is not None and speed_m_s > 0.0 else None


def _numbered(place: str, values: object) -> Iterator[tuple[str, object]]:
    for index, value in enumerate(values if isinstance(values, list) else ()):
        yield f"{place}[{index}]", value


def _items(place: str, value: object, source: str) -> Iterator[WaypointItem | Fault]:
    """The mission items of one entry of ``items``."""
    match member(value, "type"):
        case "SimpleItem":
            yield _simple(place, value, source)
        case "ComplexItem":
            yield from _complex(place, value, source)
        case other:
            problem = f"{shown(other)} is no type of item" if other else "has no type"
            yield Fault(source, place, problem, "give 'SimpleItem' or 'ComplexItem'")


def _simple(place: str, value: object, source: str) -> WaypointItem | Fault:
    command, frame = whole_of(member(value, "command")), whole_of(member(value, "frame"))
    params = member(value, "params")
    if command is None or frame is None:
        return Fault(source, place, "has no command or no frame", "give both as whole numbers")
    if not isinstance(params, list) or len(params) != 7:
        found = f"has {len(params)} params" if isinstance(params, list) else "has no params"
        return Fault(
            source, place, f"{found} instead of 7", "save the plan again in QGroundControl"
        )
    return WaypointItem(
        command, frame, params, place, alt_m=number_of(member(value, "AMSLAltAboveTerrain"))
    )


def _complex(place: str, value: object, source: str) -> Iterator[WaypointItem | Fault]:
    stored = member(value, TRANSECTS, "Items")
    corners = member(value, TRANSECTS, "VisualTransectPoints")
    if isinstance(stored, list) and stored:
        for inner, item in _numbered(f"{place}.{TRANSECTS}.Items", stored):
            yield _simple(inner, item, source)
    elif isinstance(corners, list) and corners:
        camera = member(value, TRANSECTS, "CameraCalc")
        frame = _camera_frame(camera)
        height_m = member(camera, "DistanceToSurface")
        for inner, corner in _numbered(f"{place}.{TRANSECTS}.VisualTransectPoints", corners):
            pair = corner[:2] if isinstance(corner, list) and len(corner) >= 2 else [None, None]
            params = [0.0, 0.0, 0.0, None, *pair, height_m]
            yield WaypointItem(MavCommand.WAYPOINT, frame, params, inner)
    else:
        kind = shown(member(value, "complexItemType") or "complex item")
        remedy = "replace it by waypoints, a survey or a corridor scan"
        yield Fault(source, place, f"{kind} holds no waypoints", remedy)


def _camera_frame(camera: object) -> MavFrame:
    """What a survey's height counts from: a mode since QGroundControl 4.2, a flag before."""
    if member(camera, "DistanceToSurfaceRelative") is False:
        return MavFrame.GLOBAL
    match whole_of(member(camera, "DistanceMode")):
        case 2:
            return MavFrame.GLOBAL
        case 3 | 4:
            return MavFrame.GLOBAL_TERRAIN
        case _:
            return MavFrame.GLOBAL_RELATIVE
