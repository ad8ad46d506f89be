"""Where the rows of a study are kept while it runs, and from one run to the next.

A folder holds ``study.toml`` and ``trials.csv``, to which the rows of each job are added when it
is done. So a study that was interrupted, at whatever moment, goes on where it stopped. Rows can
be written as Parquet, too.
"""

from __future__ import annotations

import csv
import fcntl
import io
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

from sim.study.design import SameMission, Study
from sim.study.policies.roster import PolicyRoster
from sim.study.study_file import format_study, load_study
from sim.study.trial import COLUMNS, TrialJob, TrialRow, columns_of, rows_due
from swarm.runtime.errors import Fault, InputError
from swarm.scenario import format_scenario

_PARQUET_FILE = "trials.parquet"


def row_line(row: TrialRow, columns: Sequence[str] = COLUMNS) -> str:
    """A row as a line of CSV: numbers with all their digits, nothing for None."""
    buffer = io.StringIO()
    cells = ("" if value is None else value for value in (getattr(row, c) for c in columns))
    csv.writer(buffer, lineterminator="\n").writerow(
        [repr(float(cell)) if isinstance(cell, float) else cell for cell in cells]
    )
    return buffer.getvalue()


def table_text(rows: Iterable[TrialRow], columns: Sequence[str] = COLUMNS) -> str:
    """A whole file of rows."""
    return ",".join(columns) + "\n" + "".join(row_line(row, columns) for row in rows)


def read_rows(path: Path, columns: Sequence[str] = COLUMNS) -> list[TrialRow]:
    """The rows of a file; a last line that is not ended was being written, and is left out.

    Raises:
        InputError: it is no file of rows.
    """
    text = path.read_text(encoding="utf-8", errors="replace")  # which is then no row
    lines = text.splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        del lines[-1]
    rows: list[TrialRow] = []
    for number, cells in enumerate(csv.reader(lines), start=1):
        try:
            if number == 1:
                if cells != list(columns):
                    raise ValueError("has not the columns of a study")
            else:
                rows.append(_row(cells, columns))
        except ValueError as error:
            problem = f"is no row of a study: {error}" if number > 1 else str(error)
            remedy = "name another folder, or remove this one"
            raise InputError(Fault(str(path), f"line {number}", problem, remedy)) from error
    return rows


def write_parquet(folder: Path, rows: Sequence[TrialRow], columns: Sequence[str] = COLUMNS) -> Path:
    """Write all rows as Parquet, which needs the extra ``study``; gives the file.

    Raises:
        OSError: it cannot be written.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    kinds = {"s": pa.string(), "i": pa.int64(), "f": pa.float64()}
    types = {item.name: kinds[str(item.type)[0]] for item in fields(TrialRow)}
    schema = pa.schema([(name, types[name]) for name in columns])
    arrays = {name: [getattr(row, name) for row in rows] for name in columns}
    path = folder / _PARQUET_FILE
    draft = path.with_suffix(".next")
    pq.write_table(pa.table(arrays, schema=schema), draft)
    draft.replace(path)
    return path


def replace_text(path: Path, text: str) -> None:
    """Write a file whole: after a crash there is the old one or the new one."""
    draft = path.with_suffix(".next")
    with draft.open("w", encoding="utf-8", newline="") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())
    draft.replace(path)


def _row(cells: Sequence[str], columns: Sequence[str]) -> TrialRow:
    values: dict[str, Any] = {
        name: _PARSERS[name](cell) for name, cell in zip(columns, cells, strict=True)
    }
    return TrialRow(**values)


def _or_none(number: Callable[[str], float], cell: str) -> float | None:
    return number(cell) if cell else None


_PARSERS = {
    item.name: str
    if item.type == "str"
    else partial(_or_none, int if "int" in str(item.type) else float)
    for item in fields(TrialRow)
}


STUDY_FILE, SCENARIO_FILE = "study.toml", "scenario.toml"
ROWS_FILE = "trials.csv"
_ANOTHER = "name another folder, or remove this one"


class RowStore:
    """Keeps rows for as long as it lives."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._rows: list[TrialRow] = []

    def missing(self) -> list[TrialJob]:
        """The jobs whose rows are not all there."""
        there = {row.key for row in self._rows}
        return [job for job, keys in rows_due(self._study).items() if not keys <= there]

    def add(self, rows: Sequence[TrialRow]) -> None:
        """Keep the rows of one job."""
        self._rows += rows

    def finish(self) -> list[TrialRow]:
        """All rows, sorted by point, trial and policy."""
        return sorted(self._rows, key=lambda row: row.key)


