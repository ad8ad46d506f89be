"""The table of attributes of a Shapefile (``.dbf``), as far as words, numbers and truths go.

Format: dBASE III and its successors. Columns of other types (dates, memos) are left out.
"""

from __future__ import annotations

import codecs
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from swarm.runtime.errors import Fault, InputError
from swarm.scenario.findings import printable
from swarm.scenario.task_files.task_file import MOST_ENTRIES, spelt_number

_HEADER = 32
_MOST_COLUMNS = 255
"""As many as dBASE had."""
_END_OF_FIELDS = 0x0D
_DELETED = b"*"
_TRUTHS = {"T": True, "Y": True, "F": False, "N": False}
_FALLBACK = "cp1252"
"""Of tables of before UTF-8 that do not say how they are written."""
_GIVE = "save the Shapefile again"


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    kind: str
    begin: int
    end: int


def read_table(data: bytes, cpg: bytes | None, source: str) -> list[Mapping[str, object]]:
    """Its rows by names of columns in small letters, empty cells left out; also deleted ones.

    ``cpg`` is what the file beside it says of how its words are written.

    Raises:
        InputError: it is no such table, is cut off, or is written in another way.
    """
    where = ".dbf"
    if len(data) <= _HEADER:
        raise InputError(Fault(source, where, "is no table of dBASE", _GIVE))
    count, header, width = struct.unpack_from("<IHH", data, 4)
    if count > MOST_ENTRIES:
        problem = f"has {count} rows, more than {MOST_ENTRIES}"
        raise InputError(Fault(source, where, problem, "give fewer at a time"))
    if width == 0 or header <= _HEADER or header + count * width > len(data):
        problem = f"has fewer bytes than its {count} rows take"
        raise InputError(Fault(source, where, problem, _GIVE))
    encoding = _encoding(cpg, source)
    columns = _columns(data, header, width, encoding, source)
    rows: list[Mapping[str, object]] = []
    for number in range(count):
        row = data[header + number * width :][:width]
        try:
            rows.append({} if row[:1] == _DELETED else _row(row, columns, encoding))
        except UnicodeDecodeError as error:
            place = f"{where}, record {number + 1}"
            problem = f"byte 0x{row[error.start]:02x} is not {encoding}"
            remedy = "save it with a .cpg file that names its encoding"
            raise InputError(Fault(source, place, problem, remedy)) from error
    return rows


def _encoding(cpg: bytes | None, source: str) -> str:
    if cpg is None:
        return ""
    name = cpg.decode("ascii", "replace").strip().removeprefix("ANSI ")
    if name.isdecimal():
        name = {"65001": "utf-8", "88591": "iso-8859-1"}.get(name, f"cp{name}")
    try:
        return codecs.lookup(name[:40]).name
    except (LookupError, ValueError) as error:
        problem = f"{printable(name[:40])!r} is no encoding that is known"
        raise InputError(Fault(source, ".cpg", problem, "save it as UTF-8")) from error


def _columns(data: bytes, header: int, width: int, encoding: str, source: str) -> Sequence[_Column]:
    columns: list[_Column] = []
    begin = 1  # after the mark of deleted rows
    for at in range(_HEADER, min(header - 1, _HEADER + 32 * _MOST_COLUMNS), 32):
        if data[at] == _END_OF_FIELDS:
            break
        field = data[at : at + 32]
        end = begin + field[16]
        if end > width:
            raise InputError(Fault(source, ".dbf", "has columns wider than its rows", _GIVE))
        name = _text(field[:11].partition(b"\0")[0], encoding, errors="replace")
        columns.append(_Column(name.strip().lower(), chr(field[11]), begin, end))
        begin = end
    return columns


def _row(row: bytes, columns: Sequence[_Column], encoding: str) -> Mapping[str, object]:
    found: dict[str, object] = {}
    for column in columns:
        cell = row[column.begin : column.end]
        match column.kind:
            case "C":
                value: object = _text(cell, encoding).strip("\0 ") or None
            case "N" | "F":
                value = spelt_number(cell.decode("ascii", "replace").strip("\0 "))
            case "L":
                value = _TRUTHS.get(cell.decode("ascii", "replace").upper())
            case _:
                value = None
        if value is not None:
            found[column.name] = value
    return found


def _text(cell: bytes, encoding: str, errors: str = "strict") -> str:
    if encoding:
        return cell.decode(encoding, errors)
    try:
        return cell.decode("utf-8")
    except UnicodeDecodeError:
        return cell.decode(_FALLBACK, "replace")
