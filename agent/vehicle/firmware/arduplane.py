"""ArduPilot's planes that need a runway, as ArduPlane 4.8 behaves.

In GUIDED one flies to targets and waits on a circle round them, as wide as WP_LOITER_RAD, as a
QuadPlane does. Neither its take-off nor its landing has a mode of its own: both are items of a
mission, flown in AUTO. That mission stands on it before its motors start: take off the way it
stands, circle for a minute, and then the landing. So RTL, which leads to the landing where
RTL_AUTOLAND says so, brings it down, whoever orders it; and it comes down by itself if nobody takes
it over from its circle.

AUTO alone does not say who has ordered it, so the mode is told together with the part of the
mission that is flown: of AUTO with any other mission, or before it is known which item is flown,
it is somebody else's.

Leaves out: launches by hand or catapult, TAKEOFF and AUTOLAND as modes of their own, deep stalls,
and legs as missions.

Sources: mode_auto.cpp, mode_rtl.cpp, commands_logic.cpp and events.cpp of ArduPilot 4.8, and its
AP_Mission.cpp for what it keeps of an item's parameters;
https://ardupilot.org/plane/docs/automatic-landing.html.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from agent.core.interface import Runway
from agent.vehicle.firmware.failsafes import ARDUPLANE_NAMES, Failsafes, arduplane_failsafes
from agent.vehicle.firmware.profile import Mode
from agent.vehicle.firmware.quadplane import WingedArduPilot
from agent.vehicle.landing_pattern import LandingStyle, RunwayLanding
from agent.vehicle.messages import AltitudeFrame, CommandLong, MissionCurrent, MissionItem
from swarm.model.frames import Origin, wgs84_from_enu
from swarm.model.vehicles import VehicleKind

_AUTO_NUMBER: Final = 10
_PART_SHIFT: Final = 24
"""Modes have small numbers: the part of the mission that is flown is told above them."""
_NUMBERS: Final = (1 << _PART_SHIFT) - 1
_OTHERS, _RUNS_UP, _WAITS, _LANDS, _NOT_TOLD = range(5)
"""Parts of the mission, or that it is somebody else's, or not known yet."""
_AUTO, _TAKING_OFF, _WAITING = ((_AUTO_NUMBER, part) for part in (_OTHERS, _RUNS_UP, _WAITS))
_LANDING, _UNDECIDED = (_AUTO_NUMBER, _LANDS), (_AUTO_NUMBER, _NOT_TOLD)
_RTL, _GUIDED, _AUTOLAND = (11, 0), (15, 0), (26, 0)

_CMD_NAV_WAYPOINT, _CMD_NAV_LOITER_TIME, _CMD_NAV_TAKEOFF = 16, 19, 22
_TAKE_OFF_SEQ, _WAIT_SEQ, _LANDING_SEQ, _COUNT = 1, 2, 3, 7
"""Numbers of the items; item 0 is home."""
_PITCH_DEG = 15.0
"""With which it climbs away: it would take 4° where an item says none."""
_WAIT_S = 60.0
"""After take-off, if nobody takes it over."""
_CLOCKWISE = 1.0
_SLOPE_RAD = math.radians(5.0)
"""No parameter limits its slope; that is what PX4 is set to, and what people fly."""
_AS_KEPT = LandingStyle(circle_heading=0.0, ground_param=1.0, waypoints=1)
"""It always leaves a circle along the line to the next item, and says so by no parameter; of a
landing it tells a direction that only deep stalls have."""
_RETURNS_TO_LANDING = (1.0, 2.0)
"""Values of RTL_AUTOLAND with which RTL leads to the landing that stands on it."""