class FolderStore(RowStore):
    """Keeps rows in a folder, which is made if it is not there; close it.

    Raises:
        InputError: the folder cannot be written, is in use, or holds another study.
    """

    def __init__(self, folder: Path, study: Study, roster: PolicyRoster) -> None:
        super().__init__(study)
        self._folder = folder
        self._columns = columns_of(study)
        self._rows_path = folder / ROWS_FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / ".lock").open("w")
        except OSError as error:
            raise _unwritable(folder, error) from error
        try:
            self._take(roster)
            self._rows = self._kept_rows()
            replace_text(self._rows_path, table_text(self._rows, self._columns))
            self._file = self._rows_path.open("a", encoding="utf-8", newline="")
        except OSError as error:
            self._lock.close()
            raise _unwritable(folder, error) from error
        except BaseException:
            self._lock.close()
            raise

    def add(self, rows: Sequence[TrialRow]) -> None:
        """Append the rows of one job; they are with the operating system when this returns."""
        self._file.write("".join(row_line(row, self._columns) for row in rows))
        self._file.flush()
        super().add(rows)

    def finish(self) -> list[TrialRow]:
        """All rows, sorted by point, trial and policy, as the file has them then."""
        self._rows = super().finish()
        self._file.close()
        replace_text(self._rows_path, table_text(self._rows, self._columns))
        self._file = self._rows_path.open("a", encoding="utf-8", newline="")
        return list(self._rows)

    def close(self) -> None:
        """Leave the folder to others."""
        self._file.close()
        self._lock.close()

    # -- opening ----------------------------------------------------------------------------

    def _take(self, roster: PolicyRoster) -> None:
        """Make the folder this study's, unless it is another's."""
        source = str(self._folder)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            fault = Fault("--out", source, "another process is at work there", "wait for its end")
            raise InputError(fault) from error
        path = self._folder / STUDY_FILE
        problem = None
        if path.exists():
            problem = _difference(load_study(path, roster), self._study)
        elif self._rows_path.exists():
            problem = f"holds {ROWS_FILE} without {STUDY_FILE}"
        if problem is not None:
            raise InputError(Fault("--out", source, problem, _ANOTHER))
        if isinstance(self._study.missions, SameMission):
            text = format_scenario(self._study.missions.mission)
            replace_text(self._folder / SCENARIO_FILE, text)
        replace_text(path, format_study(self._study, SCENARIO_FILE))

    def _kept_rows(self) -> list[TrialRow]:
        """The rows of all jobs that are complete; what is left of others is flown again."""
        if not self._rows_path.exists():
            return []
        rows = {row.key: row for row in read_rows(self._rows_path, self._columns)}
        return [
            rows[key]
            for keys in rows_due(self._study).values()
            if keys <= rows.keys()
            for key in sorted(keys)
        ]


_IDENTITY = {
    "name": "another name",
    "seed": "another seed",
    "missions": "other missions",
    "policies": "other policies",
    "bound": "another choice of the bound",
    "uncertainty": "another uncertainty",
    "reattempt": "another choice of reattempts",
}
"""Fields of a study that decide its rows, besides trials and what is varied."""


def _difference(kept: Study, asked: Study) -> str | None:
    """Why the rows of ``kept`` are not some of ``asked``; None if they are."""
    for name, what in _IDENTITY.items():
        if getattr(kept, name) != getattr(asked, name):
            return f"holds a study with {what}"
    before, after = kept.points(), asked.points()
    if [(p.vary, p.at) for p in before] != [(p.vary, p.at) for p in after]:
        return "holds a study that varies something else"
    if any(was.trials > now.trials for was, now in zip(before, after, strict=True)):
        return "holds a study with more trials"
    return None


def _unwritable(folder: Path, error: OSError) -> InputError:
    problem = f"cannot be written: {error.strerror or error}"
    return InputError(Fault("--out", str(folder), problem, "name a folder that can be written"))
