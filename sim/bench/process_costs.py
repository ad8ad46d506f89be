"""What the processes of a run cost, by kind: processor time and memory, looked at while they run.

Linux alone tells it. Leaves out: what a process used after the last look at it, a fifth of a
second before its end at most.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

from sim.bench.machine import cpu_s, memory_bytes
from sim.launch.launch import Launch

__all__ = ["LAUNCHER", "Costs", "ProcessCosts", "kind_of"]

LAUNCHER = "swarm run"


@dataclass(frozen=True, slots=True)
class Costs:
    """Of all processes of a run, by kind."""

    processes: Mapping[str, int]
    """How many there were."""
    cpu_s: Mapping[str, float]
    """Processor time of all of them together [s]."""
    memory_bytes: Mapping[str, float]
    """Most that one of them held in RAM at a look, on average over them."""


class ProcessCosts:
    """Looks at every process of one launch.

    Args:
        pid: of the process that launches.
    """

    def __init__(self, pid: int) -> None:
        self._kinds = {pid: LAUNCHER}
        self._began_s = {pid: cpu_s(pid)}
        self._cpu_s: dict[int, float] = {}
        self._most_bytes: dict[int, int] = {}

    def look(self, launch: Launch) -> None:
        """Note what each living process has used so far."""
        for child in launch.lives:
            if child.returncode is None:
                self._kinds.setdefault(child.pid, kind_of(child.arguments))
        for pid in self._kinds:
            with contextlib.suppress(OSError, IndexError):  # gone meanwhile
                used_s, held = cpu_s(pid), memory_bytes(pid)
                if held:  # a process that has ended and was not waited for holds nothing
                    self._cpu_s[pid] = used_s - self._began_s.get(pid, 0.0)
                    self._most_bytes[pid] = max(held, self._most_bytes.get(pid, 0))

    def costs(self) -> Costs:
        """As they stood at the last look."""
        count = Counter(self._kinds[pid] for pid in self._cpu_s)
        used_s, held = dict.fromkeys(count, 0.0), dict.fromkeys(count, 0.0)
        for pid, time_s in self._cpu_s.items():
            kind = self._kinds[pid]
            used_s[kind] += time_s
            held[kind] += self._most_bytes[pid] / count[kind]
        return Costs(dict(count), used_s, held)


def kind_of(arguments: tuple[str, ...]) -> str:
    """The kind of a process with that command line: the `swarm` command, or firmware."""
    return arguments[0] if arguments[0].isalpha() else "firmware"
