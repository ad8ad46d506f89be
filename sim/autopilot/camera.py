"""A camera: what its trigger was told and what it is kept on; and so where the nose points.

Pictures themselves, gimbals, and the time that a turn takes are left out: who is to look somewhere
does so at once, by the nose.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from sim.autopilot.flight import FlightMode
from sim.world.motion import Point

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_BELOW_M = 1.0
"""Nobody turns to what is as good as below."""


class VehicleCamera:
    """The camera of one vehicle."""

    def __init__(self, pilot: Pilot) -> None:
        self._pilot = pilot
        self.distance_m = 0.0
        """A picture every so many metres; 0: none."""
        self.orders: list[float] = []
        """The distances that were set [m], oldest first."""
        self.looks_at_enu_m: Point | None = None
        """The region of interest; None: there is none."""
        self.looks: list[Point | None] = []
        """What was told of that, oldest first."""
        self._target_deg: float | None = None
        """Heading that came with the target flown to; None: none did."""

    def trigger(self, distance_m: float) -> bool:
        """Take a picture every so many metres from now on; False if that is no distance."""
        if not 0.0 <= distance_m < math.inf:
            return False
        self.distance_m = distance_m
        self.orders.append(distance_m)
        return True

    def look_at(self, place_enu_m: Point | None) -> None:
        """Be kept on that, None: on nothing, from now on."""
        self.looks_at_enu_m = place_enu_m
        self.looks.append(place_enu_m)

    def on_target(self, heading_deg: float | None = None) -> None:
        """Hear that another mode or target begins, with a heading for the nose if it has one."""
        self._target_deg = heading_deg
        if self._pilot.flavour.targets_end_look:
            self.looks_at_enu_m = None

    def on_mission(self) -> None:
        """Hear that another mission stands on the vehicle."""
        if not self._pilot.flavour.targets_end_look:
            self.looks_at_enu_m = None

    def heading_deg(self, now_s: float) -> float | None:
        """Where the nose was told to point, clockwise from north; None: it points along the way."""
        pilot = self._pilot
        if not pilot.armed or pilot.flight.on_ground:
            return None
        if pilot.flavour.looks_in_missions_alone and pilot.mode is not FlightMode.AUTO:
            return self._target_deg
        if self.looks_at_enu_m is None:
            return None
        east_m, north_m, _ = (
            there - here
            for here, there in zip(pilot.position_enu_m(now_s), self.looks_at_enu_m, strict=True)
        )
        if math.hypot(east_m, north_m) < _BELOW_M:
            return None
        return math.degrees(math.atan2(east_m, north_m))
