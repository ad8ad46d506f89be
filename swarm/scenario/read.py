"""Read a scenario file: TOML in, a validated mission out, every fault at once.

Only what is no TOML at all stops early. A mission without any task is wrong
unless it says so itself with ``task = []``: forgetting the tasks is likelier
than waiting for an operator to add them. Leaves out: finding the file by a
shipped name (swarm.scenario.shipped).
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.errors import Fault, InputError
from swarm.model import Mission, Origin, Task, TaskId, Uav, UavId
from swarm.model.frames import enu_from_wgs84
from swarm.scenario.checks import check
from swarm.scenario.findings import Document, faults_of, printable

if TYPE_CHECKING:
    from swarm.scenario.shapes import Scenario, TaskTable, UavTable

__all__ = ["LARGEST_FILE_BYTES", "load_scenario", "parse_scenario"]

LARGEST_FILE_BYTES = 16 * 2**20
"""Larger files are refused unread: no mission needs them, and they take minutes."""

_WHERE = re.compile(r"(?P<problem>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end.*)\)")


def load_scenario(path: Path) -> Mission:
    """The mission in the file ``path``.

    Raises:
        InputError: the file cannot be read, or is wrong; see `parse_scenario`.
    """
    source = printable(str(path))
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        problem = f"cannot be read: {reason or error}"
        raise InputError(Fault(source, "", problem, "give a readable scenario file")) from error
    return parse_scenario(data, source)


def parse_scenario(data: bytes, source: str) -> Mission:
    """The mission that ``data`` describes.

    Places in degrees are converted to the local frame; without ``alt_m`` they
    lie at the height of the origin.

    Args:
        data: the bytes of a scenario file.
        source: name of the file, for messages.

    Raises:
        InputError: with every fault of the file, in the order of the file.
    """
    from swarm.scenario.shapes import validate

    document = _document(data, source)
    scenario, findings = validate(document)
    findings += check(document)
    if findings or scenario is None:
        raise InputError(*faults_of(document, source, findings))
    return _mission(scenario)


def _document(data: bytes, source: str) -> Document:
    if len(data) > LARGEST_FILE_BYTES:
        problem = f"is larger than {LARGEST_FILE_BYTES // 2**20} MiB"
        raise InputError(Fault(source, "", problem, "give a smaller scenario file"))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        column = error.start - data.rfind(b"\n", 0, error.start)
        problem = f"byte 0x{data[error.start]:02x} is not UTF-8"
        place = f"line {line}, column {column}"
        raise InputError(Fault(source, place, problem, "save the file as UTF-8")) from error
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        fault = Fault(source, "", "is nested too deeply", "give a scenario file in TOML")
        raise InputError(fault) from error
    except ValueError as error:  # of which TOMLDecodeError is one, and huge integers are another
        raise InputError(_syntax_fault(str(error), text, source)) from error


def _syntax_fault(message: str, text: str, source: str) -> Fault:
    found = _WHERE.fullmatch(message)
    if found is None:
        problem = printable(message).partition(";")[0]
        return Fault(source, "", f"is not TOML: {problem}", "correct it as TOML")
    line, column = found["line"], found["column"]
    if line is None:
        line, column = str(text.count("\n") + 1), str(len(text) - text.rfind("\n"))
    problem = found["problem"]
    problem = printable(problem[:1].lower() + problem[1:])
    place = f"line {line}, column {column}"
    return Fault(source, place, f"is not TOML: {problem}", "correct it as TOML")


def _mission(scenario: Scenario) -> Mission:
    origin = None
    if (table := scenario.origin) is not None:
        origin = Origin(table.lat_deg, table.lon_deg, table.alt_m)
    return Mission(
        name=scenario.name,
        horizon_s=scenario.mission.horizon_s,
        uavs=tuple(
            Uav(
                id=UavId(uav.id),
                position_enu_m=_point_enu_m(uav, origin),
                speed_m_s=uav.speed_m_s,
                success=uav.success,
                survival=uav.survival,
                kind=uav.kind,
            )
            for uav in scenario.uav
        ),
        tasks=tuple(
            Task(
                id=TaskId(task.id),
                position_enu_m=_point_enu_m(task, origin),
                value=task.value,
                service_s=task.service_s,
                kind=task.kind,
                appears_s=task.appears_s,
            )
            for task in scenario.task
        ),
        success_default=scenario.mission.success_default,
        survival_default=scenario.mission.survival_default,
        reattempt_failed=scenario.mission.reattempt_failed,
        origin=origin,
    )


def _point_enu_m(table: UavTable | TaskTable, origin: Origin | None) -> tuple[float, float, float]:
    if table.position_m is not None:
        east_m, north_m, *up_m = table.position_m
        return east_m, north_m, up_m[0] if up_m else 0.0
    if origin is None or table.lat_deg is None or table.lon_deg is None:
        raise ValueError("a table without a position has passed the checks")
    if table.alt_m is None:
        return enu_from_wgs84(origin, table.lat_deg, table.lon_deg, origin.alt_m)
    return enu_from_wgs84(origin, table.lat_deg, table.lon_deg, table.alt_m)
