"""What the figures were measured on."""

from __future__ import annotations

import os
import platform
import sys
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

import swarm
from sim.fleet.capacity import memory_bytes, usable_cores

_CPU_INFO = Path("/proc/cpuinfo")
_STATUS = Path("/proc/self/status")


@dataclass(frozen=True, slots=True)
class MachineInfo:
    """A computer and the versions on it."""

    cpu: str
    """Model as it calls itself."""
    cores: int
    """Processors this process may use."""
    memory_bytes: int
    """RAM; 0 when unknown."""
    system: str
    versions: dict[str, str]
    """By name: Python, this project, and packages that matter here."""
    load: float | None
    """Processes that wanted to run in the last minute, before the benchmark began."""

    def __str__(self) -> str:
        memory = f", {self.memory_bytes / 2**30:.0f} GiB RAM" if self.memory_bytes else ""
        load = "" if self.load is None else f"; load before the start {self.load:.1f}"
        versions = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        return f"{self.cpu}, {self.cores} cores{memory}; {self.system}; {versions}{load}"


def this_machine() -> MachineInfo:
    """Describe the machine this process runs on."""
    versions = {"Python": platform.python_version(), "peckorder": swarm.__version__}
    versions["NumPy"] = np.__version__
    with suppress(PackageNotFoundError):
        versions["OR-Tools"] = version("ortools")
    return MachineInfo(
        cpu=processor_name(),
        cores=usable_cores(),
        memory_bytes=memory_bytes(),
        system=f"{platform.system()} {platform.machine()}",
        versions=versions,
        load=os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    )


def peak_memory_bytes() -> int:
    """Most memory this process has held in RAM since its program was started.

    Linux tells it per address space; getrusage there would count what the process was forked
    from too.
    """
    try:
        for line in _STATUS.read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024


def cpu_s(pid: int) -> float:
    """Processor time a process has used, in user and system mode [s]; Linux alone tells it."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def held_bytes(pid: int) -> int:
    """What a process holds in RAM; Linux alone tells it."""
    pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def share_bytes(pid: int) -> int:
    """What a process holds in RAM, of pages that several share its part; Linux alone tells it."""
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) * 1024
    raise OSError(f"/proc/{pid}/smaps_rollup tells no proportional share")


def processor_name() -> str:
    """Model of the processor as it calls itself."""
    try:
        for line in _CPU_INFO.read_text().splitlines():
            name, _, model = line.partition(":")
            if name.strip() == "model name":
                return " ".join(model.split())
    except OSError:
        pass
    return platform.processor() or platform.machine() or "unknown processor"
