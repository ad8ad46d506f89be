"""How full the batteries of one vehicle are, by all that it says of them.

BATTERY_STATUS tells of each battery, SYS_STATUS of one that the autopilot chooses; it counts where
nothing else tells. What is empty first ends the flight, so the lowest battery that lifts counts.
In the air nothing charges: where a battery drops out, what is told goes on from where it was and
falls as the others fall. On the ground a battery may be another one, and what is told is believed.
"""

from __future__ import annotations

from typing import Final

_DROPS_OUT_S: Final = 10.0
"""A battery of which nothing is heard for that long, while others speak, has dropped out."""
_SYSTEM: Final = -1
"""Stands for SYS_STATUS among the numbers of batteries."""


class ChargeMeter:
    """The charge of one vehicle."""

    def __init__(self) -> None:
        self.frac: float | None = None
        """What counts, 0..1; None where nothing is known."""
        self.told_at_s: float | None = None
        """When that was told last."""
        self._told: dict[int, tuple[float, float]] = {}
        """By battery, its charge and when that was told."""
        self._tellers: frozenset[int] = frozenset()
        """Whose words count."""
        self._above_frac = 0.0
        """By how much these tell more than what was told before others dropped out."""

    def on_battery(self, number: int, frac: float | None, now_s: float, *, armed: bool) -> None:
        """One battery that lifts tells its charge; None: it does not know it."""
        self._hear(number, frac, now_s, armed=armed)

    def on_system(self, frac: float | None, now_s: float, *, armed: bool) -> None:
        """The autopilot tells the charge of the battery that it chooses; None: it knows none."""
        self._hear(_SYSTEM, frac, now_s, armed=armed)

    def _hear(self, number: int, frac: float | None, now_s: float, *, armed: bool) -> None:
        if frac is None:
            self._told.pop(number, None)
        else:
            self._told[number] = frac, now_s
        told = {each: f for each, (f, at_s) in self._told.items() if now_s - at_s < _DROPS_OUT_S}
        batteries = {each: f for each, f in told.items() if each != _SYSTEM} or told
        lowest_frac = min(batteries.values(), default=None)
        if not armed:
            self._above_frac = 0.0
        elif batteries.keys() != self._tellers and lowest_frac is not None:
            before_frac = lowest_frac if self.frac is None else self.frac
            self._above_frac = max(0.0, lowest_frac - before_frac)
        self._tellers = frozenset(batteries)
        self.frac = None if lowest_frac is None else max(0.0, lowest_frac - self._above_frac)
        if number in batteries:
            self.told_at_s = now_s
