"""The battery of a vehicle: a charge that is drained while motors run, and what is measured of it.

The current is the same as long as the motors run, so charge, current, consumption and remaining
share agree with each other at every instant; the voltage falls in proportion to the charge. Left
out are sag under load, temperature, several batteries, what climbing or wind costs; a battery
without an endurance gives its current and stays full.
"""

from __future__ import annotations

from enum import IntEnum

from sim.autopilot.config import BatteryFailsafe

_FULL_V = 12.6
_EMPTY_V = 10.5
_FLIGHT_A = 30.0
_S_PER_H = 3600.0


class ChargeLevel(IntEnum):
    """How worried the firmware is."""

    FINE = 0
    LOW = 1
    CRITICAL = 2


class BatteryModel:
    """One battery.

    Without an ``endurance_s`` [s], of armed time or time in flight, it stays as it is; without a
    ``failsafe`` the firmware never acts.
    """

    def __init__(
        self,
        endurance_s: float | None,
        failsafe: BatteryFailsafe | None,
        charge_frac: float = 1.0,
    ) -> None:
        self._endurance_s = endurance_s
        self._steps: tuple[tuple[float, ChargeLevel], ...] = ()
        if failsafe is not None:
            low, critical = failsafe.low_frac, failsafe.critical_frac
            self._steps = (low, ChargeLevel.LOW), (critical, ChargeLevel.CRITICAL)
        self.level = ChargeLevel.FINE
        """How worried the firmware is."""
        self._charge_frac = charge_frac
        """Charge at the instant from which the motors run, or now while they stand."""
        self._running_since_s: float | None = None

    def start(self, now_s: float) -> None:
        """The motors run from now on."""
        if self._running_since_s is None:
            self._running_since_s = now_s

    def stop(self, now_s: float) -> None:
        """The motors stand from now on."""
        self._charge_frac = self.remaining_frac(now_s)
        self._running_since_s = None

    def fill(self) -> None:
        """Be another battery, a full one, in a vehicle whose motors stand."""
        self._charge_frac = 1.0
        self.level = ChargeLevel.FINE

    def drop_to(self, charge_frac: float, now_s: float) -> None:
        """Lose charge at once; one that is lower already stays."""
        self._charge_frac = min(charge_frac, self.remaining_frac(now_s))
        if self._running_since_s is not None:
            self._running_since_s = now_s

    def remaining_frac(self, now_s: float) -> float:
        """Charge left, 0..1."""
        if self._endurance_s is None or self._running_since_s is None:
            return self._charge_frac
        return max(0.0, self._charge_frac - (now_s - self._running_since_s) / self._endurance_s)

    @property
    def current_a(self) -> float:
        """Current drawn [A]."""
        return 0.0 if self._running_since_s is None else _FLIGHT_A

    def voltage_v(self, now_s: float) -> float:
        """Voltage of the whole battery [V]."""
        return _EMPTY_V + (_FULL_V - _EMPTY_V) * self.remaining_frac(now_s)

    def consumed_mah(self, now_s: float) -> float | None:
        """Charge drawn since it was full [mAh]; None where the capacity is unknown."""
        if self._endurance_s is None:
            return None
        capacity_mah = _FLIGHT_A * self._endurance_s / _S_PER_H * 1e3
        return capacity_mah * (1.0 - self.remaining_frac(now_s))

    def deadline_s(self) -> float | None:
        """When the firmware has to act next [s]; None if not foreseen."""
        steps_s = self._steps_s()
        return min(steps_s)[0] if steps_s else None

    def advance(self, at_s: float) -> ChargeLevel:
        """Take the worst of the levels that are due by ``at_s``."""
        due = [level for step_s, level in self._steps_s() if step_s <= at_s]
        self.level = max([self.level, *due])
        return self.level

    def _steps_s(self) -> list[tuple[float, ChargeLevel]]:
        """When each worse level is reached."""
        since_s = self._running_since_s
        if since_s is None:
            return []
        steps_s = []
        for step_frac, level in self._steps:
            if level > self.level and self._charge_frac <= step_frac:
                steps_s.append((since_s, level))
            elif level > self.level and self._endurance_s is not None:
                lasts_s = (self._charge_frac - step_frac) * self._endurance_s
                steps_s.append((since_s + lasts_s, level))
        return steps_s
