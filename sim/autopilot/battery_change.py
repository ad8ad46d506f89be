"""Somebody at a base who gives vehicles that landed there another battery.

A vehicle that has flown, and stands near a base with its motors stopped, gets a full battery. As in
life that cuts the power of its autopilot for a while, unless batteries overlap: it is told nothing
and says nothing, and boots again in time to be ready when the base's duration is over. A vehicle
that is armed before somebody has laid hands on it keeps its battery. Who waits for a slot, and
that a person must allow the start, is the business of agents and operators.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim.autopilot.config import VehicleConfig
from sim.autopilot.pilot import Pilot

_NEAR_M = 60.0
"""Who stands no farther from a base than this, seen from above, is served there [m]: the UAVs of
a fleet land on spots of their own round it."""
_LEAST_STAND_S = 2.0
"""So long motors have stood, at least, before anybody takes the battery out [s]."""


@dataclass(frozen=True, slots=True)
class PowerCut:
    """When the autopilot is without power."""

    off_s: float
    on_s: float


class BatteryChange:
    """What happens at bases to one vehicle."""

    def __init__(self, config: VehicleConfig) -> None:
        self._bases = config.bases
        self._reboots = config.swap_reboots
        self._silence_s = config.swap_silence_s
        self._boot_s = config.delays.position_s

    def due(self, pilot: Pilot) -> PowerCut | None:
        """When the battery is changed if nothing happens before; None: nobody is about to.

        A change that cuts no power has both instants at its end.
        """
        stands_s = pilot.stands_since_s
        if stands_s is None or (swap_s := self._swap_s(pilot, stands_s)) is None:
            return None
        if not self._reboots:
            return PowerCut(stands_s + swap_s, stands_s + swap_s)
        off_s = stands_s + max(_LEAST_STAND_S, swap_s - self._silence_s - self._boot_s)
        return PowerCut(off_s, off_s + self._silence_s)

    def _swap_s(self, pilot: Pilot, now_s: float) -> float | None:
        """How long it takes where the vehicle stands [s]; None if that is at no base."""
        here_enu_m = pilot.position_enu_m(now_s)
        near = [
            (distance_m, base.swap_s)
            for base in self._bases
            if (distance_m := math.dist(base.position_enu_m[:2], here_enu_m[:2])) <= _NEAR_M
        ]
        return min(near)[1] if near else None
