"""Fences and rally points as MAVProxy and Mission Planner wrote them before they were missions.

A fence (``.fen``) has a latitude and a longitude a line: first the point to return to, then the
corners of the one polygon to stay in. A line of rally points (``.rally``, ``.ral``) begins with
RALLY. Files that end in ``.txt`` may be either, or waypoints: their first line tells.
"""

from __future__ import annotations

from collections import Counter

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import shown
from swarm.scenario.task_files.fences import polygon_zone
from swarm.scenario.task_files.task_file import ReadOptions, TaskFile, gather, spelt_number
from swarm.scenario.task_files.waypoints_file import HEADER, read_waypoints

_RALLY = "RALLY"
_LEAST_POINTS = 4
"""Of a fence: where to return to, and three corners."""


def read_fence(text: str, request: ReadOptions) -> TaskFile:
    """The zone of a fence that is a list of points.

    Raises:
        InputError: with every fault of the file.
    """
    points: list[object] = []
    for number, line in _lines(text):
        numbers = [spelt_number(word) for word in line.split()]
        if len(numbers) != 2 or None in numbers:
            problem = f"{shown(line)} is no latitude and longitude"
            fault = Fault(request.source, f"line {number}", problem, "give two numbers a line")
            raise InputError(fault)
        points.append(numbers)
    if len(points) < _LEAST_POINTS:
        problem = f"has {len(points)} points"
        remedy = "give the point to return to, then three corners or more"
        raise InputError(Fault(request.source, "", problem, remedy))
    zone = polygon_zone(points[1:], request.source, "line 2", inclusive=True)
    told = Counter({"fence return point": 1})
    return gather(request, [zone], "add corners", home=request.home, left_out=told)


def read_rally(text: str, request: ReadOptions) -> TaskFile:
    """Nothing but how many rally points there are: where a vehicle may come down in need.

    Raises:
        InputError: with the first line that is none.
    """
    told: Counter[str] = Counter()
    for number, line in _lines(text):
        if line.split()[0].upper() != _RALLY:
            problem = f"{shown(line)} is no rally point"
            remedy = "give lines that begin with RALLY"
            raise InputError(Fault(request.source, f"line {number}", problem, remedy))
        told["rally point"] += 1
    return gather(request, (), "add tasks", home=request.home, left_out=told, may_be_empty=True)


def read_text_file(text: str, request: ReadOptions) -> TaskFile:
    """What is in a file that is one of these, or waypoints.

    Raises:
        InputError: with every fault of the file.
    """
    first = next((line for _, line in _lines(text)), "")
    if first.upper().startswith(_RALLY):
        return read_rally(text, request)
    if first.startswith(HEADER[:3]):
        return read_waypoints(text, request)
    return read_fence(text, request)


def _lines(text: str) -> list[tuple[int, str]]:
    """Lines that say something, with their numbers."""
    return [
        (number, line.strip())
        for number, line in enumerate(text.splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
