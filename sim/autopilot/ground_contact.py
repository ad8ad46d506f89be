"""What flies into the ground: its motors stop there.

Where the mission has a terrain, places are looked at ten times a second while the motors run.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim.autopilot.flight import MotionPhase

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_CHECK_S = 0.1
_DEEP_M = 0.5
"""Who is no deeper has touched it at most [m]."""
_FLIES = frozenset(
    {
        MotionPhase.HOLDING,
        MotionPhase.NAVIGATING,
        MotionPhase.CLIMBING,
        MotionPhase.RETURNING,
        MotionPhase.WAITING,
    }
)


class GroundContact:
    """Watches one vehicle in flight."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self._check_s: float | None = None

    def armed(self, now_s: float) -> None:
        """Watch from now on."""
        self._check_s = now_s + _CHECK_S

    def disarmed(self) -> None:
        """Watch no more."""
        self._check_s = None

    def deadline_s(self) -> float | None:
        """When to look next [s]."""
        return None if self._pilot.config.terrain is None else self._check_s

    def advance(self, at_s: float) -> None:
        """Look where the vehicle is."""
        self._check_s = at_s + _CHECK_S
        flight = self._pilot.flight
        east_m, north_m, up_m = self._pilot.position_enu_m(at_s)
        if flight.activity in _FLIES and up_m < flight.ground_up_m(east_m, north_m) - _DEEP_M:
            self._pilot.disarm(at_s, forced=True)
