"""Frozen data of a mission and its invariants; no files, no wire, no decisions."""

from swarm.model.frames import Origin
from swarm.model.ids import TaskId, UavId, valid_id
from swarm.model.mission import Mission, Task, Uav
from swarm.model.plan import Evaluation, Plan

__all__ = ["Evaluation", "Mission", "Origin", "Plan", "Task", "TaskId", "Uav", "UavId", "valid_id"]
