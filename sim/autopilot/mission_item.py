"""One step of a mission as it stands on a vehicle, and what is accepted as one.

Fences are uploaded by the same protocol and kept as the same kind of item. Sources:
https://mavlink.io/en/services/mission.html and
https://mavlink.io/en/messages/common.html#MAV_CMD.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.positions import ABOVE_HOME_FRAMES, ABOVE_SEA_FRAMES, place_enu_m, place_wgs84_e7
from sim.world.motion import Point
from swarm.model.frames import Origin

_PLACES = frozenset(
    {
        mavlink.MAV_CMD_NAV_WAYPOINT,
        mavlink.MAV_CMD_NAV_LOITER_UNLIM,
        mavlink.MAV_CMD_NAV_LOITER_TIME,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_LOITER_TO_ALT,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
    }
)

_DONE_AT_ONCE = frozenset(
    {
        mavlink.MAV_CMD_DO_LAND_START,
        mavlink.MAV_CMD_DO_CHANGE_SPEED,
        mavlink.MAV_CMD_DO_GUIDED_LIMITS,
        mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST,
        mavlink.MAV_CMD_DO_SET_ROI_LOCATION,
        mavlink.MAV_CMD_DO_SET_ROI_NONE,
    }
)

LOOKS = frozenset({mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI_NONE})
"""Those that keep a camera on a place, or on none."""

_GIVES_WAY = frozenset({mavlink.MAV_CMD_NAV_GUIDED_ENABLE, mavlink.MAV_CMD_DO_GUIDED_LIMITS})

_OF_RUNWAYS = frozenset({mavlink.MAV_CMD_DO_LAND_START, mavlink.MAV_CMD_NAV_LOITER_TO_ALT})

_NAMES = {
    mavlink.MAV_CMD_NAV_WAYPOINT: "WP",
    mavlink.MAV_CMD_NAV_LOITER_UNLIM: "LoitUnlim",
    mavlink.MAV_CMD_NAV_LOITER_TIME: "LoitTime",
    mavlink.MAV_CMD_NAV_LOITER_TO_ALT: "LoitAltitude",
    mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: "RTL",
    mavlink.MAV_CMD_NAV_LAND: "Land",
    mavlink.MAV_CMD_NAV_TAKEOFF: "Takeoff",
    mavlink.MAV_CMD_NAV_GUIDED_ENABLE: "GuidedEnable",
    mavlink.MAV_CMD_DO_CHANGE_SPEED: "ChangeSpeed",
    mavlink.MAV_CMD_DO_LAND_START: "LandStart",
    mavlink.MAV_CMD_DO_GUIDED_LIMITS: "GuidedLimits",
    mavlink.MAV_CMD_DO_SET_CAM_TRIGG_DIST: "SetCamTrigDst",
    mavlink.MAV_CMD_DO_SET_ROI_LOCATION: "SetROILocation",
    mavlink.MAV_CMD_DO_SET_ROI_NONE: "SetROINone",
}


@dataclass(frozen=True, slots=True)
class StoredMissionItem:
    """One step of a mission, in wire units."""

    frame: int
    """MAV_FRAME, the variant without ``_INT``."""
    command: int
    """MAV_CMD."""
    params: tuple[float, float, float, float]
    lat_e7: int
    lon_e7: int
    height_m: float
    autocontinue: int = 1

    @property
    def is_place(self) -> bool:
        """Whether latitude, longitude and height mean something."""
        return self.command in _PLACES

    @property
    def is_navigation(self) -> bool:
        """Whether it takes time to fly, rather than being done at once."""
        return self.command not in _DONE_AT_ONCE

    @property
    def name(self) -> str:
        """What the autopilot calls it when it begins."""
        return _NAMES[self.command]


_FRAMES_KEPT = {
    mavlink.MAV_FRAME_GLOBAL_INT: mavlink.MAV_FRAME_GLOBAL,
    mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT: mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT,
}


INT_FRAMES: dict[int, int] = {kept: sent for sent, kept in _FRAMES_KEPT.items()}


def item_from_message(
    message: mavlink.MAVLink_message, *, gives_way: bool, lands_on_runways: bool = False
) -> StoredMissionItem | int:
    """The item in a MISSION_ITEM or MISSION_ITEM_INT, or the MAV_MISSION_RESULT of refusing it."""
    if message.command not in _NAMES or (message.command in _GIVES_WAY and not gives_way):
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    if message.command in _OF_RUNWAYS and not lands_on_runways:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    # Yaw is given as NaN where it doesn't matter; one NaN, so that equal items are equal.
    yaw_deg = math.nan if math.isnan(message.param4) else message.param4
    params = (message.param1, message.param2, message.param3, yaw_deg)
    if not all(math.isfinite(value) for value in params[:3]) or not math.isfinite(message.z):
        return int(mavlink.MAV_MISSION_INVALID)
    if not (math.isfinite(message.x) and math.isfinite(message.y)):
        return int(mavlink.MAV_MISSION_INVALID)
    item = _stored(message, params)
    if item.is_place:
        if item.frame not in ABOVE_HOME_FRAMES | ABOVE_SEA_FRAMES:
            return int(mavlink.MAV_MISSION_UNSUPPORTED_FRAME)
        return _place_fault(item) or item
    return item


def fence_item_from_message(
    message: mavlink.MAVLink_message, commands: frozenset[int]
) -> StoredMissionItem | int:
    """The corner or circle of a fence in a message, or the MAV_MISSION_RESULT of refusing it."""
    if message.command not in commands:
        return int(mavlink.MAV_MISSION_UNSUPPORTED)
    params = (message.param1, 0.0, 0.0, 0.0)
    if not all(math.isfinite(value) for value in (message.param1, message.x, message.y)):
        return int(mavlink.MAV_MISSION_INVALID)
    item = _stored(message, params, height_m=0.0)
    return _place_fault(item) or item


def _place_fault(item: StoredMissionItem) -> int:
    """The MAV_MISSION_RESULT of refusing an item's place; 0 for one on the globe."""
    if abs(item.lat_e7) > 890_000_000:
        return int(mavlink.MAV_MISSION_INVALID_PARAM5_X)
    if abs(item.lon_e7) > 1_800_000_000:
        return int(mavlink.MAV_MISSION_INVALID_PARAM6_Y)
    return 0


