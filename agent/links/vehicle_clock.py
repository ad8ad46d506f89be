"""How fast a vehicle's clock runs beside ours.

That of a real vehicle keeps up. A simulated one that does not get enough of the processor, or that
sleeps a little too long in each of its steps, flies more slowly than it believes: what it takes for
a leg by our clock then says something of the machine.
"""

from __future__ import annotations

_LEAST_S = 10.0
"""A shorter time says nothing."""


class VehicleClock:
    """The time since boot that one vehicle tells, beside our own."""

    def __init__(self) -> None:
        self._first: tuple[float, float] | None = None
        self._last: tuple[float, float] | None = None

    def note(self, boot_s: float, now_s: float) -> None:
        """It told that time since its boot; after a reboot all begins anew."""
        told = boot_s, now_s
        if self._first is None or self._last is None or boot_s < self._last[0]:
            self._first = told
        self._last = told

    @property
    def frac(self) -> float | None:
        """Its seconds per one of ours, since it was first heard; None if that is too short."""
        if self._first is None or self._last is None:
            return None
        boot_s, own_s = (b - a for a, b in zip(self._first, self._last, strict=True))
        return boot_s / own_s if own_s >= _LEAST_S else None
