"""Places of files in the keys of a scenario, once it is known where the home is.

A scenario has holes, and points of lines with heights, in metres from its origin alone; where it
knows the ground, places stand on it and have no heights of their own. Places that are too far from
home for anybody to fly there are refused: most often longitude and latitude are swapped, or the
home is that of another mission.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from swarm.model import Origin
from swarm.model.frames import enu_from_wgs84
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of
from swarm.scenario.task_files.task_file import FileEntry, TaskFile

_FARTHEST_M = 500_000.0
"""From home, of any place in degrees [m]."""


def in_scenario_keys(file: TaskFile, *, has_terrain: bool = False) -> TaskFile:
    """``file`` with no keys but those of a scenario, which knows the ground or not.

    Raises:
        InputError: places are too far from home.
    """
    home = file.home
    if home is None:
        return file
    faults = [fault for entry in file.all_entries if (fault := _too_far(entry, home)) is not None]
    if faults:
        raise InputError(*faults)
    if has_terrain:
        file = _on_ground(file)
    return replace(
        file,
        entries=tuple(_placed(entry, home) for entry in file.entries),
        areas=tuple(_placed(entry, home) for entry in file.areas),
        zones=tuple(_placed(entry, home) for entry in file.zones),
    )


def _on_ground(file: TaskFile) -> TaskFile:
    """``file`` without heights of places; what is flown at a height of its own keeps that."""
    entries: list[FileEntry] = []
    dropped = 0
    for entry in file.entries:
        table = {key: value for key, value in entry.table.items() if key != "alt_m"}
        if "path" in table:
            table["path"] = [[*point[:2]] for point in _points(table["path"])]
        dropped += table != entry.table
        entries.append(replace(entry, table=table))
    notes = list(file.notes)
    if dropped:
        notes.append(f"heights of {dropped} tasks are left out, as they stand on the ground now")
    if file.below_m is not None and any("height_m" in e.table for e in (*entries, *file.areas)):
        notes.append("lines are flown as high above the ground as they were planned above home")
    return replace(file, entries=tuple(entries), notes=tuple(notes))


def _too_far(entry: FileEntry, home: Origin) -> Fault | None:
    points = [*_points(entry.table.get("path")), *_points(entry.table.get("polygon"))]
    if "lat_deg" in entry.table:
        points.append([entry.table["lat_deg"], entry.table.get("lon_deg")])
    for point in points:
        east_m, north_m, _ = _local_m(point[:2], home)
        if (away_m := math.hypot(east_m, north_m)) > _FARTHEST_M:
            problem = f"lies {away_m / 1000.0:.0f} km from home"
            remedy = "give another --home, or latitude and longitude the other way round"
            return Fault(entry.source, entry.place, problem, remedy)
    return None


def _points(value: object) -> Sequence[Sequence[object]]:
    return value if isinstance(value, list) else ()


def _placed(entry: FileEntry, home: Origin) -> FileEntry:
    table = dict(entry.table)
    path, holes = table.get("path"), table.pop("holes", None)
    if isinstance(path, list) and any(len(point) > 2 for point in path):
        del table["path"]
        table["path_m"] = [_local_m(point, home) for point in path]
    if isinstance(holes, list):
        table["holes_m"] = [[_local_m(corner[:2], home)[:2] for corner in hole] for hole in holes]
    if table == entry.table:
        return entry
    return replace(entry, table=_in_order(table, entry.table))


def _local_m(point: Sequence[object], home: Origin) -> list[float]:
    """East, north and up of home [m]; a point without a height lies as high as home."""
    lat_deg, lon_deg, *alt_m = (number_of(each) or 0.0 for each in point)
    return list(enu_from_wgs84(home, lat_deg, lon_deg, alt_m[0] if alt_m else home.alt_m))


def _in_order(table: Mapping[str, object], before: Mapping[str, object]) -> dict[str, object]:
    """Keys where those were whose place they take."""
    names = {"path": "path_m", "holes": "holes_m"}
    found: dict[str, object] = {}
    for key in before:
        name = key if key in table else names[key]
        found[name] = table[name]
    return found
