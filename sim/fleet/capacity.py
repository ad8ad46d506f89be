"""Whether a machine can fly a fleet at all, as far as that can be told before anything starts.

Measured by `swarm bench scale` at wall speed and 5 position reports a second (sim/README.md).
Leaves out: what else the machine does, which nobody knows beforehand.
"""

from __future__ import annotations

import os
from typing import Final

CPU_FRAC_PER_UAV: Final = 0.0135
"""Of one processor, in the midst of a mission of 60: an agent with a process of its own (1.06 %),
its simulated autopilot (0.17 %), what router, coordinator and launcher do for it (0.1 %)."""
CPU_FRAC_SHARED: Final = 0.0075
"""The same where `MANY` agents share a process: 0.5 % for each of them."""
CPU_FRAC_APART: Final = 0.034
"""The same of one that keeps a separation, with a process of its own: 30 take 1.0 processors, 50
take 1.53."""
CPU_FRAC_APART_SHARED: Final = 0.0125
"""And where they share processes: 100 of them take 1.23 processors, 200 take 1.8 to 2.0."""
MANY: Final = 10
BYTES_PER_UAV: Final = 45 * 10**6
"""Of an agent (26 MB) and an autopilot of its own (18 MB), shares of common pages included."""
BYTES_BESIDES: Final = 500 * 10**6
"""Of everything else of a run, shared pages included."""


def usable_cores() -> int:
    """Processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def memory_bytes() -> int:
    """RAM of this machine; 0 when unknown."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return 0


def cpu_frac(agents_per_process: int = 1, *, keeps_apart: bool = False) -> float:
    """What each UAV takes of one processor.

    Args:
        agents_per_process: how many agents share a process; counted as alone, or as dozens.
        keeps_apart: whether they keep a separation.
    """
    if agents_per_process < MANY:
        return CPU_FRAC_APART if keeps_apart else CPU_FRAC_PER_UAV
    return CPU_FRAC_APART_SHARED if keeps_apart else CPU_FRAC_SHARED


def too_large(
    n_uav: int,
    cores: int,
    memory_bytes: int,
    agents_per_process: int = 1,
    *,
    keeps_apart: bool = False,
) -> str | None:
    """Why that machine cannot fly so many UAVs; None if it can, for all that is known.

    Args:
        n_uav: size of the fleet.
        cores: processors that may be used.
        memory_bytes: RAM; 0 when unknown.
        agents_per_process: see `cpu_frac`.
        keeps_apart: see `cpu_frac`.
    """
    by_cores = int(cores / cpu_frac(agents_per_process, keeps_apart=keeps_apart))
    by_memory = int(max(0, memory_bytes - BYTES_BESIDES) / BYTES_PER_UAV)
    if n_uav > by_cores:
        has = "1 core" if cores == 1 else f"{cores} cores"
        which = " that keep apart" if keeps_apart else ""
        return f"{n_uav} UAVs{which}, and {has} can fly about {by_cores}"
    if memory_bytes and n_uav > by_memory:
        gib = memory_bytes / 2**30
        return f"{n_uav} UAVs, and {gib:.1f} GiB of memory have room for about {by_memory}"
    return None
