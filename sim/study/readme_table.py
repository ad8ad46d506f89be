"""Puts a study's table into a Markdown file, between two markers, so that one command renews it.

The markers are comments: ``<!-- study NAME -->`` and ``<!-- end of study -->``. Leaves out: the
table (sim.study.summary_tables).
"""

from __future__ import annotations

from pathlib import Path

from swarm.errors import Fault, InputError
from swarm.scenario.files import decode, read_bytes
from swarm.scenario.findings import printable

__all__ = ["MarkedFile"]

_WHAT = "Markdown file"
_END = "<!-- end of study -->"


class MarkedFile:
    """A Markdown file with the markers of one study.

    Args:
        path: the file; read at once, so that it is refused before anything is flown.
        name: of the study.

    Raises:
        InputError: the file cannot be read, or the markers are not there.
    """

    def __init__(self, path: Path, name: str) -> None:
        self._path = path
        self._begin = f"<!-- study {name} -->"
        self._parts()

    def replace(self, text: str) -> None:
        """Put ``text`` between the markers; everything else stays.

        Raises:
            InputError: the file cannot be written, or the markers have gone.
        """
        before, after = self._parts()
        try:
            with self._path.open("w", encoding="utf-8", newline="") as file:
                file.write(f"{before}{self._begin}\n\n{text.strip()}\n\n{_END}{after}")
        except OSError as error:
            problem = f"cannot be written: {error.strerror or error}"
            raise InputError(self._fault(problem, "give a file that can be written")) from error

    def _parts(self) -> tuple[str, str]:
        """What stands before and after the markers."""
        text = decode(read_bytes(self._path, _WHAT), printable(str(self._path)), _WHAT)
        before, begin, rest = text.partition(self._begin)
        _, end, after = rest.partition(_END)
        if not begin or not end:
            problem = f"has no lines {self._begin} and {_END}"
            raise InputError(self._fault(problem, "put them where the table is to stand"))
        return before, after

    def _fault(self, problem: str, remedy: str) -> Fault:
        return Fault("--update", printable(str(self._path)), problem, remedy)
