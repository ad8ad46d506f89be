"""Where the rows of a study are kept while it runs, and from one run to the next.

A folder holds ``study.toml`` and ``trials.csv``, to which the rows of each job are added when it
is done. So a study that was interrupted, at whatever moment, goes on where it stopped. Leaves
out: tables and plots made of the rows.
"""

from __future__ import annotations

import fcntl
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Protocol

from sim.study.config import SameMission, Study
from sim.study.policies import Roster
from sim.study.row_files import read_rows, replace_text, row_line, table_text
from sim.study.rows import Row
from sim.study.study_file import load_study
from sim.study.study_text import format_study
from sim.study.trial import Job, rows_due
from swarm.errors import Fault, InputError
from swarm.scenario import format_scenario

__all__ = ["ROWS_FILE", "STUDY_FILE", "FolderStore", "MemoryStore", "Store"]

STUDY_FILE, SCENARIO_FILE = "study.toml", "scenario.toml"
ROWS_FILE = "trials.csv"
_ANOTHER = "name another folder, or remove this one"


class Store(Protocol):
    """Keeps rows."""

    def missing(self) -> list[Job]:
        """The jobs whose rows are not all there."""
        ...

    def add(self, rows: Sequence[Row]) -> None:
        """Keep the rows of one job."""
        ...

    def finish(self) -> list[Row]:
        """All rows, sorted by point, trial and policy."""
        ...


class MemoryStore:
    """Keeps rows for as long as it lives."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._rows: list[Row] = []

    def missing(self) -> list[Job]:
        """The jobs whose rows are not all there."""
        return _missing(self._study, self._rows)

    def add(self, rows: Sequence[Row]) -> None:
        """Keep the rows of one job."""
        self._rows += rows

    def finish(self) -> list[Row]:
        """All rows, sorted by point, trial and policy."""
        return sorted(self._rows, key=lambda row: row.key)


class FolderStore:
    """Keeps rows in a folder; close it.

    Args:
        folder: made if it is not there.
        study: whose rows they are.
        roster: policies, to read the study of the folder.

    Raises:
        InputError: the folder cannot be written, is in use, or holds another study.
    """

    def __init__(self, folder: Path, study: Study, roster: Roster) -> None:
        self._folder = folder
        self._study = study
        self._rows_path = folder / ROWS_FILE
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = (folder / ".lock").open("w")
        except OSError as error:
            raise _unwritable(folder, error) from error
        try:
            self._take(roster)
            self._rows = self._kept_rows()
            replace_text(self._rows_path, table_text(self._rows))
            self._file = self._rows_path.open("a", encoding="utf-8", newline="")
        except OSError as error:
            self._lock.close()
            raise _unwritable(folder, error) from error
        except BaseException:
            self._lock.close()
            raise

    def missing(self) -> list[Job]:
        """The jobs whose rows are not all there."""
        return _missing(self._study, self._rows)

    def add(self, rows: Sequence[Row]) -> None:
        """Append the rows of one job; they are with the operating system when this returns."""
        self._file.write("".join(row_line(row) for row in rows))
        self._file.flush()
        self._rows += rows

    def finish(self) -> list[Row]:
        """All rows, sorted by point, trial and policy, as the file has them then."""
        self._rows.sort(key=lambda row: row.key)
        self._file.close()
        replace_text(self._rows_path, table_text(self._rows))
        self._file = self._rows_path.open("a", encoding="utf-8", newline="")
        return list(self._rows)

    def close(self) -> None:
        """Leave the folder to others."""
        self._file.close()
        self._lock.close()

    # -- opening ----------------------------------------------------------------------------

    def _take(self, roster: Roster) -> None:
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

    def _kept_rows(self) -> list[Row]:
        """The rows of all jobs that are complete; what is left of others is flown again."""
        if not self._rows_path.exists():
            return []
        rows = {row.key: row for row in read_rows(self._rows_path)}
        return [
            rows[key]
            for keys in rows_due(self._study).values()
            if keys <= rows.keys()
            for key in sorted(keys)
        ]


def _missing(study: Study, rows: Iterable[Row]) -> list[Job]:
    there = {row.key for row in rows}
    return [job for job, keys in rows_due(study).items() if not keys <= there]


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
