"""The battery of a simulated vehicle: a share of its airborne time, drained in flight alone."""

from __future__ import annotations

import math


class FlightBattery:
    """Charge by airborne time, as plans count it, or faster.

    It drains from the later of lift-off and mission time 0 on, since take-off is no part of that.

    Args:
        endurance_s: airborne time that a full battery gives [s].
        charge_frac: charge before the first flight.
    """

    def __init__(self, endurance_s: float, charge_frac: float) -> None:
        self.drain = 1.0
        """Share of the endurance that a second takes, as a multiple of what it should; > 0."""
        self._endurance_s = endurance_s
        self._frac = charge_frac
        self._since_s: float | None = None
        """From when on it drains; None on the ground, and until the mission begins."""

    def drains_since(self, now_s: float) -> None:
        """It is in the air from then on, which may be to come."""
        if self._since_s is None:
            self._since_s = now_s

    def touch_down(self, now_s: float) -> None:
        """It is on the ground: what is left stays."""
        self._settle(now_s)
        self._since_s = None

    def fill(self) -> None:
        """It is changed for a full one, on the ground."""
        self._frac = 1.0

    def drain_by(self, drain: float, now_s: float) -> None:
        """Let it drain so much faster than it should from now on."""
        self._settle(now_s)
        self.drain = drain

    def frac(self, now_s: float) -> float:
        """Charge at that instant, 0..1."""
        since_s = now_s if self._since_s is None else min(now_s, self._since_s)
        flown_s = max(0.0, now_s - since_s)
        return min(1.0, max(0.0, self._frac - self.drain * flown_s / self._endurance_s))

    @property
    def empty_s(self) -> float:
        """When it will be empty if nothing happens to it [s]; infinite on the ground."""
        if self._since_s is None:
            return math.inf
        return self._since_s + self._frac * self._endurance_s / self.drain

    def _settle(self, now_s: float) -> None:
        if self._since_s is not None and now_s > self._since_s:
            self._frac, self._since_s = self.frac(now_s), now_s
