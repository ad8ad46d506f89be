"""A target as a mission that is complete in itself: speed, place, patience, home.

Where the firmware flies to single targets better than to waypoints, the mission gives way to
targets for a time before its place: who commands the vehicle tells it that very place, and if
nobody does any more, the mission goes on by itself. The time is limited by an item before,
since firmware carries out only such commands as stand before the item that they are for.

Every such mission has the same items in the same order, and only the place, the hold time,
the time for targets and the speed differ. So a vehicle that takes items one by one, as
ArduPilot does, holds a complete mission after each of them: to the old place or to the new
one, and then home. A vehicle whose upload is cut off flies one or the other, never half of both.

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
_CMD_NAV_GUIDED_ENABLE = 92
_CMD_DO_CHANGE_SPEED = 178
_CMD_DO_GUIDED_LIMITS = 222
_ON = 1.0
_GROUND_SPEED = 1.0
_UNCHANGED = -1.0
LONGEST_HOLD_S = 65_000
"""ArduPilot keeps hold times in 16 bits."""


@dataclass(frozen=True, slots=True)
class MissionSeqs:
    """Numbers of the items; the vehicle's own come first."""

    vehicle_items: int
    gives_way: bool = False
    """Whether it gives way to targets before its own place."""

    @property
    def speed(self) -> int:
        """Where the mission is begun."""
        return self.vehicle_items

    @property
    def target(self) -> int:
        """The place to fly to and to wait at."""
        return self.vehicle_items + (3 if self.gives_way else 1)

    @property
    def guided(self) -> int | None:
        """Where it gives way to targets; None where it does not."""
        return self.target - 1 if self.gives_way else None

    @property
    def home(self) -> int:
        """The way home."""
        return self.target + 1

    @property
    def count(self) -> int:
        """Of all items."""
        return self.home + 1


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
    guided_s: int = 0
    """Time before for which it gives way to targets [s]; 0: it does not."""

    def seqs(self, flavour: Flavour) -> MissionSeqs:
        """Numbers of its items."""
        return MissionSeqs(flavour.mission_vehicle_items, self.guided_s > 0)

    def items(self, flavour: Flavour) -> tuple[MissionItem, ...]:
        """The mission in that firmware's terms."""
        seqs = self.seqs(flavour)
        place = (AltitudeFrame.MEAN_SEA_LEVEL, self.lat_deg, self.lon_deg, self.alt_m)
        nowhere = (AltitudeFrame.NONE, 0.0, 0.0, 0.0)
        speed = (_GROUND_SPEED, self.speed_m_s, _UNCHANGED, 0.0)
        hold = flavour.waypoint_params(float(self.hold_s))
        vehicles = (MissionItem(i, _CMD_NAV_WAYPOINT, *place) for i in range(seqs.vehicle_items))
        way: tuple[MissionItem, ...] = ()
        if seqs.guided is not None:
            limits, on = (float(self.guided_s), 0.0, 0.0, 0.0), (_ON, 0.0, 0.0, 0.0)
            way = (
                MissionItem(seqs.guided - 1, _CMD_DO_GUIDED_LIMITS, *nowhere, limits),
                MissionItem(seqs.guided, _CMD_NAV_GUIDED_ENABLE, *nowhere, on),
            )
        return (
            *vehicles,
            MissionItem(seqs.speed, _CMD_DO_CHANGE_SPEED, *nowhere, speed, current=True),
            *way,
            MissionItem(seqs.target, _CMD_NAV_WAYPOINT, *place, hold),
            MissionItem(seqs.home, _CMD_NAV_RETURN_TO_LAUNCH, *nowhere),
        )


def recognise(items: Sequence[MissionItem], flavour: Flavour) -> MissionPlan | None:
    """The plan that makes such a mission; None if it is not one of ours."""
    shapes = [MissionSeqs(flavour.mission_vehicle_items, gives_way) for gives_way in (False, True)]
    if len(items) not in [seqs.count for seqs in shapes]:
        return None
    speed, *way, target, home = items[flavour.mission_vehicle_items :]
    guided_s = _limit_s(way)
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
    if not ours or guided_s is None:
        return None
    place = (target.lat_deg, target.lon_deg, target.alt_m)
    return MissionPlan(*place, speed_m_s, round(hold_s), guided_s)


def _limit_s(way: Sequence[MissionItem]) -> int | None:
    """For how long these items give way to targets; None if they are not ours."""
    if not way:
        return 0
    limits, guided = way
    commands = (limits.command, guided.command)
    if commands != (_CMD_DO_GUIDED_LIMITS, _CMD_NAV_GUIDED_ENABLE) or guided.params[0] != _ON:
        return None
    return round(limits.params[0]) if limits.params[0] >= 1.0 else None
