"""Flies what the items of a mission ask for.

Leaves out: which item comes next (sim.autopilot.mission_run), modes and motors
(sim.autopilot.pilot).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

from sim.autopilot.config import VehicleConfig
from sim.autopilot.events import FirmwareEvent, Narrator
from sim.autopilot.firmware.model import FirmwareModel
from sim.autopilot.flight import FlightMode, FlightStateMachine, Milestone
from sim.autopilot.mission_store import StoredMissionItem, item_place_enu_m
from sim.autopilot.parameters import ParameterRole, ParameterTable
from sim.world.motion import Point

__all__ = ["FlightControls", "MissionFlight"]


_CLIMB_LEAST_M = 0.8
"""Less than this is not climbed before the first item [m]."""


class FlightControls(Protocol):
    """What flying a mission asks of the pilot."""

    narrator: Narrator

    def position_enu_m(self, now_s: float) -> Point:
        """Where the vehicle is [m]."""
        ...

    def enter(self, mode: FlightMode, now_s: float) -> None:
        """Be in a mode from now on."""
        ...

    def lift(self, up_m: float, now_s: float) -> None:
        """Rise to a height in the local frame [m]."""
        ...

    def let_targets(self, now_s: float) -> None:
        """Stay, and fly to targets from now on as if the mode for them had been entered."""
        ...

    def stay_on_ground(self, now_s: float) -> None:
        """Give up a take-off that has not begun to rise."""
        ...

    def finish_task(self, now_s: float, *, motors_stop: bool = False) -> None:
        """Be done with what the mode was for."""
        ...


class MissionFlight:
    """The `MissionPilot` of one vehicle."""

    def __init__(
        self,
        helm: FlightControls,
        config: VehicleConfig,
        flavour: FirmwareModel,
        flight: FlightStateMachine,
        parameters: ParameterTable,
    ) -> None:
        self.climb_due = False
        """The next item is to be flown to from its own height."""
        self._helm = helm
        self._config = config
        self._flavour = flavour
        self._flight = flight
        self._parameters = parameters
        self._after_climb: StoredMissionItem | None = None
        self._speed_m_s: float | None = None
        """What the mission asked for, if it did."""

    def begin(self) -> None:
        """Hear that a mode has just been entered."""
        self.climb_due = self._flavour.missions.climbs_first
        self._after_climb = self._speed_m_s = None

    def continues(self, milestone: Milestone, at_s: float) -> bool:
        """Fly on to an item's place after the climb to its height; False if there was none."""
        if milestone is Milestone.UNDERWAY or self._after_climb is None:
            return False
        item, self._after_climb = self._after_climb, None
        self._flight.navigate(self._place(item, at_s), at_s)
        return True

    def mission_take_off(self, item: StoredMissionItem, now_s: float) -> None:
        """Rise to the height of the item, at least to where the vehicle is."""
        self.climb_due = False
        place = self._place(replace(item, lat_e7=0, lon_e7=0), now_s)
        self._helm.lift(max(place[2], self._helm.position_enu_m(now_s)[2]), now_s)

    def mission_navigate(self, item: StoredMissionItem, now_s: float) -> None:
        """Fly to the place of the item; from the ground only where it is risen to first."""
        self._after_climb = None
        if self._speed_m_s is not None:
            self._flight.override_cruise(self._speed_m_s, now_s)
        place = self._place(item, now_s)
        east_m, north_m, up_m = self._helm.position_enu_m(now_s)
        if self.climb_due and (self._flight.on_ground or place[2] > up_m + _CLIMB_LEAST_M):
            self.climb_due = False
            self._after_climb = item
            height_m = place[2] - self._flight.home_enu_m[2]
            self._helm.narrator.tell(FirmwareEvent.MISSION_CLIMB, height_m=height_m)
            if self._flight.on_ground:
                self._helm.lift(place[2], now_s)
            else:
                climb_m_s = self._parameters.value_si(ParameterRole.CLIMB_M_S)
                self._flight.navigate((east_m, north_m, place[2]), now_s, climb_m_s)
        elif self._flight.on_ground:
            self._helm.stay_on_ground(now_s)
        else:
            self.climb_due = False
            self._flight.navigate(place, now_s)

    def mission_give_way(self, now_s: float) -> None:
        """Stay where the vehicle is, and fly to the targets that are told."""
        self._after_climb = None
        self._helm.let_targets(now_s)

    def mission_land(self, now_s: float) -> None:
        """Land where the vehicle is."""
        self.climb_due = False
        self._flight.land(now_s)

    def mission_return(self, now_s: float) -> None:
        """Return home and land, in the mode for it where the mission ends so."""
        if self._flavour.missions.forgets_mode:
            self._helm.narrator.tell(FirmwareEvent.RETURN_ORDERED)
            self._helm.enter(FlightMode.RTL, now_s)
        else:
            self._flight.return_home(now_s)

    def mission_change_speed(self, speed_m_s: float, now_s: float) -> None:
        """Fly at another speed [m/s] until AUTO is left."""
        self._speed_m_s = speed_m_s
        self._flight.override_cruise(speed_m_s, now_s)

    def mission_finished(self, now_s: float) -> None:
        """Stay where the last item ended: in the air, or on the ground with motors stopped."""
        on_ground = self._flight.on_ground
        self._helm.narrator.tell(
            FirmwareEvent.MISSION_OVER_ON_GROUND if on_ground else FirmwareEvent.MISSION_OVER
        )
        motors_stop = on_ground and self._flavour.disarm_delay(FlightMode.LAND) is None
        self._helm.finish_task(now_s, motors_stop=motors_stop)
        if not on_ground and self._flavour.missions.forgets_mode:
            self._helm.enter(self._flavour.modes.for_reposition, now_s)
        elif not on_ground:
            self._flight.hold(now_s)

    def _place(self, item: StoredMissionItem, now_s: float) -> Point:
        return item_place_enu_m(
            item,
            self._config.origin,
            self._helm.position_enu_m(now_s),
            self._flight.home_enu_m[2],
        )
