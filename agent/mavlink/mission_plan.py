"""A target as a mission that is complete in itself: speed, place, patience, home.

Every such mission has the same items in the same order, and only the place, the hold time
and the speed differ. So a vehicle that takes items one by one, as ArduPilot does, holds a
complete mission after each of them: to the old place or to the new one, and then home. A
vehicle whose upload is cut off flies one or the other, never half of both.

The place is one waypoint with a hold time, not a waypoint and a hold behind it, since a leg
of no length between two is nothing that was seen flown. The price: MISSION_ITEM_REACHED
comes only when the hold is over. Heights are above mean sea level, which both firmwares
take and which do not change with home's. Leaves out: bringing a mission onto a vehicle
(agent.mavlink.mission) and flying it (agent.mavlink.standing_mission).

Commands: https://mavlink.io/en/messages/common.html
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from agent.mavlink.flavours import Flavour
from agent.mavlink.messages import AltitudeFrame, MissionItem

__all__ = ["LONGEST_HOLD_S", "MissionPlan", "MissionSeqs", "recognise"]

_CMD_NAV_WAYPOINT = 16
_CMD_NAV_RETURN_TO_LAUNCH = 20
_CMD_DO_CHANGE_SPEED = 178
_GROUND_SPEED = 1.0
_UNCHANGED = -1.0
_ITEMS = 3
LONGEST_HOLD_S = 65_000
"""ArduPilot keeps hold times in 16 bits."""


@dataclass(frozen=True, slots=True)
class MissionSeqs:
    """Numbers of the items; the vehicle's own come first."""

    vehicle_items: int

    @property
    def speed(self) -> int:
        """Where the mission is begun."""
        return self.vehicle_items

    @property
    def target(self) -> int:
        """The place to fly to and to wait at."""
        return self.vehicle_items + 1

    @property
    def home(self) -> int:
        """The way home."""
        return self.vehicle_items + 2

    @property
    def count(self) -> int:
        """Of all items."""
        return self.vehicle_items + _ITEMS


@dataclass(frozen=True, slots=True)
class MissionPlan:
    """One target, and what to do if nothing follows it."""

    lat_deg: float
    lon_deg: float
    alt_m: float
    """Height above mean sea level."""
    speed_m_s: float
    hold_s: int
    """Wait at the target before going home [s]; firmwares count whole seconds."""

    def items(self, flavour: Flavour) -> tuple[MissionItem, ...]:
        """The mission in that firmware's terms."""
        seqs = MissionSeqs(flavour.mission_vehicle_items)
        place = (AltitudeFrame.MEAN_SEA_LEVEL, self.lat_deg, self.lon_deg, self.alt_m)
        nowhere = (AltitudeFrame.NONE, 0.0, 0.0, 0.0)
        speed = (_GROUND_SPEED, self.speed_m_s, _UNCHANGED, 0.0)
        hold = flavour.waypoint_params(float(self.hold_s))
        vehicles = (MissionItem(i, _CMD_NAV_WAYPOINT, *place) for i in range(seqs.vehicle_items))
        return (
            *vehicles,
            MissionItem(seqs.speed, _CMD_DO_CHANGE_SPEED, *nowhere, speed, current=True),
            MissionItem(seqs.target, _CMD_NAV_WAYPOINT, *place, hold),
            MissionItem(seqs.home, _CMD_NAV_RETURN_TO_LAUNCH, *nowhere),
        )


def recognise(items: Sequence[MissionItem], flavour: Flavour) -> MissionPlan | None:
    """The plan that makes such a mission; None if it is not one of ours."""
    seqs = MissionSeqs(flavour.mission_vehicle_items)
    if len(items) != seqs.count:
        return None
    speed, target, home = items[seqs.speed :]
    commands = (speed.command, target.command, home.command)
    if commands != (_CMD_DO_CHANGE_SPEED, _CMD_NAV_WAYPOINT, _CMD_NAV_RETURN_TO_LAUNCH):
        return None
    hold_s, speed_m_s = target.params[0], speed.params[1]
    ours = (
        target.frame is AltitudeFrame.MEAN_SEA_LEVEL
        and speed.params[2] == _UNCHANGED
        and math.isfinite(hold_s)
        and hold_s >= 1.0
        and speed_m_s > 0.0
    )
    if not ours:
        return None
    return MissionPlan(target.lat_deg, target.lon_deg, target.alt_m, speed_m_s, round(hold_s))
