"""How fast a test flies: on a slow or busy machine so slowly that processes can start meanwhile."""

from __future__ import annotations

import time

from tests.process.programs import run_swarm

START_S = 0.2
"""A process that takes longer to be forked, and to say its help, is on a slow machine [s]."""
STARTS = 3
"""Tried, since one alone may be lucky."""
SLOWEST = 3.0


def pace(speedup: float) -> float:
    """Return mission seconds per wall second: ``speedup``, or less where processes start slowly.

    What a test does to a flight is done by processes that start while it is flown, so a flight
    must last the longer the longer they take to start.
    """
    began_s = time.monotonic()
    for _ in range(STARTS):
        run_swarm("agent", "--help")
    slowness = (time.monotonic() - began_s) / STARTS / START_S
    return round(speedup / min(max(slowness, 1.0), SLOWEST), 2)
