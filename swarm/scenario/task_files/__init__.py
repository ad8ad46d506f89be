"""Files that tasks come from: plans of ground stations, maps, Shapefiles and tables."""

from swarm.scenario.task_files.read import (
    SUFFIXES,
    ImportOptions,
    read_task_file,
    read_task_files,
)
from swarm.scenario.task_files.task_file import FileEntry, ReadOptions, TaskFile

__all__ = [
    "SUFFIXES",
    "FileEntry",
    "ImportOptions",
    "ReadOptions",
    "TaskFile",
    "read_task_file",
    "read_task_files",
]
