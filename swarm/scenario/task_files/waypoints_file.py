"""Waypoint files (``.waypoints``, QGC WPL 110), as Mission Planner and MAVProxy write them.

Format: https://mavlink.io/en/file_formats/. Twelve fields a line; the first item of a mission
is home. Fences and rally points are stored in files of the same format, with commands of their
own; whether these begin with a home depends on who wrote them. Leaves out: version 120, which has
no home.
"""

from __future__ import annotations

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.fences import COMMANDS, zones_of_items
from swarm.scenario.task_files.mission_items import (
    BELOW_M,
    Heights,
    MavCommand,
    WaypointItem,
    left_out_of,
    tasks_of,
    whole_of,
)
from swarm.scenario.task_files.task_file import ReadOptions, TaskFile, gather, spelt_number

HEADER = "QGC WPL 110"
"""First line of such a file."""
_FIELDS = 12
_NO_HOME = {*COMMANDS, MavCommand.FENCE_RETURN_POINT, MavCommand.RALLY_POINT}
"""Commands of files that have no home in front, if the first item has one."""


def read_waypoints(text: str, request: ReadOptions) -> TaskFile:
    """What is in a waypoint file: tasks, or the zones of a fence.

    Raises:
        InputError: with every fault of the file.
    """
    lines = text.splitlines()
    header = lines[0].strip() if lines else ""
    if header.split() != HEADER.split():
        problem = f"{shown(header)} is not '{HEADER}'"
        remedy = f"give a waypoint file that begins with {HEADER}"
        raise InputError(Fault(request.source, "line 1", problem, remedy))
    rows = [
        _item(f"line {number}", line.split(), request.source)
        for number, line in enumerate(lines[1:], start=2)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    faults = [row for row in rows if isinstance(row, Fault)]
    if faults:
        raise InputError(*faults)
    items = [row for row in rows if isinstance(row, WaypointItem)]
    own, items = _parted(items)
    home = request.home or (None if own is None else _home(own))
    below_m = BELOW_M if request.below_m is None else request.below_m
    homeless = Fault(
        request.source,
        "line 2" if own is None else own.place,
        "the first item is no home, and heights are counted from it",
        "give the home there, or --home LAT,LON,ALT, or [origin] in the scenario",
    )
    heights = Heights(home, below_m, homeless, request.has_terrain)
    fence = [item for item in items if item.command in COMMANDS]
    mission = [item for item in items if item.command not in COMMANDS]
    alone = request.visits_alone
    return gather(
        request,
        [*tasks_of(mission, heights, visits_alone=alone), *zones_of_items(fence, request.source)],
        "add waypoints after the home",
        home=home,
        below_m=below_m,
        left_out=left_out_of(mission, visits_alone=alone),
        may_be_empty=any(item.command in _NO_HOME for item in items),
    )


def _parted(items: list[WaypointItem]) -> tuple[WaypointItem | None, list[WaypointItem]]:
    """The home of a file, if it has one, and its other items."""
    if not items or items[0].command in _NO_HOME:
        return None, items
    return items[0], items[1:]


def _item(place: str, fields: list[str], source: str) -> WaypointItem | Fault:
    if len(fields) != _FIELDS:
        problem = f"has {len(fields)} fields instead of {_FIELDS}"
        remedy = "give index, current, frame, command, four params, latitude, longitude, height, 1"
        return Fault(source, place, problem, remedy)
    numbers = [spelt_number(field) for field in fields]
    for number, field in zip(numbers, fields, strict=True):
        if number is None:
            return Fault(source, place, f"{shown(field)} is not a number", "give a number")
    frame, command = whole_of(numbers[2]), whole_of(numbers[3])
    if frame is None or command is None:
        wrong = fields[2] if frame is None else fields[3]
        return Fault(source, place, f"{wrong} is not a whole number", "give a frame and a command")
    return WaypointItem(command, frame, numbers[4:11], place)


def _home(item: WaypointItem) -> Origin | None:
    lat_deg, lon_deg, alt_m = (number_of(param) for param in item.params[4:7])
    if lat_deg is None or lon_deg is None or alt_m is None or lat_deg == lon_deg == 0.0:
        return None  # ground stations write 0, 0 for a home that was never set
    try:
        return Origin(lat_deg, lon_deg, alt_m)
    except ValueError:
        return None
