"""What an exported plan says of its own items, so that it gives the same tasks again.

Waypoints alone do not tell which of them are tasks, which are points of one line, and which only
lead round a zone; nor what a task is worth. QGroundControl drops what is said here when it saves
the plan, so whatever has been changed in it is read as anybody's plan.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from swarm.scenario.findings import number_of
from swarm.scenario.task_files.mission_items import Heights, MavCommand, WaypointItem, whole_of
from swarm.scenario.task_files.task_file import LINE_KEYS, FileEntry, member

_KEYS = frozenset({*LINE_KEYS} - {"height_m"})
"""Keys of a task that are said of it; its place and height are those of its items."""


@dataclass(frozen=True, slots=True)
class ExportedTask:
    """One task among the items of a plan."""

    table: Mapping[str, object]
    """Its keys without place and height."""
    first: int
    """Number of its first item, from 1 on."""
    last: int
    """Number of its last waypoint; that of a place is the first one."""
    in_layer: bool
    """Whether its waypoints lie in the height layer of the UAV above it; else at its own height."""
    is_reversed: bool = False
    """Whether a line is flown from its last point to its first."""

    def as_json(self) -> dict[str, object]:
        """Ready for `json.dumps`."""
        return {
            "task": dict(self.table),
            "first": self.first,
            "last": self.last,
            "in_layer": self.in_layer,
            "reversed": self.is_reversed,
        }


def exported_tasks(
    said: object, items: Sequence[WaypointItem], heights: Heights
) -> list[FileEntry] | None:
    """The tasks that an exported plan names; None if it names none, or not as it should."""
    listed = member(said, "tasks")
    if not isinstance(listed, list) or heights.home is None:
        return None
    found: list[FileEntry] = []
    for value in listed:
        entry = _entry(value, items, heights, heights.home.alt_m)
        if entry is None:
            return None
        found.append(entry)
    return found


def _entry(
    value: object, items: Sequence[WaypointItem], heights: Heights, home_alt_m: float
) -> FileEntry | None:
    first, last = whole_of(member(value, "first")), whole_of(member(value, "last"))
    told, in_layer = member(value, "task"), member(value, "in_layer")
    if first is None or last is None or not isinstance(told, Mapping) or not told.keys() <= _KEYS:
        return None
    if not 1 <= first <= last <= len(items) or not isinstance(in_layer, bool):
        return None
    spots: list[tuple[float, float, float]] = []
    for item in items[first - 1 : last]:
        if item.command != MavCommand.WAYPOINT:
            continue  # what is switched, or looked at, on the way
        match [number_of(param) for param in item.params[4:]]:
            case [float(lat_deg), float(lon_deg), float(up_m)] if lat_deg or lon_deg:
                spots.append((lat_deg, lon_deg, up_m))
            case _:
                return None
    if not spots:
        return None
    if member(value, "reversed") is True:
        spots.reverse()
    table: dict[str, object] = dict(told)
    if not in_layer:
        table["height_m"] = spots[0][2]
    lower_m = heights.below_m - home_alt_m
    if first == last:
        lat_deg, lon_deg, up_m = spots[0]
        table |= {"lat_deg": lat_deg, "lon_deg": lon_deg}
        if in_layer:
            table["alt_m"] = up_m - lower_m
    elif in_layer:
        table["path"] = [[lat_deg, lon_deg, up_m - lower_m] for lat_deg, lon_deg, up_m in spots]
    else:
        table["path"] = [[lat_deg, lon_deg] for lat_deg, lon_deg, _ in spots]
    return FileEntry(table, items[first - 1].place)
