"""Frozen data of a mission and its invariants; no files, no wire, no decisions."""

from swarm.model.areas import Area
from swarm.model.cameras import Camera
from swarm.model.frames import Origin
from swarm.model.ids import AreaId, BaseId, TaskId, UavId, ZoneId, valid_id
from swarm.model.mission import Base, Mission, Task, Uav
from swarm.model.plan import Evaluation, Plan
from swarm.model.zones import Zone

__all__ = [
    "Area",
    "AreaId",
    "Base",
    "BaseId",
    "Camera",
    "Evaluation",
    "Mission",
    "Origin",
    "Plan",
    "Task",
    "TaskId",
    "Uav",
    "UavId",
    "Zone",
    "ZoneId",
    "valid_id",
]
