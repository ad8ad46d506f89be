"""Where time comes from: the sole reader of the system clock.

Instants and durations are float seconds. Cores never read a clock: shells pass
``now_s`` in.
"""

from __future__ import annotations

import time
from typing import Protocol


class Clock(Protocol):
    """A monotonic source of seconds with an arbitrary zero."""

    def now_s(self) -> float:
        """Seconds since an arbitrary instant; never decreases."""

    def wall_delay_s(self, delay_s: float) -> float:
        """Wall seconds that pass while this clock advances by ``delay_s``."""


def elapsed_s(clock: Clock, wall_s: float) -> float:
    """How far ``clock`` advances in ``wall_s`` wall seconds [s]."""
    return wall_s / clock.wall_delay_s(1.0)


class SystemClock:
    """The machine's monotonic clock."""

    def now_s(self) -> float:
        """Monotonic seconds."""
        return time.monotonic()

    def wall_delay_s(self, delay_s: float) -> float:
        """The same duration: this clock runs at wall speed."""
        return delay_s


class ScaledClock:
    """A clock that runs ``speedup`` times as fast as the machine's.

    Mission time and all timeouts that concern vehicles are in seconds of this
    clock; timeouts that concern the network are wall seconds.
    """

    def __init__(self, speedup: float) -> None:
        if not 0.0 < speedup < float("inf"):
            raise ValueError(f"speedup must be positive and finite, not {speedup}")
        self.speedup = speedup
        self._origin_s = time.monotonic()

    def now_s(self) -> float:
        """Scaled seconds since construction."""
        return (time.monotonic() - self._origin_s) * self.speedup

    def wall_delay_s(self, delay_s: float) -> float:
        """Wall seconds for ``delay_s`` seconds of this clock."""
        return delay_s / self.speedup


def incarnation() -> int:
    """Milliseconds of wall time: grows from one life of a process to the next."""
    return time.time_ns() // 1_000_000


def unix_s() -> float:
    """Wall time: the one clock that goes on from one life of a process to the next."""
    return time.time()


def unix_ns() -> int:
    """The same in nanoseconds, for stamps that other systems read."""
    return time.time_ns()
