"""Drives `swarm run` as a user would, for tests that need the real thing."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from fnmatch import fnmatch
from pathlib import Path
from typing import Any, Self

from sim.fleet import fork_server
from tests.process.programs import Swarm

FORK_SERVER = fork_server.__name__
POSITION_RATE_HZ = 25.0
"""Of each UAV, by the wall's clock; many tests have fewer processors than UAVs."""


def wait_until(condition: Callable[[], bool], timeout_s: float, what: str) -> None:
    """Poll until ``condition`` holds; fail with ``what`` when it takes too long."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline_s, f"{what} did not happen within {timeout_s} s"
        time.sleep(0.05)


def child_pids(parent: int) -> dict[str, int]:
    """Living children of a process: the words after ``swarm`` on their command line -> pid.

    Without what only forks the others.
    """
    found = {}
    for pid in _children(parent):
        words = _words(pid)
        if words is not None:
            found[words] = pid
    return found


def _words(pid: int) -> str | None:
    """The words after ``swarm`` on a command line; None of what has ended or forks the others."""
    try:
        line = (Path("/proc") / str(pid) / "cmdline").read_bytes().decode()
    except OSError:
        return None
    words = line.rstrip("\0").split("\0")
    if FORK_SERVER in words:
        return None
    return " ".join(words[words.index("swarm") + 1 :] if "swarm" in words else words)


def alive(pid: int) -> bool:
    """Whether the process runs (a zombie does not)."""
    try:
        state = (Path("/proc") / str(pid) / "stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def _children(parent: int) -> list[int]:
    """Of all threads of a process, zombies included."""
    found = []
    tasks = f"/proc/{parent}/task"
    with contextlib.suppress(OSError):
        for thread in os.listdir(tasks):  # noqa: PTH208 - looked at all the time
            with contextlib.suppress(OSError), open(f"{tasks}/{thread}/children", "rb") as file:  # noqa: PTH123
                found += [int(pid) for pid in file.read().split()]
    return found


class SwarmRun:
    """One `swarm run --json` in the background."""

    def __init__(self, arguments: list[str], folder: Path) -> None:
        if "--position-rate-hz" not in arguments:
            arguments = [*arguments, "--position-rate-hz", f"{POSITION_RATE_HZ:g}"]
        environment = {**os.environ, "TMPDIR": str(folder), "NO_COLOR": "1"}
        self.folder = folder
        self.process = Swarm(
            ["run", *arguments, "--json"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=environment,
            cwd=folder,
        )
        self.lines: list[str] = []
        """Standard error so far."""
        self.seen: set[int] = set()
        """Every child ever seen."""
        self._out: list[str] = []
        self._readers = [
            threading.Thread(target=self._read, args=(self.process.stderr, self.lines)),
            threading.Thread(target=self._read, args=(self.process.stdout, self._out)),
        ]
        for reader in self._readers:
            reader.start()

    @staticmethod
    def _read(stream: Any, lines: list[str]) -> None:
        for line in stream:
            lines.append(line.rstrip("\n"))  # noqa: PERF401 - each line is seen at once

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
        self.process.wait()
        for reader in self._readers:
            reader.join(10)
        for stream in (self.process.stdout, self.process.stderr):
            if stream is not None:
                stream.close()
        for pid in self.seen:
            if alive(pid):  # only after a failed test
                os.kill(pid, signal.SIGKILL)

    def children(self) -> dict[str, int]:
        """Living children by command line."""
        found = child_pids(self.process.pid)
        self.seen.update(found.values())
        return found

    def _see_children(self) -> None:
        """Remember who runs, ten times a second or more: asks only those not seen yet."""
        for pid in _children(self.process.pid):
            if pid not in self.seen and _words(pid) is not None:
                self.seen.add(pid)

    def child(self, role: str, uav: str = "") -> int:
        """Pid of the one living child of that role, and of that UAV."""
        matches = [
            pid
            for words, pid in self.children().items()
            if words.startswith(f"{role} ") and (not uav or f"--uav {uav} " in words)
        ]
        assert len(matches) == 1, f"{role} {uav}: {matches} of {self.children()}"
        return matches[0]

    def wait_for_line(self, text: str, timeout_s: float = 60.0, count: int = 1) -> None:
        """Wait until ``text`` has come ``count`` times on standard error."""

        def there() -> bool:
            self._see_children()
            assert self.process.poll() is None or self._count(text) >= count, self.story()
            return self._count(text) >= count

        wait_until(there, timeout_s, f"line {text!r}")

    def _count(self, text: str) -> int:
        return sum(text in line for line in self.lines)

    def story(self) -> str:
        """Everything said on standard error."""
        return "\n".join(self.lines)

    def result(self, timeout_s: float = 200.0) -> tuple[int, dict[str, Any]]:
        """Exit status and JSON, once it has ended by itself."""
        deadline_s = time.monotonic() + timeout_s
        while self.process.poll() is None:
            self._see_children()
            assert time.monotonic() < deadline_s, self.story()
            time.sleep(0.1)
        for reader in self._readers:
            reader.join(10)
        assert len(self._out) == 1, (self._out, self.story())
        return self.process.returncode, json.loads(self._out[0])

    def end(self, number: signal.Signals, timeout_s: float = 30.0) -> int:
        """Send a signal and wait for the end; the exit status."""
        self.process.send_signal(number)
        return self.process.wait(timeout_s)

    def assert_nothing_left(self, timeout_s: float = 10.0, *, but: str = "") -> None:
        """No process that was ever seen lives on, and no file is left ``but`` of that pattern."""
        assert self.seen
        wait_until(lambda: not any(alive(pid) for pid in self.seen), timeout_s, "the end of all")
        assert [entry for entry in self.folder.iterdir() if not fnmatch(entry.name, but)] == []
