"""What landing at a base and climbing back cost a vehicle, where to do so, before it is measured.

Missions say how UAVs fly from place to place, and count a visit to a base from touch-down to
ready. What flies really is in the air before and after that. Vehicles of the simulator's ideal
world land and climb in no time, and all at the same spot: they have none of this.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import count, islice

import numpy as np

from swarm.model import Zone
from swarm.protocol.fields import Point


@dataclass(frozen=True, slots=True)
class Verticals:
    """Landings and take-offs as a cautious autopilot does them."""

    descent_m_s: float = 1.5
    """From its layer down to `low_m`: what both firmwares do unless told otherwise [m/s]."""
    low_m: float = 10.5
    """From here down a landing is slow: ArduCopter's LAND_ALT_LOW of 10 m, above which it brakes as
    if it were to stop there, and is at `landing_m_s` as far before as that speed lasts 1 s [m]."""
    landing_m_s: float = 0.5
    """From there to the ground: ArduCopter's LAND_SPEED; PX4 lands faster [m/s]."""
    change_m_s2: float = 1.0
    """With which it speeds up and brakes on its way down: ArduCopter's WP_ACC_Z; PX4 is quicker
    [m/s²]."""
    landed_s: float = 3.0
    """Until the landing mode is in force, and after touch-down until motors stand still [s]."""
    climb_m_s: float = 1.5
    """Back to its layer: PX4's MPC_TKO_SPEED; ArduCopter climbs faster [m/s]."""
    started_s: float = 6.0
    """Until it is seen to be armed, 1 s; for motors to come up, 4 s by PX4's COM_SPOOLUP_TIME and
    MPC_TKO_RAMP_T; until it is seen to hover at its height, 1 s."""
    apart_m: float = 8.0
    """Between the spots on which the UAVs of a fleet land at one base [m]."""

    def land_s(self, height_m: float) -> float:
        """From a height above the ground until it has landed [s]."""
        low_m = min(height_m, self.low_m)
        fastest_m_s = self.descent_m_s if height_m > low_m else self.landing_m_s
        # Beside a flight whose speeds change at once.
        slower_m_s = fastest_m_s - self.landing_m_s
        change_s = (fastest_m_s + slower_m_s**2 / fastest_m_s) / (2.0 * self.change_m_s2)
        descent_s = (height_m - low_m) / self.descent_m_s
        return descent_s + low_m / self.landing_m_s + change_s + self.landed_s

    def climb_s(self, height_m: float) -> float:
        """From the ground to a height above it [s]."""
        return height_m / self.climb_m_s + self.started_s

    def spot(
        self,
        base_enu_m: Point,
        index: int,
        starts_enu_m: Collection[Point],
        zones: Sequence[Zone],
        margin_m: float,
    ) -> Point:
        """Where the UAV with that place in the fleet lands at a base [m].

        Everybody has a spot of its own, so that nobody stands, waits, lands or takes off below
        or above anybody else: the base itself for the first, and others round it, which keep
        away from where UAVs started, and from zones.

        Args:
            base_enu_m: the base, on the ground.
            index: of the UAV.
            starts_enu_m: of the fleet.
            zones: none of whose insides, nor their margin, a spot lies in.
            margin_m: that margin.
        """
        from swarm.allocation.legs import Airspace  # plain missions start sooner without

        keeps_m = margin_m + self.apart_m / 2.0
        planner = Airspace(zones, keeps_m).concerning(-math.inf, math.inf) if zones else None
        for east_m, north_m in islice(_spiral(self.apart_m), _TRIED):
            spot_enu_m = base_enu_m[0] + east_m, base_enu_m[1] + north_m, base_enu_m[2]
            flat_m = np.array([spot_enu_m[:2]])
            apart = all(math.dist(spot_enu_m[:2], s[:2]) >= self.apart_m for s in starts_enu_m)
            if not apart or not (planner is None or planner.free(flat_m)[0]):
                continue
            if index == 0:
                return spot_enu_m
            index -= 1
        return base_enu_m


_TRIED = 2_000
"""Spots that are looked at for a fleet, the nearest ones first."""


def _spiral(apart_m: float) -> Iterator[tuple[float, float]]:
    """Places so far apart, each with six neighbours, ring by ring from the middle out [m]."""
    yield 0.0, 0.0
    for ring in count(1):
        for side in range(6):
            along, turned = (math.radians(60.0 * each) for each in (side, side + 2))
            for step in range(ring):
                east = ring * math.cos(along) + step * math.cos(turned)
                north = ring * math.sin(along) + step * math.sin(turned)
                yield apart_m * east, apart_m * north
