"""Builds the few messages that are sent on events as well as on request.

Leaves out: periodic telemetry (sim.autopilot.telemetry).
"""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.geo import place_wgs84_e7
from sim.kinematics import Point
from swarm.model.frames import Origin

__all__ = ["home_position", "origin_position"]

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
