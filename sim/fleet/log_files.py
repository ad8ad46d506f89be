"""Keeps what the processes of a run log: one file of JSON lines each."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

from swarm.runtime.errors import Fault, InputError

__all__ = ["LogFiles"]


class LogFiles:
    """The files of one run, in a folder that is made if need be; use it as a context manager.

    What was there before stays, and lines are added to it. A disk that is full costs the logs and
    not the flight: ``complain`` is told once.

    Raises:
        InputError: no file can be written there.
    """

    def __init__(self, folder: Path, complain: Callable[[str], object]) -> None:
        self._folder = folder
        self._complain = complain
        self._files: dict[str, TextIO] = {}
        self._failed = False
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / ".probe").open("w"):
                pass
            (folder / ".probe").unlink()
        except OSError as fault:
            problem = f"nothing can be written there: {fault.strerror or fault}"
            raise InputError(Fault("--logs", str(folder), problem, "name a folder")) from fault

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for file in self._files.values():
            try:
                file.close()
            except OSError as fault:
                self._fail(fault)
        self._files.clear()

    def write(self, name: str, line: str) -> None:
        """Keep a line of the process of that name; one that is no JSON object becomes one."""
        if self._failed:
            return
        try:
            file = self._files.get(name)
            if file is None:
                path = self._folder / f"{re.sub(r'[^A-Za-z0-9_.-]+', '-', name)[:100]}.jsonl"
                # Each line is there at once: whoever reads along, or after a crash, has it.
                file = self._files[name] = path.open("a", encoding="utf-8", buffering=1)
            file.write(_as_object(name, line) + "\n")
        except OSError as fault:
            self._fail(fault)

    def _fail(self, fault: OSError) -> None:
        if not self._failed:
            self._failed = True
            self._complain(f"logs are kept no longer: {fault.strerror or fault}")


def _as_object(name: str, line: str) -> str:
    """The line itself, or what a foreign program or a traceback says, as a JSON object."""
    try:
        if isinstance(json.loads(line), dict):
            return line
    except ValueError:
        pass
    return json.dumps({"module": name, "event": line, "level": "info"})