def _stored(
    message: mavlink.MAVLink_message,
    params: tuple[float, float, float, float],
    height_m: float | None = None,
) -> StoredMissionItem:
    scale = 1e7 if message.get_msgId() == mavlink.MAVLINK_MSG_ID_MISSION_ITEM else 1
    return StoredMissionItem(
        frame=_FRAMES_KEPT.get(message.frame, message.frame),
        command=message.command,
        params=params,
        lat_e7=round(message.x * scale),
        lon_e7=round(message.y * scale),
        height_m=message.z if height_m is None else height_m,
        autocontinue=message.autocontinue,
    )


def item_place_enu_m(
    item: StoredMissionItem, origin: Origin, here_enu_m: Point, home_up_m: float
) -> Point:
    """Place of an item [m]; zeros mean where the vehicle is."""
    place = place_enu_m(origin, item.frame, item.lat_e7, item.lon_e7, item.height_m, home_up_m)
    if place is None:
        return here_enu_m
    east_m, north_m, up_m = place
    if item.lat_e7 == 0 and item.lon_e7 == 0:
        east_m, north_m, _ = here_enu_m
    if item.height_m == 0.0:
        up_m = here_enu_m[2]
    return east_m, north_m, up_m


def home_item(origin: Origin, home_enu_m: Point) -> StoredMissionItem:
    """Home as an item of a mission."""
    lat_e7, lon_e7, alt_mm = place_wgs84_e7(origin, home_enu_m)
    return StoredMissionItem(
        frame=mavlink.MAV_FRAME_GLOBAL,
        command=mavlink.MAV_CMD_NAV_WAYPOINT,
        params=(0.0, 0.0, 0.0, 0.0),
        lat_e7=lat_e7,
        lon_e7=lon_e7,
        height_m=alt_mm / 1e3,
    )


def runway_places_enu_m(
    items: Sequence[StoredMissionItem], origin: Origin, home_enu_m: Point
) -> tuple[Point, Point] | None:
    """Where the landing of a mission circles, and where it touches down [m]; None without one."""
    wanted = (mavlink.MAV_CMD_NAV_LOITER_TO_ALT, mavlink.MAV_CMD_NAV_LAND)
    commands = [item.command for item in items]
    if mavlink.MAV_CMD_DO_LAND_START not in commands:
        return None
    start = commands.index(mavlink.MAV_CMD_DO_LAND_START)
    found = [item for item in items[start:] if item.command in wanted]
    if tuple(item.command for item in found) != wanted:
        return None
    circle, ground = (item_place_enu_m(item, origin, home_enu_m, home_enu_m[2]) for item in found)
    return circle, ground
