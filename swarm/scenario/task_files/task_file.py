"""What a file of tasks holds, in the words of a scenario, and what its readers share.

An entry has the keys of a table ``[[task]]`` and is checked like one, but under its place in
the file it came from. Unknown columns and properties are passed over and reported; one that is
nearly right is a slip and a fault.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, printable, shown


def slip_of(name: str, known: Collection[str]) -> str | None:
    """The one of ``known`` that ``name`` misspells; None if it is one itself, or none at all."""
    if name in known or len(name) > 64:
        return None
    matches = get_close_matches(name, known, n=1, cutoff=0.8)
    return matches[0] if matches else None


def parse_object(text: str, source: str, what: str) -> Mapping[str, object]:
    """The object that ``text`` is.

    Raises:
        InputError: it is no JSON, or another value than an object.
    """
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        problem = f"is not JSON: {printable(error.msg[:1].lower() + error.msg[1:])}"
        raise InputError(Fault(source, place, problem, f"give {what}")) from error
    except (RecursionError, ValueError) as error:
        # Nested thousands deep, or a number of thousands of digits.
        raise InputError(Fault(source, "", "is not JSON of any use", f"give {what}")) from error
    if not isinstance(document, Mapping):
        raise InputError(Fault(source, "", "is not a JSON object", f"give {what}"))
    return document


def member(value: object, *keys: str) -> object:
    """What is at ``keys`` inside ``value``; None if any step is missing or no object."""
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value


def spelt_number(text: str) -> float | None:
    """The finite number that ``text`` spells; None if it is none."""
    try:
        return number_of(float(text))
    except ValueError:
        return None


TASK_KEYS = (
    "id",
    "value",
    "service_s",
    "kind",
    "appears_s",
    "due_s",
    "opens_s",
    "closes_s",
)
"""Keys of a task that a file may give beside the place."""


@dataclass(frozen=True, slots=True)
class FileTask:
    """One task of a file."""

    table: Mapping[str, object]
    """Keys and values as in a table ``[[task]]``; what the file does not say is not there."""
    place: str
    """Where it stands in the file."""

    def at(self, key: str) -> str:
        """Place of ``key`` in the file."""
        return f"{self.place}, {key}"


@dataclass(frozen=True, slots=True)
class TaskFile:
    """Everything that a file of tasks says."""

    source: str
    """Name of the file, for messages."""
    entries: tuple[FileTask, ...]
    """At least one, each with an id of its own."""
    home: Origin | None
    """Where the vehicles start; None where nobody says so."""
    speed_m_s: float | None = None
    """Cruise speed the file was made for."""
    below_m: float | None = None
    """How far every task lies below its waypoint [m]; None where the file has no waypoints."""
    left_out: Mapping[str, int] = field(default_factory=dict)
    """What the file holds besides tasks and zones, and how many of each."""
    zones: tuple[Mapping[str, object], ...] = ()
    """Keys and values as in tables ``[[zone]]``; `swarm import` takes them, tasks_from does not."""

    @property
    def in_degrees(self) -> bool:
        """Whether places are given in degrees, which takes a home."""
        return any("lat_deg" in entry.table for entry in self.entries)


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a file of tasks is to be read."""

    source: str
    """Name of the file, for messages."""
    home: Origin | None = None
    """Where the vehicles start, instead of the home that the file names."""
    below_m: float | None = None
    """How far a task lies below its waypoint [m]; None for the default of the format."""


Reader = Callable[[str, ReadOptions], TaskFile]
"""Makes a `TaskFile` of the text of a file, or raises `InputError` with all its faults."""


def gather(
    request: ReadOptions,
    found: Iterable[FileTask | Fault],
    nothing: str,
    *,
    home: Origin | None,
    speed_m_s: float | None = None,
    below_m: float | None = None,
    left_out: Mapping[str, int] | None = None,
    zones: Iterable[Mapping[str, object]] = (),
) -> TaskFile:
    """The task file of what was ``found``; tasks without an id are numbered t1, t2, ….

    Raises:
        InputError: with every fault; with ``nothing`` as the remedy if there is no task at all.
    """
    entries: list[FileTask] = []
    faults: list[Fault] = []
    first: dict[object, FileTask] = {}
    for number, item in enumerate(found, start=1):
        if isinstance(item, Fault):
            faults.append(item)
            continue
        entry = item
        if "id" not in entry.table:
            entry = replace(entry, table={"id": f"t{number}", **entry.table})
        identity = entry.table["id"]
        if (other := first.setdefault(identity, entry)) is not entry:
            problem = f"{shown(identity)} is already the id at {other.place}"
            faults.append(
                Fault(request.source, entry.at("id"), problem, "give every one an id of its own")
            )
        entries.append(entry)
    if not entries and not faults:
        faults.append(Fault(request.source, "", "holds no task", nothing))
    if faults:
        raise InputError(*faults)
    return TaskFile(
        request.source, tuple(entries), home, speed_m_s, below_m, left_out or {}, tuple(zones)
    )
