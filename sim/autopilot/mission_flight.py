"""Flies what the items of a mission ask for; which comes next says sim.autopilot.mission_run."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.events import FirmwareEvent
from sim.autopilot.flight import FlightMode, Milestone
from sim.autopilot.mission_item import StoredMissionItem, item_place_enu_m
from sim.autopilot.parameters import ParameterRole
from sim.autopilot.positions import place_wgs84_e7
from sim.world.motion import Point

if TYPE_CHECKING:
    from sim.autopilot.pilot import Pilot

_CLIMB_LEAST_M = 0.8
"""Less than this is not climbed before the first item [m]."""


class MissionFlight:
    """How one vehicle flies missions."""

    def __init__(self, pilot: Pilot) -> None:
        self.climb_due = False
        """The next item is to be flown to from its own height."""
        self._pilot = pilot
        self._flight = pilot.flight
        self._behaviour = pilot.flavour.missions
        self._after_climb: StoredMissionItem | None = None
        self._speed_m_s: float | None = None
        """What the mission asked for, if it did."""

    def begin(self) -> None:
        """Hear that a mode has just been entered."""
        self.climb_due = self._behaviour.climbs_first
        self._after_climb = self._speed_m_s = None

    def continues(self, milestone: Milestone, at_s: float) -> bool:
        """Fly on to an item's place after the climb to its height; False if there was none."""
        if milestone is Milestone.UNDERWAY or self._after_climb is None:
            return False
        item, self._after_climb = self._after_climb, None
        self._flight.navigate(self._place(item, at_s), at_s)
        return True

    def take_off(self, item: StoredMissionItem, now_s: float) -> None:
        """Rise to the height of the item, at least to where the vehicle is."""
        self.climb_due = False
        place = self._place(replace(item, lat_e7=0, lon_e7=0), now_s)
        self._pilot.lift(max(place[2], self._pilot.position_enu_m(now_s)[2]), now_s)

    def navigate(self, item: StoredMissionItem, now_s: float, *, passes: bool) -> None:
        """Fly to the place of the item; from the ground only where it is risen to first.

        Where the mission goes on from there at once, it ``passes`` the place without a stop.
        """
        self._after_climb = None
        if self._speed_m_s is not None:
            self._flight.override_cruise(self._speed_m_s, now_s)
        place = self._place(item, now_s)
        east_m, north_m, up_m = self._pilot.position_enu_m(now_s)
        if self.climb_due and (self._flight.on_ground or place[2] > up_m + _CLIMB_LEAST_M):
            self.climb_due = False
            self._after_climb = item
            height_m = place[2] - self._flight.home_enu_m[2]
            self._pilot.narrator.tell(FirmwareEvent.MISSION_CLIMB, height_m=height_m)
            if self._flight.on_ground:
                self._pilot.lift(place[2], now_s)
            else:
                climb_m_s = self._pilot.parameters.value_si(ParameterRole.CLIMB_M_S)
                self._flight.navigate((east_m, north_m, place[2]), now_s, climb_m_s)
        elif self._flight.on_ground:
            self._pilot.stay_on_ground(now_s)
        else:
            self.climb_due = False
            self._flight.navigate(place, now_s, near_m=self._near_m(item, passes=passes))

    def _near_m(self, item: StoredMissionItem, *, passes: bool) -> float:
        """How near a waypoint is near enough [m]; 0 where the vehicle stops there."""
        if not passes or not self._pilot.config.rounds_corners:
            return 0.0
        own_m = item.params[1] if self._behaviour.item_radius else 0.0
        usual_m = self._pilot.parameters.value_si(ParameterRole.CORNER_RADIUS_M)
        return own_m if own_m > 0.0 else usual_m

    def give_way(self, now_s: float) -> None:
        """Stay where the vehicle is, and fly to the targets that are told."""
        self._after_climb = None
        self._pilot.camera.on_target()
        self._pilot.let_targets(now_s)

    def land(self, now_s: float) -> None:
        """Land where the vehicle is."""
        self.climb_due = False
        self._flight.land(now_s)

    def come_down(self, now_s: float) -> None:
        """To the circle before a runway, and down from there."""
        self.climb_due = False
        landing_enu_m = self._pilot.flavour.landing_enu_m(self._pilot)
        if landing_enu_m is not None:
            self._flight.land_on_runway(landing_enu_m, now_s)

    def return_home(self, now_s: float) -> None:
        """Return home and land, in the mode for it where the mission ends so."""
        if self._behaviour.forgets_mode:
            self._pilot.narrator.tell(FirmwareEvent.RETURN_ORDERED)
            self._pilot.enter(FlightMode.RTL, now_s)
        else:
            self._flight.return_home(now_s)

    def change_speed(self, speed_m_s: float, now_s: float) -> None:
        """Fly at another speed [m/s] until AUTO is left."""
        self._speed_m_s = speed_m_s
        self._flight.override_cruise(speed_m_s, now_s)

    def trigger(self, item: StoredMissionItem) -> None:
        """Set the camera's trigger; where the camera is another component, tell that."""
        self._pilot.camera.trigger(item.params[0])
        self._tell_camera(item, (0.0, 0.0, 0.0))

    def look(self, item: StoredMissionItem, now_s: float) -> None:
        """Keep the camera on a place, or on none; where it is another component, tell that."""
        if not item.is_place:
            self._pilot.camera.look_at(None)
            self._tell_camera(item, (0.0, 0.0, 0.0))
            return
        place_enu_m = self._place(item, now_s)
        self._pilot.camera.look_at(place_enu_m)
        lat_e7, lon_e7, alt_mm = place_wgs84_e7(self._pilot.config.origin, place_enu_m)
        self._tell_camera(item, (lat_e7 / 1e7, lon_e7 / 1e7, alt_mm / 1e3))

    def _tell_camera(self, item: StoredMissionItem, place: tuple[float, float, float]) -> None:
        if not self._behaviour.tells_camera:
            return
        self._pilot.outbox.broadcast(
            mavlink.MAVLink_command_long_message(
                *(self._pilot.config.system_id, 0, item.command, 0),
                *(*item.params[:3], 0.0),
                *place,
            )
        )

    def finish(self, now_s: float) -> None:
        """Stay where the last item ended: in the air, or on the ground with motors stopped."""
        on_ground = self._flight.on_ground
        self._pilot.narrator.tell(
            FirmwareEvent.MISSION_OVER_ON_GROUND if on_ground else FirmwareEvent.MISSION_OVER
        )
        motors_stop = on_ground and self._pilot.flavour.disarm_delay(FlightMode.LAND) is None
        self._pilot.finish_task(now_s, motors_stop=motors_stop)
        if not on_ground and self._behaviour.forgets_mode:
            self._pilot.enter(self._pilot.flavour.modes.for_reposition, now_s)
        elif not on_ground:
            self._flight.hold(now_s)

    def _place(self, item: StoredMissionItem, now_s: float) -> Point:
        return item_place_enu_m(
            item,
            self._pilot.config.origin,
            self._pilot.position_enu_m(now_s),
            self._flight.home_enu_m[2],
        )
