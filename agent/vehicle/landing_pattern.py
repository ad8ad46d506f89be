"""The way down to a runway, as mission items: a circle to lose height on, and a straight line.

The circle stands before the runway such that its tangent is the landing's line, so a plane leaves
it for the line wherever it came from. The line begins low, since its slope must not be steeper
than the plane can fly it, and ends where the plane is to touch down.

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
_HEADING_REQUIRED, _LEAVES_ON_TANGENT = 1.0, 1.0


@dataclass(frozen=True, slots=True)
class RunwayLanding:
    """How a plane comes down."""

    circle_m: float
    """Radius of the circle on which it loses height; > 0."""
    slope_rad: float
    """The steepest that it descends on the line; > 0."""

    @property
    def line_m(self) -> float:
        """From leaving the circle until it touches down, over ground."""
        return _APPROACH_M / math.tan(_SLOPE_FRAC * self.slope_rad)

    def circle_enu_m(self, runway: Runway) -> Point:
        """Centre of that circle, which is flown clockwise [m; mission origin]."""
        east_m, north_m, up_m = runway.position_enu_m
        ahead_east, ahead_north = math.sin(runway.heading_rad), math.cos(runway.heading_rad)
        # Clockwise its centre is to the right of the line.
        return (
            east_m - self.line_m * ahead_east + self.circle_m * ahead_north,
            north_m - self.line_m * ahead_north - self.circle_m * ahead_east,
            up_m + _APPROACH_M,
        )

    def items(self, runway: Runway, origin: Origin) -> tuple[MissionItem, ...]:
        """The way down, to be put on the plane."""
        sea, nowhere = AltitudeFrame.MEAN_SEA_LEVEL, (AltitudeFrame.NONE, 0.0, 0.0, 0.0)
        circle = wgs84_from_enu(origin, self.circle_enu_m(runway))
        ground = wgs84_from_enu(origin, runway.position_enu_m)
        down = (_HEADING_REQUIRED, self.circle_m, 0.0, _LEAVES_ON_TANGENT)
        return (
            MissionItem(0, _CMD_DO_LAND_START, *nowhere, current=True),
            MissionItem(1, _CMD_NAV_LOITER_TO_ALT, sea, *circle, down),
            MissionItem(2, _CMD_NAV_LAND, sea, *ground, (0.0, 0.0, 0.0, math.nan)),
        )
