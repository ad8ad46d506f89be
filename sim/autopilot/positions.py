"""Places as MAVLink says them <-> the local frame, and the messages that tell home and origin.

MAVLink counts latitude and longitude in 1e-7 degrees and heights above mean sea level or above
home. Heights above terrain are not understood.
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.world.motion import Point
from swarm.model.frames import Origin, enu_from_wgs84, wgs84_from_enu

ABOVE_HOME_FRAMES = frozenset(
    {mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT}
)

ABOVE_SEA_FRAMES = frozenset({mavlink.MAV_FRAME_GLOBAL, mavlink.MAV_FRAME_GLOBAL_INT})


_MAX_HEIGHT_M = 83_000.0
"""Heights beyond this are refused [m], as ArduPilot does."""

_INT32_MAX = 2**31 - 1


def place_enu_m(
    origin: Origin, frame: int, lat_e7: int, lon_e7: int, height_m: float, home_up_m: float
) -> Point | None:
    """The local point [m] of a place on the wire; None if the wire's frame or place is wrong."""
    if not (abs(lat_e7) <= 890_000_000 and abs(lon_e7) <= 1_800_000_000):
        return None
    if not math.isfinite(height_m) or abs(height_m) > _MAX_HEIGHT_M:
        return None
    if frame in ABOVE_HOME_FRAMES:
        alt_m = origin.alt_m + home_up_m + height_m
    elif frame in ABOVE_SEA_FRAMES:
        alt_m = height_m
    else:
        return None
    return enu_from_wgs84(origin, lat_e7 / 1e7, lon_e7 / 1e7, alt_m)


def place_wgs84_e7(origin: Origin, point_enu_m: Point) -> tuple[int, int, int]:
    """Latitude and longitude [1e-7 deg] and height above sea level [mm] of a local point."""
    lat_deg, lon_deg, alt_m = wgs84_from_enu(origin, point_enu_m)
    lon_deg = (lon_deg + 180.0) % 360.0 - 180.0
    lat_e7 = max(-900_000_000, min(900_000_000, round(lat_deg * 1e7)))
    alt_mm = max(-_INT32_MAX, min(_INT32_MAX, round(alt_m * 1e3)))
    return lat_e7, round(lon_deg * 1e7), alt_mm


_NO_ATTITUDE = [math.nan] * 4


def home_position(origin: Origin, home_enu_m: Point, boot_us: int) -> mavlink.MAVLink_message:
    """HOME_POSITION; its local part is north, east, down from the origin [m]."""
    east_m, north_m, up_m = home_enu_m
    return mavlink.MAVLink_home_position_message(
        *place_wgs84_e7(origin, home_enu_m),
        north_m,
        east_m,
        -up_m,
        _NO_ATTITUDE,
        0.0,
        0.0,
        0.0,
        max(0, boot_us),
    )


def origin_position(origin: Origin, boot_us: int) -> mavlink.MAVLink_message:
    """GPS_GLOBAL_ORIGIN: the zero of the local frame."""
    return mavlink.MAVLink_gps_global_origin_message(
        *place_wgs84_e7(origin, (0.0, 0.0, 0.0)), max(0, boot_us)
    )
