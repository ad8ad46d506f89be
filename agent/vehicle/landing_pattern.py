"""The way down to a runway, as mission items: a circle to lose height on, and a straight line.

The circle stands before the runway such that its tangent is the landing's line, so a plane leaves
it for the line wherever it came from. The line is level at first and then slopes down, less steeply
than the plane may descend, to where it is to touch down.

Two waypoints stand on the line, where its slope begins and farther down: PX4 1.17 takes for the
line of a landing that from the setpoint *before the last one* to the ground, when it comes home
to one. With a circle alone it approached from wherever it had climbed for its return, and touched
down 460 m beside the runway twice. Others need one of the two.

Leaves out: the wind, obstacles and the shape of the ground below the line, which are looked to by
whoever chose the direction.

Commands: https://mavlink.io/en/messages/common.html; what PX4 makes of them:
https://docs.px4.io/main/en/flight_modes_fw/mission.html#mission-landing and its
FeasibilityChecker.cpp.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from agent.core.interface import Runway
from agent.vehicle.messages import AltitudeFrame, MissionItem
from swarm.model.frames import Origin, wgs84_from_enu
from swarm.protocol.fields import Point

_CMD_NAV_LAND = 21
_CMD_NAV_LOITER_TO_ALT = 31
_CMD_DO_LAND_START = 189
_APPROACH_M = 25.0
"""Height above the runway at which it leaves the circle."""
_SLOPE_FRAC = 0.8
"""Of the steepest slope; at the limit itself a plane would be refused for a rounding."""
_LEVEL_M = 100.0
"""From the circle to where the slope begins."""
_FARTHER_DOWN_FRAC = 0.7
"""Of the slope is still ahead at the second waypoint."""
_CMD_NAV_WAYPOINT = 16
_LEAVES_ON_TANGENT = 1.0


@dataclass(frozen=True, slots=True)
class LandingStyle:
    """What firmwares differ in that fly such items."""

    circle_heading: float = 1.0
    """First parameter of the circle: 1, it is left where its tangent leads on."""
    ground_param: float = math.nan
    """Fourth parameter of the place to touch down at, which no plane on a runway minds."""
    waypoints: int = 2
    """On the line."""


@dataclass(frozen=True, slots=True)
class RunwayLanding:
    """How a plane comes down."""

    circle_m: float
    """Radius of the circle on which it loses height; > 0."""
    slope_rad: float
    """The steepest that it descends on the line; > 0."""

    @property
    def line_m(self) -> float:
        """From where the slope begins until it touches down, over ground."""
        return _APPROACH_M / math.tan(_SLOPE_FRAC * self.slope_rad)

    def circle_enu_m(self, runway: Runway) -> Point:
        """Centre of that circle, which is flown clockwise [m; mission origin]."""
        east_m, north_m, up_m = _before(runway, self.line_m + _LEVEL_M, _APPROACH_M)
        ahead_east, ahead_north = math.sin(runway.heading_rad), math.cos(runway.heading_rad)
        # Clockwise its centre is to the right of the line.
        return east_m + self.circle_m * ahead_north, north_m - self.circle_m * ahead_east, up_m

    def items(
        self, runway: Runway, origin: Origin, first: int = 0, style: LandingStyle | None = None
    ) -> tuple[MissionItem, ...]:
        """The way down, to be put on the plane; its items are numbered from ``first`` on."""
        style = style or LandingStyle()
        sea, nowhere = AltitudeFrame.MEAN_SEA_LEVEL, (AltitudeFrame.NONE, 0.0, 0.0, 0.0)
        circle = wgs84_from_enu(origin, self.circle_enu_m(runway))
        ground = wgs84_from_enu(origin, runway.position_enu_m)
        down = (style.circle_heading, self.circle_m, 0.0, _LEAVES_ON_TANGENT)
        slope = [
            wgs84_from_enu(origin, _before(runway, frac * self.line_m, frac * _APPROACH_M))
            for frac in (1.0, _FARTHER_DOWN_FRAC)[: style.waypoints]
        ]
        as_it_comes = (0.0, 0.0, 0.0, math.nan)
        last = (0.0, 0.0, 0.0, style.ground_param)
        return (
            MissionItem(first, _CMD_DO_LAND_START, *nowhere, current=first == 0),
            MissionItem(first + 1, _CMD_NAV_LOITER_TO_ALT, sea, *circle, down),
            *(
                MissionItem(seq, _CMD_NAV_WAYPOINT, sea, *place, as_it_comes)
                for seq, place in enumerate(slope, start=first + 2)
            ),
            MissionItem(first + 2 + len(slope), _CMD_NAV_LAND, sea, *ground, last),
        )


def _before(runway: Runway, way_m: float, height_m: float) -> Point:
    """On the landing's line, so far before the runway and so high above it."""
    east_m, north_m, up_m = runway.position_enu_m
    return (
        east_m - way_m * math.sin(runway.heading_rad),
        north_m - way_m * math.cos(runway.heading_rad),
        up_m + height_m,
    )
