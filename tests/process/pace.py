"""How fast a test flies: on a slow or busy machine so slowly that processes can start meanwhile."""

from __future__ import annotations

import subprocess
import sys
import time

__all__ = ["pace"]


START_S = 1.0
"""A process that takes longer to start is on a slow or busy machine [s]."""
SLOWEST = 3.0


def pace(speedup: float) -> float:
    """Return mission seconds per wall second: ``speedup``, or less where processes start slowly.

    What a test does to a flight is done by processes that start while it is flown, so a flight
    must last the longer the longer they take to start.
    """
    began_s = time.monotonic()
    subprocess.run(
        [sys.executable, "-m", "swarm", "agent", "--help"], check=True, stdout=subprocess.DEVNULL
    )
    slowness = (time.monotonic() - began_s) / START_S
    return round(speedup / min(max(slowness, 1.0), SLOWEST), 2)
