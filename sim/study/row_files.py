"""Rows of a study as CSV, of which every whole line is worth keeping, and as Parquet.

Leaves out: which rows a study has (sim.study.store).
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

from sim.study.rows import COLUMNS, Row
from swarm.errors import Fault, InputError

__all__ = [
    "read_rows",
    "replace_text",
    "require_parquet",
    "row_line",
    "table_text",
    "write_parquet",
]

_PARQUET_FILE = "trials.parquet"


def row_line(row: Row) -> str:
    """A row as a line of CSV: numbers with all their digits, nothing for None."""
    buffer = io.StringIO()
    cells = ("" if value is None else value for value in (getattr(row, c) for c in COLUMNS))
    csv.writer(buffer, lineterminator="\n").writerow(
        [repr(float(cell)) if isinstance(cell, float) else cell for cell in cells]
    )
    return buffer.getvalue()


def table_text(rows: Iterable[Row]) -> str:
    """A whole file of rows."""
    return ",".join(COLUMNS) + "\n" + "".join(row_line(row) for row in rows)


def read_rows(path: Path) -> list[Row]:
    """The rows of a file; a last line that is not ended was being written, and is left out.

    Raises:
        InputError: it is no file of rows.
    """
    text = path.read_text(encoding="utf-8", errors="replace")  # which is then no row
    lines = text.splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        del lines[-1]
    rows: list[Row] = []
    for number, cells in enumerate(csv.reader(lines), start=1):
        try:
            if number == 1:
                if tuple(cells) != COLUMNS:
                    raise ValueError("has not the columns of a study")
            else:
                rows.append(_row(cells))
        except ValueError as error:
            problem = f"is no row of a study: {error}" if number > 1 else str(error)
            remedy = "name another folder, or remove this one"
            raise InputError(Fault(str(path), f"line {number}", problem, remedy)) from error
    return rows


def write_parquet(folder: Path, rows: Sequence[Row]) -> Path:
    """Write all rows as Parquet; ask `require_parquet` before.

    Returns:
        The file.

    Raises:
        OSError: it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"s": pa.string(), "i": pa.int64(), "f": pa.float64()}
    schema = pa.schema([(item.name, kinds[str(item.type)[0]]) for item in fields(Row)])
    columns = {name: [getattr(row, name) for row in rows] for name in COLUMNS}
    path = folder / _PARQUET_FILE
    draft = path.with_suffix(".next")
    pq.write_table(pa.table(columns, schema=schema), draft)
    draft.replace(path)
    return path


def require_parquet() -> None:
    """Refuse before anything is flown where Parquet files cannot be written.

    Raises:
        InputError: pyarrow is not installed.
    """
    try:
        import pyarrow.parquet  # noqa: F401 - whether there is one is the question
    except ImportError as error:
        remedy = "install it with: pip install 'peckorder[study]'"
        raise InputError(Fault("--format", "parquet", "needs pyarrow", remedy)) from error


def replace_text(path: Path, text: str) -> None:
    """Write a file whole: after a crash there is the old one or the new one."""
    draft = path.with_suffix(".next")
    with draft.open("w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def _row(cells: Sequence[str]) -> Row:
    values: dict[str, Any] = {
        name: _PARSERS[name](cell) for name, cell in zip(COLUMNS, cells, strict=True)
    }
    return Row(**values)


def _integer(cell: str) -> int | None:
    return int(cell) if cell else None


def _float(cell: str) -> float | None:
    return float(cell) if cell else None


_PARSERS = {
    item.name: str if item.type == "str" else _integer if "int" in str(item.type) else _float
    for item in fields(Row)
}
