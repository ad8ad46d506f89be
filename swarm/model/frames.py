"""WGS84 <-> the mission's local east-north-up frame.

The local frame is equirectangular: differences of latitude and longitude, times the two radii of
curvature of the ellipsoid at the origin. It is exact there. North or south of it meridians are
drawn as far apart as at the origin, so that east-west distances are off by tan(latitude) for each
Earth radius: 20 km away by 0.3 % at a latitude of 47 degrees and by 0.9 % at 70. North-south ones
are off by less than 0.01 %. All who take part use the same frame, so they mean the same places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_SEMI_MAJOR_M = 6_378_137.0
_ECCENTRICITY_SQUARED = 6.694_379_990_14e-3


@dataclass(frozen=True, slots=True)
class Origin:
    """WGS84 place of the local frame's zero.

    Raises:
        ValueError: latitude outside -89..89 or longitude outside -180..180 degrees.
    """

    lat_deg: float
    lon_deg: float
    alt_m: float
    """Height above mean sea level [m]."""

    def __post_init__(self) -> None:
        if not -89.0 <= self.lat_deg <= 89.0:
            raise ValueError(f"lat_deg must be within -89..89, not {self.lat_deg}")
        if not -180.0 <= self.lon_deg <= 180.0:
            raise ValueError(f"lon_deg must be within -180..180, not {self.lon_deg}")
        if not math.isfinite(self.alt_m):
            raise ValueError(f"alt_m must be finite, not {self.alt_m}")


DEFAULT_ORIGIN = Origin(lat_deg=47.397742, lon_deg=8.545594, alt_m=488.0)
"""Where scenarios without an origin of their own are flown."""


def wgs84_from_enu(
    origin: Origin, point_enu_m: tuple[float, float, float]
) -> tuple[float, float, float]:
    """Latitude [deg], longitude [deg] and height above mean sea level [m] of a local point."""
    east_m, north_m, up_m = point_enu_m
    meridian_m_rad, parallel_m_rad = _scales_m_rad(origin)
    return (
        origin.lat_deg + math.degrees(north_m / meridian_m_rad),
        origin.lon_deg + math.degrees(east_m / parallel_m_rad),
        origin.alt_m + up_m,
    )


def enu_from_wgs84(
    origin: Origin, lat_deg: float, lon_deg: float, alt_m: float
) -> tuple[float, float, float]:
    """Local point [m; east, north, up] of a WGS84 place; inverse of `wgs84_from_enu`."""
    meridian_m_rad, parallel_m_rad = _scales_m_rad(origin)
    lon_difference_deg = (lon_deg - origin.lon_deg + 180.0) % 360.0 - 180.0
    return (
        math.radians(lon_difference_deg) * parallel_m_rad,
        math.radians(lat_deg - origin.lat_deg) * meridian_m_rad,
        alt_m - origin.alt_m,
    )


def _scales_m_rad(origin: Origin) -> tuple[float, float]:
    """Metres per radian of latitude and of longitude at the origin (WGS84 ellipsoid)."""
    lat_rad = math.radians(origin.lat_deg)
    squared = 1.0 - _ECCENTRICITY_SQUARED * math.sin(lat_rad) ** 2
    prime_vertical_m = _SEMI_MAJOR_M / math.sqrt(squared)
    meridian_m = _SEMI_MAJOR_M * (1.0 - _ECCENTRICITY_SQUARED) / squared**1.5
    return meridian_m, prime_vertical_m * math.cos(lat_rad)
