"""Files that tasks come from: QGroundControl plans, waypoint files, GeoJSON and CSV."""

from swarm.scenario.task_files.read import SUFFIXES, read_task_file
from swarm.scenario.task_files.task_file import FileTask, ReadOptions, TaskFile

__all__ = ["SUFFIXES", "FileTask", "ReadOptions", "TaskFile", "read_task_file"]
