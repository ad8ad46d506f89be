"""What is drawn from the facts for people and their tools: map, scene and story.

Everything here follows from what is known of the mission; nothing of it is read back. Each scene
message shows one kind of thing whole, so that a viewer may begin anywhere.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from typing import Final

from coordinator.mission_view.drawing import (
    AREA_COLOUR,
    BASE_COLOUR,
    GREY,
    STATE_COLOURS,
    STILL_M_S,
    UNENDED,
    WHITE,
    ZONE_COLOUR,
    Colour,
    colour_of,
    drawn_size_m,
    raised,
    ways_ahead,
)
from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.scene import LEFT_OUT, Scene, scene_of
from coordinator.mission_view.uav_state import LOST, UavView
from coordinator.recording.curves import fleet_of, progress_of
from coordinator.recording.foxglove_schemas import (
    LOCATION_FIX,
    LOG,
    SCENE_UPDATE,
    Json,
    Point,
    arrow,
    cube,
    entity,
    line_strip,
    location_fix,
    log,
    scene_update,
    sphere,
    text,
)
from coordinator.recording.records import FileMessage
from swarm.model import Area, Base, Origin, Zone
from swarm.model.frames import wgs84_from_enu

FRAME: Final = "mission"
"""Name of the local frame: metres east, north and up of the mission's origin."""
MOST_LABELS: Final = 150
"""A scene of more tasks shows them without their names."""
_LEVEL: Final = re.compile(r"""\blevel["']?[=:] ?["']?(\w+)""")
"""In lines of logfmt and in JSON."""


class FoxgloveTopics:
    """Draws what has changed since the last time."""

    def __init__(self) -> None:
        self._places: dict[str, Point] = {}
        self._tasks: tuple[object, ...] = ()
        self._lists: tuple[object, ...] = ()
        self._zones: tuple[Zone, ...] = ()
        self._drawn: set[str] = set()
        """Zones that were shown: of one that was taken away nothing is to stay."""
        self._areas: tuple[Area, ...] = ()
        self._bases: tuple[tuple[Base, str], ...] = ()
        self._told = 0
        """Lines of the story that have been told."""

    def draw(
        self, mission_state: MissionState, now_s: float, time_ns: int
    ) -> Iterator[FileMessage]:
        """All that is worth showing at ``now_s``, as of wall time ``time_ns``."""
        yield from self._story(mission_state, time_ns)
        if mission_state.replica.brief is None:
            return
        scene = scene_of(mission_state, now_s)
        yield progress_of(mission_state, scene, now_s)
        yield fleet_of(scene)
        yield from self._fixes(scene, Origin(*mission_state.replica.brief.origin), time_ns)
        size_m = drawn_size_m(scene)
        yield _scene("uavs", [_uav(view, size_m, time_ns) for view in scene.uavs])
        yield from self._field(scene, size_m, time_ns)
        tasks = tuple(
            (task.id, task.position_enu_m, task.stands, scene.left_out.get(task.id))
            for task in scene.tasks
        )
        if tasks != self._tasks:
            self._tasks = tasks
            yield _scene("tasks", _task_entities(scene, size_m, time_ns))
        lists = _lists(scene)
        if lists != self._lists:
            self._lists = lists
            entities = [
                entity(uav, FRAME, time_ns, {}, lines=[line_strip(points, colour, 2.0)])
                for uav, points, colour in lists
            ]
            yield _scene("lists", entities)

    def _field(self, scene: Scene, size_m: float, time_ns: int) -> Iterator[FileMessage]:
        """Areas, zones in force, and bases with who is there; nothing of what there is none of."""
        if scene.mission.areas != self._areas:
            self._areas = scene.mission.areas
            yield _scene("areas", [_area(area, time_ns) for area in self._areas])
        zones = scene.mission.zones
        if zones != self._zones:
            self._zones = zones
            names = {zone.id for zone in zones}
            gone = [entity(f"zone {name}", FRAME, time_ns, {}) for name in self._drawn - names]
            self._drawn |= names
            yield _scene("zones", [*gone, *(_zone(zone, time_ns) for zone in zones)])
        bases = tuple((base, _visitors(scene, base)) for base in scene.mission.bases)
        if bases != self._bases:
            self._bases = bases
            yield _scene("bases", [_base(base, who, size_m, time_ns) for base, who in bases])

    def _story(self, mission_state: MissionState, time_ns: int) -> Iterator[FileMessage]:
        for happening in mission_state.told_since(self._told):
            when = "" if happening.mission_s is None else f"[{happening.mission_s:.2f} s] "
            level = "warning" if happening.is_trouble else "info"
            yield log_line("story", when + happening.text, level, time_ns)
        self._told = mission_state.told

    def _fixes(self, scene: Scene, origin: Origin, time_ns: int) -> Iterator[FileMessage]:
        for view in scene.uavs:
            if self._places.get(view.id) == view.place_enu_m:
                continue
            self._places[view.id] = view.place_enu_m
            at = raised(view.place_enu_m, view.layer_m)
            fix = location_fix(
                view.id, time_ns, *wgs84_from_enu(origin, at), colour_of(view.number)
            )
            yield FileMessage(f"/uav/{view.id}/fix", LOCATION_FIX, _bytes(fix))


def level_of(line: str) -> str:
    """Level of a line that one of our processes has logged; empty when it tells none."""
    found = _LEVEL.search(line)
    return "" if found is None else found[1].lower()


def log_line(name: str, message: str, level: str, time_ns: int) -> FileMessage:
    """A line of the story, or of a process's log."""
    return FileMessage("/log", LOG, _bytes(log(name, message, level, time_ns)))