class ArduPlane(WingedArduPilot):
    """The firmware of ArduPilot's planes without rotors."""

    name = "ArduPlane"
    kind = VehicleKind.PLANE
    vehicle_types = frozenset({1})
    """Fixed wing; QuadPlanes tell it, too, unless Q_MAV_TYPE says otherwise."""
    landing_names = ("Q_ENABLE", "RTL_AUTOLAND", "WP_LOITER_RAD")
    first_item = _TAKE_OFF_SEQ
    motors_begin_takeoff = True
    """As people start it; in GUIDED its throttle opens on the ground once it moves, or its height
    drifts."""
    mode_names = MappingProxyType(
        {
            **{(*mode, 0): name for mode, name in WingedArduPilot.mode_names.items()},
            _TAKING_OFF: "AUTO (taking off)",
            _WAITING: "AUTO (after its take-off)",
            _LANDING: "AUTO (landing)",
            _UNDECIDED: "AUTO",
        }
    )
    commanded_mode = _GUIDED
    mission_mode = _AUTO
    takeoff_mode = _TAKING_OFF
    return_mode = _RTL
    land_mode = _RTL
    """Where it is it cannot land."""
    returning_modes = frozenset({_RTL, _LANDING, _AUTOLAND})
    failsafe_names = ARDUPLANE_NAMES

    def mode(self, custom_mode: int) -> Mode:
        """The mode, and the part of the mission that it flies."""
        return custom_mode & _NUMBERS, custom_mode >> _PART_SHIFT

    def is_taking_off(self, custom_mode: int) -> bool:
        """Also while it waits afterwards, and until it is told which item it flies."""
        return self.mode(custom_mode) in (_TAKING_OFF, _WAITING, _UNDECIDED)

    def has_taken_off(self, custom_mode: int) -> bool:
        """It flies the item after its take-off."""
        return self.mode(custom_mode) == _WAITING

    def must_rise(self, custom_mode: int) -> bool:
        """On its runway, and low above it, it must not be turned."""
        return self.mode(custom_mode) == _TAKING_OFF

    def flies_items(self, custom_mode: int) -> bool:
        """In AUTO."""
        return custom_mode & _NUMBERS == _AUTO_NUMBER

    def told_mode(self, custom_mode: int, item: MissionCurrent | None) -> int:
        """By the item, if its mission has as many as ours."""
        number = custom_mode & _NUMBERS
        if not self.flies_items(number):
            return number
        return number | _part(item) << _PART_SHIFT

    def failsafes(self, values: Mapping[str, float], own_system_id: int) -> Failsafes:
        """It listens to the heartbeats of certain system ids only."""
        return arduplane_failsafes(values, own_system_id)

    def takeoff(self, alt_m: float, home_alt_m: float) -> CommandLong:
        """Its mission begins with it."""
        del alt_m, home_alt_m
        return self.set_mission_mode()

    def runway_landing(self, values: Mapping[str, float]) -> RunwayLanding | str:
        """Where RTL leads to it."""
        if values.get("Q_ENABLE"):
            return "it has rotors (Q_ENABLE): set Q_MAV_TYPE 22, and call it a quadplane"
        leads, radius_m = values.get("RTL_AUTOLAND"), abs(values.get("WP_LOITER_RAD", 0.0))
        if leads not in _RETURNS_TO_LANDING:
            told = "is not known" if leads is None else f"is {leads:g}"
            return f"RTL_AUTOLAND {told}, so it may circle over home for good: set RTL_AUTOLAND 2"
        if not radius_m > 0.0:
            return "WP_LOITER_RAD is not known, or 0"
        return RunwayLanding(radius_m, _SLOPE_RAD)

    def runway_mission(
        self, landing: RunwayLanding, runway: Runway, up_m: float, origin: Origin
    ) -> tuple[MissionItem, ...]:
        """Home, the take-off, a circle where that ends, and the landing."""
        sea = AltitudeFrame.MEAN_SEA_LEVEL
        ground = (sea, *wgs84_from_enu(origin, runway.position_enu_m))
        here = (sea, 0.0, 0.0, wgs84_from_enu(origin, (*runway.position_enu_m[:2], up_m))[2])
        return (
            MissionItem(0, _CMD_NAV_WAYPOINT, *ground),
            MissionItem(
                _TAKE_OFF_SEQ, _CMD_NAV_TAKEOFF, *here, (_PITCH_DEG, 0.0, 0.0, 0.0), current=True
            ),
            MissionItem(_WAIT_SEQ, _CMD_NAV_LOITER_TIME, *here, (_WAIT_S, 0.0, _CLOCKWISE, 0.0)),
            *landing.items(runway, origin, _LANDING_SEQ, _AS_KEPT),
        )


def _part(item: MissionCurrent | None) -> int:
    """Of the mission that ends in the landing; see `_OTHERS`."""
    if item is None:
        return _NOT_TOLD
    if item.total is not None and item.total != _COUNT - 1:  # home is not counted
        return _OTHERS
    if item.seq <= _TAKE_OFF_SEQ:
        return _RUNS_UP
    return _WAITS if item.seq == _WAIT_SEQ else _LANDS
