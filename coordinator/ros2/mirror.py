"""What ROS 2 is told of a mission: every message from what is known of it, purely.

Places are in the frame `FRAME`: metres east, north and up of the mission's origin, each UAV in its
own height. Nothing here knows of bytes or of the network.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from coordinator.mission_view.drawing import (
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
from coordinator.mission_view.scene import Scene, scene_of
from coordinator.mission_view.uav_state import Point, UavView
from coordinator.ros2.message_types import PACKAGE, Fields
from coordinator.ros2.wire import ros_names
from swarm.model import Origin, TaskId, Zone
from swarm.model.frames import wgs84_from_enu

FRAME: Final = "map"
"""That of the world by REP 105, in which rviz shows things unless told otherwise."""
DIAGNOSTICS: Final = "/diagnostics"
"""Where tools of ROS 2 look for them, whoever publishes them."""
MARKER_S: Final = 3
"""How long a marker is shown that is not repeated [wall s]."""
_OK, _WARN, _ERROR, _STALE = 0, 1, 2, 3
"""Levels of a DiagnosticStatus."""
_SPHERE, _CUBE, _LINE_STRIP, _TEXT = 2, 1, 4, 9
"""Kinds of a Marker."""
_LINE_FRAC: Final = 0.2
"""How thick a line is, as a part of the size of a task."""


@dataclass(frozen=True, slots=True)
class RosMessage:
    """What is to be said on one topic."""

    topic: str
    """Whole, such as ``/peckorder/status``."""
    type: str
    fields: Fields
    """Without the time of its header, which is that of the moment it is said."""


def mirrored(mission_state: MissionState, node: str, now_s: float) -> list[RosMessage]:
    """Everything that is said of a mission at ``now_s``, under the name of a node."""
    brief = mission_state.replica.brief
    if brief is None:
        return []
    scene = scene_of(mission_state, now_s)
    said = [
        RosMessage(f"/{node}/status", f"{PACKAGE}/msg/MissionStatus", _status(scene)),
        RosMessage(f"/{node}/uavs", f"{PACKAGE}/msg/UavStatusArray", _uavs(scene)),
        RosMessage(f"/{node}/tasks", f"{PACKAGE}/msg/TaskArray", _tasks(mission_state, scene)),
        RosMessage(f"/{node}/claims", f"{PACKAGE}/msg/ClaimArray", _claims(mission_state)),
        RosMessage(f"/{node}/markers", "visualization_msgs/msg/MarkerArray", _markers(scene)),
        RosMessage(DIAGNOSTICS, "diagnostic_msgs/msg/DiagnosticArray", _diagnostics(scene, node)),
    ]
    if mission_state.replica.epoch is not None:
        said.append(RosMessage(f"/{node}/plan", f"{PACKAGE}/msg/Plan", _plan(mission_state)))
    names, ahead = ros_names(uav.id for uav in scene.uavs), ways_ahead(scene)
    for uav in scene.uavs:
        topic, name = f"/{node}/uav/{names[uav.id]}", names[uav.id]
        said.append(RosMessage(f"{topic}/path", "nav_msgs/msg/Path", _path(uav, ahead[uav.id])))
        if uav.told_enu_m is not None:
            earth = _on_earth(uav, Origin(*brief.origin))
            said += [
                RosMessage(f"{topic}/position", "geographic_msgs/msg/GeoPointStamped", earth),
                RosMessage(f"{topic}/odometry", "nav_msgs/msg/Odometry", _odometry(uav, name)),
            ]
    return said


def _header() -> Fields:
    return {"frame_id": FRAME}


def _number(value: float | None) -> float:
    """Of what a message has no other way to leave out."""
    return math.nan if value is None else value


def _point(at: Point) -> Fields:
    return dict(zip("xyz", at, strict=True))


# -- the mission --------------------------------------------------------------------------


def _status(scene: Scene) -> Fields:
    counts = scene.counts
    return {
        "header": _header(),
        "mission": scene.mission.name,
        "phase": scene.phase.value,
        "mission_s": _number(scene.mission_s),
        "rule": scene.rule or "",
        "objective": scene.objective,
        "planned_objective": _number(scene.planned_objective),
        **{state: counts[state] for state in STATE_COLOURS},
        "coordinator": scene.coordinator,
        "aborted": scene.aborted,
        "nearest_m": math.nan if scene.nearest is None else scene.nearest.distance_m,
    }


def _uavs(scene: Scene) -> Fields:
    return {"header": _header(), "uavs": [_uav(uav) for uav in scene.uavs]}


def _uav(uav: UavView) -> Fields:
    return {
        "id": uav.id,
        "does": uav.now_does,
        "task": uav.now_task or "",
        "eta_s": _number(uav.now_eta_s),
        "position": _point(_place(uav)),
        "velocity": _point(uav.velocity_enu_m_s or (0.0, 0.0, 0.0)),
        "battery_frac": _number(uav.battery_frac),
        "base": uav.base or "",
        "visit": uav.visit or "",
        "sortie_left_s": _number(uav.sortie_left_s),
        "swaps": uav.swaps,
        "present": uav.there,
        "link_age_s": _number(uav.link_age_s),
        "note": uav.note,
    }


def _tasks(mission_state: MissionState, scene: Scene) -> Fields:
    board = mission_state.replica.board
    values = {task.id: task.value for task in scene.mission.tasks}
    values |= {TaskId(entry.task): entry.value for entry in board.values()}
    names = [uav.id for uav in scene.uavs]
    told = [
        {
            "id": task.id,
            "state": task.stands,
            "uav": "" if task.uav is None else names[task.uav],
            "position": _point(task.position_enu_m),
            "path": [_point(each) for each in task.path_enu_m],
            "value": values[task.id],
            "left_out": task.left_out or "",
        }
        for task in scene.tasks
    ]
    return {"header": _header(), "tasks": told}


def _claims(mission_state: MissionState) -> Fields:
    told = [
        {
            "uav": uav,
            "phase": claim.phase.value,
            "task": claim.task or "",
            "base": claim.base or "",
            "stage": "" if claim.stage is None else claim.stage.value,
            "completion_s": claim.completion_s,
        }
        for uav, claim in sorted(mission_state.replica.claims.items())
    ]
    return {"header": _header(), "claims": told}


def _plan(mission_state: MissionState) -> Fields:
    epoch = mission_state.replica.epoch
    if epoch is None:
        return {}
    return {
        "header": _header(),
        "epoch": epoch.number,
        "reason": epoch.reason,
        "rule": epoch.rule,
        "sequence": list(epoch.sequence),
        "lists": [
            {"uav": uav, "tasks": list(tasks)} for uav, tasks in sorted(epoch.routes.items())
        ],
    }


def _diagnostics(scene: Scene, node: str) -> Fields:
    level, text = _OK, scene.phase.value
    if scene.cut_s is not None:
        level, text = _STALE, "the link to the fleet is down"
    elif scene.aborted:
        level, text = _WARN, "aborted by the operator"
    facts = {state.replace("_", " "): str(count) for state, count in scene.counts.items()}
    whole = _diagnostic(f"{node}: mission", level, text, scene.mission.name, facts)
    return {"header": {}, "status": [whole, *(_diagnostic_of(uav, node) for uav in scene.uavs)]}


def _diagnostic_of(uav: UavView, node: str) -> Fields:
    level = _OK
    if uav.troubled:
        level = _ERROR
    elif uav.silent_s is not None:
        level = _STALE
    elif uav.battery_low:
        level = _WARN
    facts = {"task": uav.now_task or "", "base": uav.base or ""}
    if uav.battery_frac is not None:
        facts["battery"] = f"{uav.battery_frac:.0%}"
    if uav.dropped:
        facts["messages dropped"] = str(sum(uav.dropped.values()))
    text = f"{uav.now_does}: {uav.note}" if uav.note else uav.now_does
    return _diagnostic(f"{node}: {uav.id}", level, text, str(uav.id), facts)


def _diagnostic(name: str, level: int, text: str, what: str, facts: dict[str, str]) -> Fields:
    values = [{"key": key, "value": value} for key, value in facts.items()]
    return {"name": name, "level": level, "message": text, "hardware_id": what, "values": values}


# -- each UAV -----------------------------------------------------------------------------


def _path(uav: UavView, ahead: tuple[Point, ...]) -> Fields:
    """From where it is along the way that it has ahead, in its own height."""
    place = _place(uav)
    corners = [place, *((east_m, north_m, place[2]) for east_m, north_m, _ in ahead)]
    poses = [
        {"header": _header(), "pose": {"position": _point(at), "orientation": _turned(0.0)}}
        for at in corners
    ]
    return {"header": _header(), "poses": poses}


def _on_earth(uav: UavView, origin: Origin) -> Fields:
    lat_deg, lon_deg, alt_m = wgs84_from_enu(origin, _place(uav))
    earth = {"latitude": lat_deg, "longitude": lon_deg, "altitude": alt_m}
    return {"header": _header(), "position": earth}


def _odometry(uav: UavView, name: str) -> Fields:
    """Its pose looks to where it flies, and its twist is in the frame of that pose."""
    east_m_s, north_m_s, up_m_s = uav.velocity_enu_m_s or (0.0, 0.0, 0.0)
    forwards_m_s = math.hypot(east_m_s, north_m_s)
    yaw_rad = math.atan2(north_m_s, east_m_s) if forwards_m_s > STILL_M_S else 0.0
    moving = (forwards_m_s if forwards_m_s > STILL_M_S else 0.0, 0.0, up_m_s)
    return {
        "header": _header(),
        "child_frame_id": name,
        "pose": {"pose": {"position": _point(_place(uav)), "orientation": _turned(yaw_rad)}},
        "twist": {"twist": {"linear": _point(moving)}},
    }


def _place(uav: UavView) -> Point:
    """Where it is, in its own height; its start until it has told."""
    return uav.in_layer_enu_m or uav.start_enu_m


def _turned(yaw_rad: float) -> Fields:
    """A quaternion; 0 looks east, a quarter turn north."""
    return {"z": math.sin(yaw_rad / 2.0), "w": math.cos(yaw_rad / 2.0)}


# -- what rviz draws ----------------------------------------------------------------------


def _markers(scene: Scene) -> Fields:
    size_m = drawn_size_m(scene)
    markers = [
        *_task_markers(scene, size_m),
        *(each for uav in scene.uavs for each in _uav_markers(uav, size_m)),
        *_list_markers(scene, size_m),
        *(each for zone in scene.mission.zones for each in _zone_markers(zone, size_m)),
    ]
    return {"markers": markers}


def _task_markers(scene: Scene, size_m: float) -> Iterator[Fields]:
    """What nobody has ended is a ball, what is over a box; lines are drawn besides."""
    for number, task in enumerate(scene.tasks):
        colour = STATE_COLOURS[task.stands]
        kind = _SPHERE if task.stands in UNENDED else _CUBE
        yield _solid("tasks", number, kind, task.position_enu_m, size_m, colour)
        yield _text("task names", number, task.id, raised(task.position_enu_m, size_m), size_m)
        if task.path_enu_m:
            yield _line("task lines", number, task.path_enu_m, size_m, colour)


def _uav_markers(uav: UavView, size_m: float) -> Iterator[Fields]:
    place, colour = _place(uav), GREY if uav.troubled else colour_of(uav.number)
    yield _solid("uavs", uav.number, _SPHERE, place, size_m, colour)
    label = f"{uav.id} {uav.now_does}"
    yield _text("uav names", uav.number, label, raised(place, size_m), size_m)


def _list_markers(scene: Scene, size_m: float) -> Iterator[Fields]:
    for uav, points in zip(scene.uavs, ways_ahead(scene).values(), strict=True):
        if points:
            way = (_place(uav), *points)
            yield _line("lists", uav.number, way, size_m, colour_of(uav.number))


def _zone_markers(zone: Zone, size_m: float) -> Iterator[Fields]:
    """Its borders, on its floor and below its ceiling where it has them."""
    heights_m = {zone.floor_m or 0.0} | ({zone.ceiling_m} if zone.ceiling_m is not None else set())
    number = 0
    for ring in (zone.polygon_enu_m, *zone.holes_enu_m):
        for up_m in sorted(heights_m):
            around = [(east_m, north_m, up_m) for east_m, north_m in (*ring, ring[0])]
            yield _line(f"zone {zone.id}", number, around, size_m, ZONE_COLOUR)
            number += 1


def _marker(namespace: str, number: int, kind: int, colour: Colour) -> dict[str, object]:
    red, green, blue, opacity = colour
    return {
        "header": _header(),
        "ns": namespace,
        "id": number,
        "type": kind,
        "pose": {"orientation": _turned(0.0)},
        "color": {"r": red, "g": green, "b": blue, "a": opacity},
        "lifetime": {"sec": MARKER_S},
    }


def _solid(
    namespace: str, number: int, kind: int, at: Point, size_m: float, colour: Colour
) -> Fields:
    pose = {"position": _point(at), "orientation": _turned(0.0)}
    scale = _point((size_m, size_m, size_m))
    return _marker(namespace, number, kind, colour) | {"pose": pose, "scale": scale}


def _line(
    namespace: str, number: int, points: Iterable[Point], size_m: float, colour: Colour
) -> Fields:
    told = {"points": [_point(at) for at in points], "scale": {"x": _LINE_FRAC * size_m}}
    return _marker(namespace, number, _LINE_STRIP, colour) | told


def _text(namespace: str, number: int, text: str, at: Point, size_m: float) -> Fields:
    pose = {"position": _point(at), "orientation": _turned(0.0)}
    told = {"pose": pose, "text": text, "scale": {"z": size_m}}
    return _marker(namespace, number, _TEXT, WHITE) | told
