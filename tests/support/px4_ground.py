"""A ground station that speaks to a simulated PX4, and what it asks of it again and again."""

from __future__ import annotations

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sim.autopilot.firmware.px4 import Px4Model
from tests.support.ground_station import ACCEPTED, GroundStation, only
from tests.support.ground_station import ground_station as any_ground_station

TEMPORARILY_REJECTED = 1
TAKEOFF, HOLD, MISSION, RETURN, LAND = (4, 2), (4, 3), (4, 4), (4, 5), (4, 6)
POSITION = (3, 0)
HOME_ALT_M = 488.0


def ground_station(**config: Any) -> GroundStation:
    return any_ground_station(Px4Model(), **{"cruise_m_s": 5.0, **config})


def take_off(ground: GroundStation, alt_m: float = math.nan) -> int:
    nan = math.nan
    return ground.command(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, alt_m)


def airborne(height_m: float = 10.0, **config: Any) -> GroundStation:
    """A vehicle that holds its place above home."""
    ground = ground_station(**config)
    ground.wait(5.0)
    assert ground.arm() == ACCEPTED
    assert take_off(ground, home_alt_m(ground) + height_m) == ACCEPTED
    ground.wait(height_m / ground.vehicle.config.climb_m_s + 1.0)
    assert mode(ground) == HOLD
    return ground


def home_alt_m(ground: GroundStation) -> float:
    return ground.vehicle.config.origin.alt_m


def mode(ground: GroundStation) -> tuple[int, int]:
    """Main and sub mode in the next heartbeat."""
    ground.wait(1.0)
    custom_mode = only(ground.heard, "HEARTBEAT")[-1].custom_mode
    return custom_mode >> 16 & 0xFF, custom_mode >> 24


def reposition(ground: GroundStation, north_m: float, speed_m_s: float = -1.0, **to: Any) -> int:
    lat_e7, lon_e7 = ground.place_e7(0.0, north_m)
    return ground.command_int(
        mavlink.MAV_CMD_DO_REPOSITION,
        to.get("frame", mavlink.MAV_FRAME_GLOBAL_INT),
        lat_e7,
        lon_e7,
        to.get("alt_m", home_alt_m(ground) + 10.0),
        speed_m_s,
        to.get("flags", 1.0),
    )


def reached(ground: GroundStation) -> list[int]:
    return [message.seq for message in only(ground.heard, "MISSION_ITEM_REACHED")]


def mission_texts(ground: GroundStation) -> list[str]:
    return [text.rstrip("\t") for text in ground.texts() if "ission" in text]


def checked(ground: GroundStation, *items: Any) -> None:
    """Upload a mission and wait until it can be begun."""
    assert ground.upload(*items) == 0
    ground.wait(2.0)
