"""What a file of tasks holds, in the words of a scenario: its entries, its home, what is left out.

An entry has the keys of a table ``[[task]]`` and is checked like one, but under
its place in the file it came from. Leaves out: reading the files.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from swarm.errors import Fault, InputError
from swarm.model import Origin
from swarm.scenario.findings import shown

__all__ = ["TASK_KEYS", "Entry", "Reader", "Request", "TaskFile", "gather"]

TASK_KEYS = ("id", "value", "service_s", "kind", "appears_s")
"""Keys of a task that a file may give beside the place."""


@dataclass(frozen=True, slots=True)
class Entry:
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
    entries: tuple[Entry, ...]
    """At least one, each with an id of its own."""
    home: Origin | None
    """Where the vehicles start; None where nobody says so."""
    speed_m_s: float | None = None
    """Cruise speed the file was made for."""
    below_m: float | None = None
    """How far every task lies below its waypoint [m]; None where the file has no waypoints."""
    left_out: Mapping[str, int] = field(default_factory=dict)
    """What the file holds besides tasks, and how many of each."""

    @property
    def in_degrees(self) -> bool:
        """Whether places are given in degrees, which takes a home."""
        return any("lat_deg" in entry.table for entry in self.entries)


@dataclass(frozen=True, slots=True)
class Request:
    """How a file of tasks is to be read."""

    source: str
    """Name of the file, for messages."""
    home: Origin | None = None
    """Where the vehicles start, instead of the home that the file names."""
    below_m: float | None = None
    """How far a task lies below its waypoint [m]; None for the default of the format."""


Reader = Callable[[str, Request], TaskFile]
"""Makes a `TaskFile` of the text of a file, or raises `InputError` with all its faults."""


def gather(
    request: Request,
    found: Iterable[Entry | Fault],
    nothing: str,
    *,
    home: Origin | None,
    speed_m_s: float | None = None,
    below_m: float | None = None,
    left_out: Mapping[str, int] | None = None,
) -> TaskFile:
    """The task file of what was ``found``; tasks without an id are numbered t1, t2, ….

    Raises:
        InputError: with every fault; with ``nothing`` as the remedy if there is no task at all.
    """
    entries: list[Entry] = []
    faults: list[Fault] = []
    first: dict[object, Entry] = {}
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
    return TaskFile(request.source, tuple(entries), home, speed_m_s, below_m, left_out or {})
