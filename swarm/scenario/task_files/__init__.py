"""Files that tasks come from: QGroundControl plans, waypoint files, GeoJSON and CSV."""

from swarm.scenario.task_files.entries import Entry, Request, TaskFile
from swarm.scenario.task_files.read import SUFFIXES, read_task_file

__all__ = ["SUFFIXES", "Entry", "Request", "TaskFile", "read_task_file"]