def _scene(name: str, entities: list[Json]) -> FileMessage:
    return FileMessage(f"/scene/{name}", SCENE_UPDATE, _bytes(scene_update(entities)))


def _uav(view: UavView, size_m: float, time_ns: int) -> Json:
    colour = GREY if view.troubled else colour_of(view.number)
    at = raised(view.place_enu_m, view.layer_m)
    facts = {"does": str(view.does), "task": view.task or "", "note": view.note}
    if view.battery_frac is not None:
        facts["battery"] = f"{view.battery_frac:.0%}"
    if view.base is not None:
        facts |= {"base": view.base, "visit": view.visit or ""}
    if view.sortie_left_s is not None:
        facts["sortie left"] = f"{view.sortie_left_s:.0f} s"
    if view.swaps:
        facts["swaps"] = str(view.swaps)
    label = f"{view.id} {view.does.upper()}" if view.does == LOST else view.id
    # Sphere and arrow: where it is, and where to, as far as that is known.
    shapes: dict[str, list[Json]] = {
        "spheres": [sphere(at, size_m, colour)],
        "texts": [text(raised(at, size_m), label, WHITE)],
    }
    east_m_s, north_m_s, _ = view.velocity_enu_m_s or (0.0, 0.0, 0.0)
    if math.hypot(east_m_s, north_m_s) > STILL_M_S:
        yaw_rad = math.atan2(north_m_s, east_m_s)
        shapes["arrows"] = [arrow(at, yaw_rad, 2.0 * size_m, colour)]
    return entity(view.id, FRAME, time_ns, facts, **shapes)


def _zone(zone: Zone, time_ns: int) -> Json:
    """Its borders, on its floor and below its ceiling where it has them."""
    heights_m = {zone.floor_m or 0.0} | ({zone.ceiling_m} if zone.ceiling_m is not None else set())
    lines = [
        line_strip(
            [(east_m, north_m, up_m) for east_m, north_m in (*ring, ring[0])], ZONE_COLOUR, 3.0
        )
        for ring in (zone.polygon_enu_m, *zone.holes_enu_m)
        for up_m in sorted(heights_m)
    ]
    bounds = {"floor": zone.floor_m, "ceiling": zone.ceiling_m}
    facts = {name: f"{up_m:g} m" for name, up_m in bounds.items() if up_m is not None}
    if zone.inclusive:
        facts["inclusive"] = "nobody may leave it"
    east_m, north_m = zone.polygon_enu_m[0]
    label = text((east_m, north_m, zone.floor_m or 0.0), zone.id, WHITE)
    return entity(f"zone {zone.id}", FRAME, time_ns, facts, lines=lines, texts=[label])


def _area(area: Area, time_ns: int) -> Json:
    """Its borders, on the ground."""
    lines = [
        line_strip(
            [(east_m, north_m, 0.0) for east_m, north_m in (*ring, ring[0])], AREA_COLOUR, 2.0
        )
        for ring in (area.polygon_enu_m, *area.holes_enu_m)
    ]
    east_m, north_m = area.polygon_enu_m[0]
    facts = {"lines": str(area.lines), "value": f"{area.value:g}"}
    label = text((east_m, north_m, 0.0), area.id, WHITE)
    return entity(f"area {area.id}", FRAME, time_ns, facts, lines=lines, texts=[label])


def _visitors(scene: Scene, base: Base) -> str:
    """Who is there or on the way, and what about."""
    return ", ".join(
        f"{uav.id} {uav.visit}" for uav in scene.uavs if uav.base == base.id and uav.visit
    )


def _base(base: Base, who: str, size_m: float, time_ns: int) -> Json:
    facts = {"swap": f"{base.swap_s:g} s", "uavs": who}
    if base.slots is not None:
        facts["slots"] = str(base.slots)
    solid = cube(base.position_enu_m, size_m, BASE_COLOUR)
    label = text(raised(base.position_enu_m, size_m), base.id, WHITE)
    return entity(f"base {base.id}", FRAME, time_ns, facts, cubes=[solid], texts=[label])


def _task_entities(scene: Scene, size_m: float, time_ns: int) -> list[Json]:
    """One entity for each state: what nobody has ended is a ball, what is over a box.

    Lines to fly along are drawn besides.

    That of the tasks that the plan leaves out tells why.
    """
    tasks, entities = scene.tasks, []
    for state, colour in STATE_COLOURS.items():
        mine = [task.position_enu_m for task in tasks if task.stands == state]
        shape, kind = (sphere, "spheres") if state in UNENDED else (cube, "cubes")
        solids = [shape(at, size_m, colour) for at in mine]
        ways = [
            line_strip(task.path_enu_m, colour, 2.0)
            for task in tasks
            if task.stands == state and task.path_enu_m
        ]
        facts = scene.left_out if state == LEFT_OUT else {"tasks": str(len(mine))}
        name = state.replace("_", " ")
        entities.append(entity(name, FRAME, time_ns, facts, lines=ways, **{kind: solids}))
    if len(tasks) <= MOST_LABELS:
        labels = [text(raised(t.position_enu_m, -size_m), t.id, WHITE) for t in tasks]
        entities.append(entity("names", FRAME, time_ns, {}, texts=labels))
    return entities


def _lists(scene: Scene) -> tuple[tuple[str, tuple[Point, ...], Colour], ...]:
    """What each UAV's list still holds, in the colour of the UAV."""
    ahead = ways_ahead(scene)
    return tuple((str(uav.id), ahead[uav.id], colour_of(uav.number)) for uav in scene.uavs)


def _bytes(message: Json) -> bytes:
    return json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
