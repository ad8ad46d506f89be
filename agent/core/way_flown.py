"""Where one UAV's vehicle is on the way that is its own, or where it hovers.

It tells of the layer that it flies in; the rest of the core knows that of the brief alone.
Leaves out: asking for a way, and when it is flown (agent.core.airway).
"""

from __future__ import annotations

from dataclasses import replace

from agent.core.fleet_air import STOP_LEG, FleetAir
from agent.core.mission_view import MissionView
from agent.core.place_on_way import PlaceOnWay
from agent.core.stop_on_way import StopOnWay
from swarm.protocol.fields import Point
from swarm.protocol.timing import Timing
from swarm.protocol.uav_messages import ClaimedWay
from swarm.separation.shifted import hovering, nominal

NO_LEG = -1
"""What is flown by a vehicle that does not fly as it was told."""


class WayFlown:
    """The way of one UAV as its vehicle flies it.

    Args:
        timing: how long it waits for a word of the vehicle, and for a stop to be tried again.
        mission_view: what is known of the UAV.
        fleet: the air that it shares.
    """

    def __init__(self, timing: Timing, mission_view: MissionView, fleet: FleetAir) -> None:
        self._mission_view = mission_view
        self._fleet = fleet
        self._way: ClaimedWay | None = None
        self._recalled: ClaimedWay | None = None
        """The way of an earlier life, which may have asked for it or be anywhere on it."""
        self._aloft = self._moves = False
        """Whether the vehicle is in the air, and may be anywhere on its way."""
        self._halt = StopOnWay(timing.patience_s)
        self._own_height = False
        """Whether its way ends at the height of a task."""
        self._at_own_height = False
        """Whether it hovers where such a way has ended."""
        self._flown_leg = STOP_LEG
        self._lifts_enu_m: Point | None = None
        """Where it will be in the air that stands on the ground, in its own layer [m]."""
        self._vehicle = PlaceOnWay(timing.patience_s)

    @property
    def stop_enu_m(self) -> Point | None:
        """Where the vehicle can be stopped, in the layer of the brief [m]; None: as it tells."""
        here = self._vehicle.enu_m if self._fleet.shared is not None and self._aloft else None
        return None if here is None else self._nominal(here)

    def _recall_way(self, way: ClaimedWay) -> None:
        """An earlier life said so last."""
        self._way = self._recalled = way
        self._aloft = bool(way.path_enu_m) and not way.grounded
        self._moves = bool(way.path_enu_m)

    def _ask_no_more(self) -> None:
        """Ask for no way, unless the vehicle may be on that."""
        if self._way is not None and not self._way.flies and self._way is not self._recalled:
            self._way = hovering(self._told_way)

    def _end_leg(self) -> None:
        """The vehicle hovers at the end of its way, or where it was to stop on it."""
        way, self._moves = self._told_way, False
        if (place := self._halt.end()) is not None:
            shift_m = place[2] - self._nominal(place)[2]
            self._way = replace(way, path_enu_m=(place,), shift_m=shift_m)
        elif way.flies and way.path_enu_m:  # what is only asked for begins where it hovers
            shift_m = 0.0 if self._own_height else way.shift_m
            self._way = replace(way, path_enu_m=way.path_enu_m[-1:], shift_m=shift_m)
        self._at_own_height, self._own_height = self._own_height, False

    def _here(self) -> Point | None:
        """Where the vehicle is, or will be in the air, in its own layer; None if not known."""
        if not self._aloft:
            place = self._mission_view.place_enu_m
            if self._lifts_enu_m is None and place is not None:
                # What the vehicle tells from now on, still on the ground, is not in its layer.
                self._lifts_enu_m = self._mission_view.in_layer(place)
            return self._lifts_enu_m
        path = self._told_way.path_enu_m
        if not self._moves and path:
            return self._nominal(path[-1] if self._told_way.flies else path[0])
        return None if self._vehicle.enu_m is None else self._nominal(self._vehicle.enu_m)

    @property
    def _told_way(self) -> ClaimedWay:
        if self._way is not None:
            return self._way
        # Where it hovers first is its own before it takes off: nobody asks for that.
        first = self._fleet.hovers_first_enu_m
        return ClaimedWay(0, first, flies=bool(first), grounded=not self._aloft)

    def _nominal(self, place: Point) -> Point:
        return nominal(place, self._told_way, own_height=self._own_height)
