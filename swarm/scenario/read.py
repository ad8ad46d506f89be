"""Read a scenario file: TOML in, a validated mission out, every fault at once.

Only what is no TOML at all stops early. A mission without any task or area is
wrong unless it says so itself with ``task = []``: forgetting the tasks is likelier
than waiting for an operator to add them.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING

from swarm.model import Mission
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.checks import check
from swarm.scenario.conversion import mission_of
from swarm.scenario.edition import edition_of
from swarm.scenario.files import decode, read_bytes
from swarm.scenario.findings import Document, Finding, faults_of, printable
from swarm.scenario.places import origin_of

if TYPE_CHECKING:
    from swarm.scenario.task_files import TaskFile

_WHAT = "scenario file"
_WHERE = re.compile(r"(?P<problem>.*) \(at (?:line (?P<line>\d+), column (?P<column>\d+)|end.*)\)")


def load_scenario(path: Path) -> Mission:
    """The mission in the file ``path``.

    Raises:
        InputError: the file cannot be read, or is wrong; see `parse_scenario`.
    """
    source = printable(str(path))
    if path.suffix != ".toml":
        _refuse_tasks_alone(path, source)
    return parse_scenario(read_bytes(path, _WHAT), source, path.parent)


def _refuse_tasks_alone(path: Path, source: str) -> None:
    """Say of a file of tasks how it becomes a scenario."""
    from swarm.scenario.task_files import SUFFIXES

    if path.suffix.lower() in SUFFIXES:
        remedy = f"make a scenario of it: swarm import {source} --uavs 3 -o {path.stem}.toml"
        raise InputError(Fault(source, "", "holds tasks and no fleet", remedy))


def parse_scenario(data: bytes, source: str, folder: Path = Path()) -> Mission:
    """The mission that ``data`` describes.

    Places in degrees are converted to the local frame; without ``alt_m`` they
    lie at the height of the origin.

    ``source`` names it in messages; files of ``tasks_from`` and ``[terrain]`` are looked for in
    ``folder``.

    Raises:
        InputError: with every fault of the file, in the order of the file.
    """
    document = parse_toml(data, source, _WHAT)
    if "tasks_from" not in document:
        return build_mission(document, source, folder=folder)
    from swarm.scenario.task_files import ImportOptions, read_task_files

    document = {**document, "task": document.get("task", [])}
    name = document["tasks_from"]
    if not isinstance(name, str) or not name:
        return build_mission(document, source)
    origin = origin_of(document.get("origin"))
    if "origin" in document and origin is None:
        return build_mission(document, source)
    options = ImportOptions(
        origin, visits_alone=edition_of(document) == 1, has_terrain="terrain" in document
    )
    tasks = read_task_files([folder / name], options)
    return build_mission(document, source, replace(tasks, zones=()), folder)


def build_mission(
    document: Document, source: str, tasks: TaskFile | None = None, folder: Path = Path()
) -> Mission:
    """The mission of a parsed scenario and of the ``tasks`` that come from elsewhere.

    The file of its ``[terrain]`` is looked for in ``folder``.

    Tasks, areas and zones of a file follow those of the document; tasks and areas are worth 1
    unless the file says otherwise. Its home is the origin where the document names none.

    Raises:
        InputError: with every fault of the document, then those of the tasks.
    """
    from swarm.scenario.shapes import validate
    from swarm.scenario.vehicle_faults import table_faults, vehicle_faults

    first: dict[str, int] = {}
    if tasks is not None:
        document, first = _with_entries(document, tasks)
    if document.get("area"):  # its lines are tasks enough
        document = {"task": [], **document}
    scenario, findings = validate(document)
    findings += check(document)
    if scenario is not None:
        findings += table_faults(scenario)
    if scenario is not None and not findings:
        mission = mission_of(scenario)
        if mission.areas:
            from swarm.scenario.area_faults import with_lines

            mission, findings = with_lines(mission)
        if not findings:
            findings = list(vehicle_faults(mission, scenario))
        if not findings and mission.separation_m is not None:
            findings = _crowded_starts(mission)
        if not findings and (terrain := scenario.terrain) is not None:
            from swarm.scenario.ground import on_ground

            mission = on_ground(mission, folder / terrain.file, terrain.clearance_m)
        if not findings:
            return mission
    here = [finding for finding in findings if not _from_file(finding, first)]
    faults = faults_of(document, source, here)
    if tasks is not None:
        there = [finding for finding in findings if _from_file(finding, first)]
        faults += _faults_of_file(tasks, there, first)
    raise InputError(*faults)


def _crowded_starts(mission: Mission) -> list[Finding]:
    """Starts so near to each other that the band has too few layers for them."""
    from swarm.separation.fleet_layers import fleet_layers_m

    try:
        fleet_layers_m(mission)
    except ValueError as error:
        remedy = "spread the starts, or give a wider band_m or a smaller separation_m"
        return [Finding(("mission", "separation_m"), str(error), remedy)]
    return []


def _with_entries(document: Document, tasks: TaskFile) -> tuple[Document, dict[str, int]]:
    """``document`` with the entries of ``tasks``, and where these begin in its arrays."""
    whole = dict(document)
    first: dict[str, int] = {}
    for array, entries, defaults in (
        ("task", tasks.entries, {"value": 1.0}),
        ("area", tasks.areas, {"value": 1.0}),
        ("zone", tasks.zones, {}),
    ):
        own = document.get(array, [])
        if entries and isinstance(own, list):
            first[array] = len(own)
            whole[array] = [*own, *({**defaults, **entry.table} for entry in entries)]
    if "origin" not in whole and tasks.home is not None:
        whole["origin"] = asdict(tasks.home)
    return whole, first


def _faults_of_file(
    tasks: TaskFile, findings: list[Finding], first: Mapping[str, int]
) -> Iterator[Fault]:
    """The findings at their places in the files of tasks, in the order of these."""
    entries = {"task": tasks.entries, "area": tasks.areas, "zone": tasks.zones}
    for finding in sorted(findings, key=lambda each: (str(each.path[0]), int(each.path[1]))):
        array, index, *key = finding.path
        entry = entries[str(array)][int(index) - first[str(array)]]
        place = entry.at(str(key[0])) if key else entry.place
        yield Fault(entry.source, place, finding.problem, finding.remedy)


def _from_file(finding: Finding, first: Mapping[str, int]) -> bool:
    """Whether it concerns an entry that follows the ``first`` ones of its array."""
    match finding.path:
        case (str(array), int(index), *_):
            return array in first and index >= first[array]
        case _:
            return False


def parse_toml(data: bytes, source: str, what: str) -> Document:
    """The document in the bytes of a ``what``, such as a scenario file.

    Raises:
        InputError: it is no TOML.
    """
    text = decode(data, source, what)
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        fault = Fault(source, "", "is nested too deeply", f"give a {what} in TOML")
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
