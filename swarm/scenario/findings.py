"""What is wrong with a scenario file and where: places, their order, and hints.

A finding names its place as a path of keys and indices into the parsed
document; here paths become text a person recognises, in the order of the file.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from difflib import get_close_matches

from swarm.runtime.errors import Fault

Document = Mapping[str, object]
"""A parsed TOML file."""
Path = tuple[str | int, ...]
"""Keys and array indices from the top of a document; empty for the whole."""

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]{1,64}")
_LONGEST_SHOWN = 48
_ABSENT = "is missing"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing wrong, with a path instead of a readable place."""

    path: Path
    problem: str
    remedy: str
    meant: Path | None = None
    """The missing place that a misspelled key stands for."""


def absent(path: Path, remedy: str) -> Finding:
    """The finding that a required place is missing."""
    return Finding(path, _ABSENT, remedy)


def faults_of(document: Document, source: str, findings: Collection[Finding]) -> list[Fault]:
    """The findings as faults of the file ``source``, in the order of the file.

    What is missing counts as standing at the beginning of its table. A misspelled
    key is one fault: its remedy names the key that is missing, so that one is left out.
    """
    positions = _Positions()
    meant = {finding.meant for finding in findings}
    ordered = sorted(
        (f for f in findings if not (f.problem == _ABSENT and f.path in meant)),
        key=lambda finding: positions.of(document, finding.path),
    )
    return [
        Fault(source, _place(document, finding.path), finding.problem, finding.remedy)
        for finding in ordered
    ]


def shown(value: object) -> str:
    """``value`` as the file has it, on one line and not too long."""
    match value:
        case bool():
            return "true" if value else "false"
        case str() | float():
            return _cut(repr(value))
        case int():
            return _cut(str(value)) if abs(value) < 10**18 else "a huge integer"
        case Mapping():
            return "a table"
        case list():
            return "an array"
        case dt.date() | dt.time():
            return f"the date or time {value.isoformat()}"
        case _:
            return f"a {type(value).__name__}"


def _cut(text: str) -> str:
    """``text``, cut where a line would become unreadable."""
    return text if len(text) <= _LONGEST_SHOWN else f"{text[: _LONGEST_SHOWN - 1]}…"


def number_of(value: object) -> float | None:
    """``value`` as a finite float; None if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def printable(name: str) -> str:
    """``name`` as it is if it is safe to print on one line, else with escapes."""
    return name if name.isprintable() else repr(name)


def close_match(name: str, names: Collection[str]) -> str | None:
    """The one of ``names`` that ``name`` probably means; None when unsure or too costly."""
    if len(name) > 64 or len(names) > 2000:
        return None
    matches = get_close_matches(name, names, n=1, cutoff=0.65)
    return matches[0] if matches else None


def _place(document: Document, path: Path) -> str:
    """``uav[2] "uav3".speed_m_s``: the path, with the ids of UAVs and tasks put in."""
    place = ""
    here: object = document
    for step in path:
        if isinstance(step, int):
            here = here[step] if isinstance(here, list) else None
            place += f"[{step}]"
            name = here.get("id") if isinstance(here, Mapping) else None
            if isinstance(name, str) and name:
                place += f' "{_escaped(name)}"'
        else:
            here = here.get(step) if isinstance(here, Mapping) else None
            key = step if _BARE_KEY.fullmatch(step) else f'"{_escaped(step)}"'
            place += f".{key}" if place else key
    return place


def _escaped(name: str) -> str:
    return _cut(repr(name)[1:-1])


class _Positions:
    """Sort keys of paths by where they stand in a document."""

    def __init__(self) -> None:
        self._indices: dict[int, dict[str, int]] = {}

    def of(self, document: Document, path: Path) -> tuple[int, ...]:
        """Index of every step among its neighbours; -1 for a key that is not there."""
        key: list[int] = []
        here: object = document
        for step in path:
            if isinstance(step, int):
                key.append(step)
                here = here[step] if isinstance(here, list) else None
            elif isinstance(here, Mapping) and step in here:
                if id(here) not in self._indices:
                    self._indices[id(here)] = {name: i for i, name in enumerate(here)}
                key.append(self._indices[id(here)][step])
                here = here[step]
            else:
                key.append(-1)
                here = None
        return tuple(key)
