"""What a file of tasks holds, in the words of a scenario, and what its readers share.

An entry has the keys of a table ``[[task]]``, ``[[area]]`` or ``[[zone]]`` and is checked like one,
but under its place in the file it came from. Unknown columns and properties are passed over and
reported; one that is nearly right is a slip and a fault.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sized
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from enum import Enum

from swarm.model import Origin
from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import number_of, printable, shown

_SHORTEST_SLIP, _LONGEST_SLIP = 4, 64
"""Letters of names that may be misspelled."""


def slip_of(name: str, known: Collection[str]) -> str | None:
    """The one of ``known`` that ``name`` misspells; None if it is one itself, or none at all.

    Names of three letters are words of their own, such as the fid of map programs.
    """
    if name in known or not _SHORTEST_SLIP <= len(name) <= _LONGEST_SLIP:
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
LINE_KEYS = (*TASK_KEYS, "trigger_m", "height_m")
"""Keys of a line."""
AREA_KEYS = (
    *LINE_KEYS,
    "spacing_m",
    "camera",
    "sidelap_frac",
    "frontlap_frac",
    "heading_deg",
    "max_line_m",
)
"""Keys of an area."""
ZONE_KEYS = ("id", "floor_m", "ceiling_m", "inclusive")
"""Keys of a zone."""

MOST_ENTRIES = 10_000
"""Files of more tasks, areas and zones are refused: nobody plans for so many at a time."""
MOST_POINTS = 10_000
"""Lines and rings of more points are refused: they are recorded tracks, or traced pixels."""


class Array(Enum):
    """What an entry becomes: the array of tables of a scenario that it is part of."""

    TASK = "task"
    AREA = "area"
    ZONE = "zone"


_NUMBERED = {Array.TASK: "t", Array.AREA: "area", Array.ZONE: "zone"}
"""How those without a name are called, with a number."""


@dataclass(frozen=True, slots=True)
class FileEntry:
    """One task, area or zone of a file."""

    table: Mapping[str, object]
    """Keys and values as in a table of a scenario; what the file does not say is not there.

    Beside these, points of ``path`` may have a height above mean sea level as a third number, and
    ``holes`` has the holes of a ``polygon``; `in_scenario_keys` makes keys of a scenario of them.
    """
    place: str
    """Where it stands in the file."""
    array: Array = Array.TASK
    prefix: str = ""
    """How it is called, with a number, if the file gives no id; empty: as others of the array."""
    source: str = ""
    """Name of the file, for messages; `gather` fills it in."""
    has_own_id: bool = False
    """Whether its id is the file's, and no number of ours; `gather` finds out."""

    def at(self, key: str) -> str:
        """Place of ``key`` in the file."""
        return f"{self.place}, {key}"


@dataclass(frozen=True, slots=True)
class TaskFile:
    """Everything that files of tasks say."""

    source: str
    """Name of the file or files, for messages."""
    entries: tuple[FileEntry, ...]
    """The tasks, each with an id of its own."""
    home: Origin | None
    """Where the vehicles start; None where nobody says so."""
    speed_m_s: float | None = None
    """Cruise speed the file was made for."""
    below_m: float | None = None
    """How far every task lies below its waypoint [m]; None where the file has no waypoints."""
    left_out: Mapping[str, int] = field(default_factory=dict)
    """What the file holds besides tasks, areas and zones, and how many of each."""
    areas: tuple[FileEntry, ...] = ()
    zones: tuple[FileEntry, ...] = ()
    """`swarm import` takes them, tasks_from does not."""
    notes: tuple[str, ...] = ()
    """What a person should know of how the file was read, a sentence each."""
    nothing: str = ""
    """What to do about a file without any task or area."""

    @property
    def all_entries(self) -> tuple[FileEntry, ...]:
        """Tasks, areas and zones."""
        return (*self.entries, *self.areas, *self.zones)

    @property
    def in_degrees(self) -> bool:
        """Whether places are given in degrees, which takes a home."""
        degrees = {"lat_deg", "path", "polygon"}
        return any(degrees & entry.table.keys() for entry in self.all_entries)


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """How a file of tasks is to be read."""

    source: str
    """Name of the file, for messages."""
    home: Origin | None = None
    """Where the vehicles start, instead of the home that the file names."""
    below_m: float | None = None
    """How far a task lies below its waypoint [m]; None for the default of the format."""
    visits_alone: bool = False
    """Surveys and lines become visits of their corners, as in scenarios of schema 1."""
    has_terrain: bool = False
    """Whether the scenario knows the ground, so that heights above it can be meant."""


Reader = Callable[[str, ReadOptions], TaskFile]
"""Makes a `TaskFile` of the text of a file, or raises `InputError` with all its faults."""
BytesReader = Callable[[bytes, ReadOptions], TaskFile]
"""The same for files that are no text."""


def gather(
    request: ReadOptions,
    found: Iterable[FileEntry | Fault],
    nothing: str,
    *,
    home: Origin | None,
    speed_m_s: float | None = None,
    below_m: float | None = None,
    left_out: Mapping[str, int] | None = None,
    notes: Iterable[str] = (),
    may_be_empty: bool = False,
) -> TaskFile:
    """The task file of what was ``found``; what has no id is numbered t1, t2, …, area1, zone1, ….

    Raises:
        InputError: with every fault; with ``nothing`` as the remedy if there is nothing at all,
            unless that may be.
    """
    entries: dict[Array, list[FileEntry]] = {array: [] for array in Array}
    faults: list[Fault] = []
    first: dict[tuple[Array, object], FileEntry] = {}
    numbers = Counter[str]()
    for item in found:
        if isinstance(item, Fault):
            faults.append(item)
            numbers[_NUMBERED[Array.TASK]] += 1
            continue
        prefix = item.prefix or _NUMBERED[item.array]
        numbers[prefix] += 1
        if sum(map(len, entries.values())) == MOST_ENTRIES:
            problem = f"is one more than the {MOST_ENTRIES} entries that a file may hold"
            faults.append(Fault(request.source, item.place, problem, "give fewer at a time"))
            break
        own = "id" in item.table
        entry = replace(item, source=request.source, has_own_id=own)
        if not own:
            entry = replace(entry, table={"id": f"{prefix}{numbers[prefix]}", **entry.table})
        identity = entry.table["id"]
        if (other := first.setdefault((entry.array, identity), entry)) is not entry:
            problem = f"{shown(identity)} is already the id at {other.place}"
            faults.append(
                Fault(request.source, entry.at("id"), problem, "give every one an id of its own")
            )
        entries[entry.array].append(entry)
    if not any(entries.values()) and not faults and not may_be_empty:
        faults.append(Fault(request.source, "", "holds no task", nothing))
    if faults:
        raise InputError(*faults)
    return TaskFile(
        request.source,
        tuple(entries[Array.TASK]),
        home,
        speed_m_s,
        below_m,
        left_out or {},
        tuple(entries[Array.AREA]),
        tuple(entries[Array.ZONE]),
        tuple(notes),
        nothing,
    )


def too_many_points(points: Sized, source: str, place: str) -> Fault | None:
    """The fault of a line or ring that has more points than anybody flies."""
    if len(points) <= MOST_POINTS:
        return None
    problem = f"has {len(points)} points"
    return Fault(source, place, problem, f"simplify it to {MOST_POINTS} or fewer")
