"""Tables of tasks (``.csv``): one task a line, columns named in the first, in capitals or not.

A place is lat_deg and lon_deg, with alt_m or without, or east_m and north_m,
with up_m or without; id, value, service_s, kind, appears_s, due_s, opens_s and
closes_s may be left out or empty. Cells are parted by comma, semicolon or tab,
whatever the first line has. Leaves out: decimal commas.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable, shown
from swarm.scenario.task_files.task_file import (
    TASK_KEYS,
    FileEntry,
    ReadOptions,
    TaskFile,
    gather,
    slip_of,
    spelt_number,
)

_DEGREES = ("lat_deg", "lon_deg", "alt_m")
_METRES = ("east_m", "north_m", "up_m")
_COLUMNS = (*TASK_KEYS, *_DEGREES, *_METRES)
_WORDS = {"id", "kind"}
_WANTED = "give columns lat_deg and lon_deg, or east_m and north_m"


def read_csv(text: str, request: ReadOptions) -> TaskFile:
    """The tasks of a table.

    Raises:
        InputError: with every fault of the file.
    """
    first = text.partition("\n")[0]
    delimiter = max(",;\t", key=first.count)
    reader = csv.reader(
        io.StringIO(text, newline=""), delimiter=delimiter, skipinitialspace=True, strict=True
    )
    rows: list[tuple[int, list[str]]] = []
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells):
                rows.append((reader.line_num, cells))
    except csv.Error as error:
        place = f"line {reader.line_num}"
        fault = Fault(request.source, place, f"is not CSV: {error}", "correct it as CSV")
        raise InputError(fault) from error
    header = [name.lower() for name in rows[0][1]] if rows else []
    _check(header, request.source, f"line {rows[0][0]}" if rows else "line 1")
    found = [_entry(f"line {line}", header, cells, request.source) for line, cells in rows[1:]]
    return gather(
        request,
        found,
        "add one line per task",
        home=request.home,
        left_out={f"column {printable(name)}": 1 for name in header if name not in _COLUMNS},
    )


def _check(header: Sequence[str], source: str, place: str) -> None:
    """Refuse a first line that does not say where the tasks are."""
    faults = [
        Fault(source, place, f"column {shown(name)} is unknown", f"did you mean {slip!r}?")
        for name in header
        if (slip := slip_of(name, _COLUMNS))
    ]
    doubled = {name for name in header if name in _COLUMNS and header.count(name) > 1}
    faults += [
        Fault(source, place, f"column {name!r} is there twice", "keep one of them")
        for name in sorted(doubled)
    ]
    families = [family for family in (_DEGREES, _METRES) if {*family} & {*header}]
    if len(families) == 2:
        faults.append(Fault(source, place, "gives places in degrees and in metres", "keep one"))
    elif not families and not faults:
        faults.append(Fault(source, place, "names no columns for the place", _WANTED))
    elif families and not {*families[0][:2]} <= {*header}:
        faults.append(Fault(source, place, "lacks a column for the place", _WANTED))
    if faults:
        raise InputError(*faults)


def _entry(
    place: str, header: Sequence[str], cells: Sequence[str], source: str
) -> FileEntry | Fault:
    if len(cells) > len(header):
        problem = f"has {len(cells)} cells for {len(header)} columns"
        return Fault(source, place, problem, "put cells with a separator in them in quotes")
    given = {name: cell for name, cell in zip(header, cells, strict=False) if cell}
    table: dict[str, object] = {}
    for name in _COLUMNS:
        if name not in given:
            continue
        number = spelt_number(given[name])
        if name not in _WORDS and number is None:
            problem = f"{shown(given[name])} is not a number"
            return Fault(source, f"{place}, {name}", problem, "give a number such as 12.5")
        table[name] = given[name] if name in _WORDS else number
    in_metres = "east_m" in header
    for name in (_METRES if in_metres else _DEGREES)[:2]:
        if name not in table:
            return Fault(source, f"{place}, {name}", "is empty", "give a number such as 12.5")
    if in_metres:
        table["position_m"] = [table.pop(name) for name in _METRES if name in table]
    return FileEntry(table, place)
