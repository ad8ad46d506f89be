"""Waypoint files (``.waypoints``, QGC WPL 110), as Mission Planner and MAVProxy write them.

Format: https://mavlink.io/en/file_formats/. Twelve fields a line; the first item
is home. Leaves out: version 120, which has no home.
"""

from __future__ import annotations

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, shown
from swarm.scenario.task_files.mission_items import (
    BELOW_M,
    WaypointItem,
    left_out_of,
    stops_of,
    whole_of,
)
from swarm.scenario.task_files.task_file import ReadOptions, TaskFile, gather, spelt_number

_HEADER = "QGC WPL 110"
_FIELDS = 12


def read_waypoints(text: str, request: ReadOptions) -> TaskFile:
    """The tasks of a waypoint file.

    Raises:
        InputError: with every fault of the file.
    """
    lines = text.splitlines()
    header = lines[0].strip() if lines else ""
    if header.split() != _HEADER.split():
        problem = f"{shown(header)} is not '{_HEADER}'"
        remedy = f"give a waypoint file that begins with {_HEADER}"
        raise InputError(Fault(request.source, "line 1", problem, remedy))
    rows = [
        _item(f"line {number}", line.split(), request.source)
        for number, line in enumerate(lines[1:], start=2)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    faults = [row for row in rows if isinstance(row, Fault)]
    items = [row for row in rows if isinstance(row, WaypointItem)]
    own, items = (items[0], items[1:]) if items and not faults else (None, items)
    home = request.home or (None if own is None else _home(own))
    below_m = BELOW_M if request.below_m is None else request.below_m
    homeless = Fault(
        request.source,
        "line 2" if own is None else own.place,
        "the first item is no home, and heights are counted from it",
        "give the home there, or --home LAT,LON,ALT, or [origin] in the scenario",
    )
    return gather(
        request,
        faults or stops_of(items, home, below_m, homeless),
        "add waypoints after the home",
        home=home,
        below_m=below_m,
        left_out=left_out_of(items),
    )


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
