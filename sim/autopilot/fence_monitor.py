"""What the firmware does when the vehicle breaks an uploaded fence: say so, return, hold or land.

Places are looked at ten times a second while the motors run. It acts once for each time that the
vehicle breaks the fence; who is told to fly on from there flies. Left out are margins, predictions
and the check of a mission against the fence.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import FirmwareEvent
from sim.autopilot.fence import FenceStore
from sim.autopilot.flight import FlightMode
from sim.world.motion import Point

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_CHECK_S = 0.1
_STORED_BESIDE = 2
"""ArduCopter counts so many more than there are corners, of one polygon or two."""


class FenceMonitor:
    """The fence of one autopilot, from power-up on."""

    def __init__(self, pilot: Pilot, store: FenceStore) -> None:
        self._pilot = pilot
        self._store = store
        self._check_s: float | None = None
        self.breached = False
        """The vehicle is where the fence does not allow it to be."""
        self.switched: bool | None = None
        """By command, since power-up; None: neither on nor off."""
        self._breaches = 0
        self._acted_in: FlightMode | None = None
        """The mode that it entered for that; None: it did nothing."""

    @property
    def acts(self) -> bool:
        """Whether the vehicle says that it is in a critical state for it."""
        told = self._pilot.flavour.fence_behaviour.critical
        return told and self.breached and self._acted_in is self._pilot.mode

    @property
    def obstacles(self) -> tuple[str, ...]:
        """Why the vehicle can't be armed, in its words."""
        behaviour = self._pilot.flavour.fence_behaviour
        if self._pilot.armed and not behaviour.critical:
            return ()
        return (behaviour.obstacle,) if self.breached else ()

    @property
    def area_count(self) -> int:
        """How many polygons and circles stand on the vehicle."""
        return len(self._store.fence.areas)

    def allows(self, place_enu_m: Point) -> bool:
        """Whether the fence, if it is on, lets the vehicle be there."""
        behaviour = self._pilot.flavour.fence_behaviour
        on = self._pilot.flavour.fence_on(self._pilot.parameters, self.switched)
        if not (self._store.fence.areas and on):
            return True
        added = behaviour.inclusions_add
        if behaviour.needs_home_inside:
            home_m = self._pilot.flight.home_enu_m[:2]
            if not self._store.fence.allows(home_m, any_inclusion=added) and not self.breached:
                return True  # it was told so, and takes the fence for none
        return self._store.fence.allows(place_enu_m[:2], any_inclusion=added)

    def allows_target(self, target_enu_m: Point) -> bool:
        """Whether a target lies inside the vehicle's own fence around home and the uploaded one."""
        radius_m = self._pilot.flavour.fence_radius_m(self._pilot.parameters)
        away_m = math.dist(target_enu_m[:2], self._pilot.flight.home_enu_m[:2])
        return not 0.0 < radius_m < away_m and self.allows(target_enu_m)

    def switch(self, now_s: float, *, on: bool) -> bool:
        """Heed it from now on, or not; whether there is one."""
        if on and not self._store.fence.areas:
            return False
        self.switched = on
        self._look(now_s, acts=self._pilot.armed and not self._pilot.flight.on_ground)
        return True

    def uploaded(self, now_s: float) -> None:
        """Hear that there is another fence."""
        self._pilot.narrator.tell(FirmwareEvent.FENCE_RECEIVED)
        items = len(self._store.items)
        total = items + _STORED_BESIDE if items else 0
        self._pilot.parameter_server.announce("FENCE_TOTAL", float(total))
        self.breached = False
        if self._check_s is not None:
            self._check_s = now_s + _CHECK_S  # nobody has looked while there was none
        self._look(now_s, acts=self._pilot.armed and not self._pilot.flight.on_ground)
        added = self._pilot.flavour.fence_behaviour.inclusions_add
        home_m = self._pilot.flight.home_enu_m[:2]
        if not self._store.fence.allows(home_m, any_inclusion=added):
            self._pilot.narrator.tell(FirmwareEvent.FENCE_WITHOUT_HOME)

    def armed(self, now_s: float) -> None:
        """Watch from now on."""
        self._check_s = now_s + _CHECK_S

    def disarmed(self, now_s: float) -> None:
        """Watch no more: the vehicle stands where it is."""
        self._check_s = None
        self._acted_in = None
        self._look(now_s, acts=False)

    def deadline_s(self) -> float | None:
        """When to look next [s]."""
        return self._check_s if self._store.items else None

    def advance(self, at_s: float) -> None:
        """Look where the vehicle is, and act if that is forbidden."""
        self._check_s = at_s + _CHECK_S
        self._look(at_s, acts=not self._pilot.flight.on_ground)

    def _look(self, now_s: float, *, acts: bool) -> None:
        was, self.breached = self.breached, not self.allows(self._pilot.position_enu_m(now_s))
        if was and not self.breached:
            self._acted_in = None
            self._pilot.narrator.tell(FirmwareEvent.FENCE_CLEARED)
        if self.breached and not was:
            self._breaches += 1
            self._tell(now_s)
            if acts:
                self._act(now_s)
            elif not self._pilot.armed:
                for obstacle in self.obstacles:
                    self._pilot.narrator.tell(FirmwareEvent.NOT_READY, obstacle=obstacle)

    def _tell(self, now_s: float) -> None:
        if not self._pilot.flavour.fence_behaviour.tells_status:
            return
        boot_ms = round((now_s - self._pilot.readiness.boot_s) * 1e3)
        self._pilot.outbox.broadcast(
            mavlink.MAVLink_fence_status_message(
                int(self.breached), self._breaches, mavlink.FENCE_BREACH_BOUNDARY, boot_ms, 1
            )
        )

    def _act(self, now_s: float) -> None:
        pilot = self._pilot
        mode = pilot.flavour.fence_mode(pilot.parameters)
        if mode is pilot.mode:
            pilot.enter(mode, now_s)  # to stop there
        elif mode is not None and not pilot.set_mode(mode, now_s):
            pilot.set_mode(FlightMode.LAND, now_s)
        pilot.narrator.tell(FirmwareEvent.FENCE_BREACHED)
        if mode is not None:
            self._acted_in = pilot.mode
            pilot.narrator.tell(FirmwareEvent.FENCE_ACTED)
