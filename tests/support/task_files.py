"""Files of tasks that people have, and what reading them gives: tables, or lines of faults."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from swarm.model import Origin
from swarm.runtime.errors import InputError
from swarm.scenario.task_files import ReadOptions, TaskFile
from swarm.scenario.task_files.csv_file import read_csv
from swarm.scenario.task_files.geojson_file import read_geojson
from swarm.scenario.task_files.plan_file import read_plan
from swarm.scenario.task_files.point_lists import read_fence, read_rally, read_text_file
from swarm.scenario.task_files.waypoints_file import read_waypoints

DATA = Path(__file__).parents[1] / "data" / "task_files"
HOME = Origin(47.0, 8.0, 400.0)
READERS = {
    ".plan": read_plan,
    ".waypoints": read_waypoints,
    ".geojson": read_geojson,
    ".csv": read_csv,
    ".fen": read_fence,
    ".rally": read_rally,
    ".txt": read_text_file,
}
"""Of files that are text."""


def tables(file: TaskFile) -> list[Mapping[str, object]]:
    return [entry.table for entry in file.entries]


def lines(suffix: str, text: str, home: Origin | None = None) -> list[str]:
    """The lines that a wrong file takes; none for a right one."""
    try:
        READERS[suffix](text, ReadOptions("f", home))
    except InputError as error:
        return str(error).splitlines()
    return []


def wp(identity: str, lat_deg: float, lon_deg: float, alt_m: float) -> dict[str, object]:
    return {"id": identity, "lat_deg": lat_deg, "lon_deg": lon_deg, "alt_m": alt_m}


TERRAIN = (
    "its height is above the ground there, which the file does not know; "
    "give heights above launch or above mean sea level, or name the ground: --terrain DEM, or "
    "[terrain] in the scenario"
)
