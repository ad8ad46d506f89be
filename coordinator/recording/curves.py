"""Numbers and states of a mission as they change: what viewers plot, tabulate and draw as bands.

Schemas are as plain as the readers of viewers are: no references, and no `null`. What is not known
is left out of a message. Leaves out: what is drawn (coordinator.recording.foxglove_topics).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any, Final

from pydantic import TypeAdapter

from coordinator.mission_view.mission_state import MissionState
from coordinator.mission_view.scene import LEFT_OUT, TAKEN, Scene
from coordinator.mission_view.uav_state import UavView
from coordinator.recording.records import FileMessage
from swarm.protocol.board import TaskState

PROGRESS: Final = "peckorder.Progress"
FLEET: Final = "peckorder.Fleet"


@dataclass(frozen=True, slots=True)
class PlottedProgress:
    """How far the mission is, as numbers that can be plotted."""

    now_s: float
    mission_s: float | None
    phase: str
    epoch: int | None
    rule: str | None
    objective: float
    """J so far [value·s]."""
    plan_objective: float | None
    """J of the lists it began with, flown without delay [value·s]."""
    bound: float | None
    """No lists have more than this J [value·s]."""
    open: int
    """Tasks nobody flies to."""
    taken: int
    """Open tasks that a UAV flies to or serves."""
    done: int
    failed: int
    withdrawn: int
    uavs: int
    lost: int
    """UAVs that disappeared while they took part."""
    dropped: int
    """Messages that all agents together have dropped."""
    left_out: int
    """Open tasks that the plan leaves out."""
    nearest_now_m: float | None
    """Of the two UAVs in flight that are nearest to each other."""
    nearest_m: float | None
    """The nearest that two have come to each other so far."""
    separation_m: float | None
    """That is to be kept."""


@dataclass(frozen=True, slots=True)
class PlottedUav:
    """One UAV, as it stands."""

    id: str
    does: str
    goal: str | None
    """The task or base that it has taken."""
    battery_frac: float | None
    speed_m_s: float | None
    up_m: float | None
    """Height above the mission's origin, its layer included."""
    eta_s: float | None
    """Until its goal is reached or done [s of mission]."""
    sortie_left_s: float | None
    """Until it must have landed, its reserve kept [s of mission]."""
    done: int
    """Tasks it has done."""
    link_age_s: float | None
    """Since it last said something [s of the recorder's clock]."""


@dataclass(frozen=True, slots=True)
class PlottedFleet:
    """All UAVs of the mission, in its order."""

    uavs: tuple[PlottedUav, ...]


_PROGRESS: Final = TypeAdapter(PlottedProgress)
_FLEET: Final = TypeAdapter(PlottedFleet)


def _plain(schema: dict[str, Any], named: dict[str, Any]) -> dict[str, Any]:
    """The same without references, alternatives to `null`, and titles."""
    if "$ref" in schema:
        return _plain(named[schema["$ref"].rpartition("/")[2]], named)
    if "anyOf" in schema:
        (known,) = (each for each in schema["anyOf"] if each != {"type": "null"})
        return _plain(known, named)
    plain = {"type": schema["type"]}
    if "properties" in schema:
        fields = schema["properties"]
        plain["properties"] = {name: _plain(field, named) for name, field in fields.items()}
        plain["required"] = [name for name in schema["required"] if "anyOf" not in fields[name]]
    if "items" in schema:
        plain["items"] = _plain(schema["items"], named)
    return plain


def _schema(title: str, adapter: TypeAdapter[Any]) -> bytes:
    shape = adapter.json_schema(mode="serialization")
    plain = {"title": title, **_plain(shape, shape.get("$defs", {}))}
    return json.dumps(plain, separators=(",", ":")).encode()


CURVE_SCHEMAS: Final = {PROGRESS: _schema(PROGRESS, _PROGRESS), FLEET: _schema(FLEET, _FLEET)}


def progress_of(mission_state: MissionState, scene: Scene, now_s: float) -> FileMessage:
    """How far the mission is at ``now_s``."""
    plan, counts = mission_state.plan, scene.counts
    now, ever = scene.nearest_now, scene.nearest
    progress = PlottedProgress(
        now_s=now_s,
        mission_s=scene.mission_s,
        phase=scene.phase,
        epoch=scene.epoch,
        rule=scene.rule,
        objective=scene.objective,
        plan_objective=scene.planned_objective,
        bound=plan.bound if scene.optimum is None and plan is not None else scene.optimum,
        open=counts[TaskState.OPEN] + counts[LEFT_OUT],
        taken=counts[TAKEN],
        done=counts[TaskState.DONE],
        failed=counts[TaskState.FAILED],
        withdrawn=counts[TaskState.WITHDRAWN],
        uavs=len(scene.uavs),
        lost=len(mission_state.lost),
        dropped=scene.dropped,
        left_out=len(scene.left_out),
        nearest_now_m=None if now is None else now.distance_m,
        nearest_m=None if ever is None else ever.distance_m,
        separation_m=scene.mission.separation_m,
    )
    return FileMessage("/progress", PROGRESS, _PROGRESS.dump_json(progress, exclude_none=True))


def fleet_of(scene: Scene) -> FileMessage:
    """How every UAV stands."""
    fleet = PlottedFleet(tuple(_plotted(view) for view in scene.uavs))
    return FileMessage("/fleet", FLEET, _FLEET.dump_json(fleet, exclude_none=True))


def _plotted(view: UavView) -> PlottedUav:
    place, velocity = view.in_layer_enu_m, view.velocity_enu_m_s
    return PlottedUav(
        id=view.id,
        does=view.now_does,
        goal=view.goal,
        battery_frac=_shown(view.battery_frac),
        speed_m_s=None if velocity is None else _shown(math.hypot(*velocity)),
        up_m=None if place is None else _shown(place[2]),
        eta_s=_shown(view.now_eta_s),
        sortie_left_s=_shown(view.sortie_left_s),
        done=len(view.flown),
        link_age_s=_shown(view.link_age_s),
    )


def _shown(number: float | None) -> float | None:
    """As many digits as a curve or a table has room for."""
    return None if number is None else round(number, 3)
