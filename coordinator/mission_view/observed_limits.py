"""How near the limits of a mission UAVs came, by what their statuses tell: zones, and batteries.

Between two places told a curve is taken that leaves the one and comes to the other as the UAV was
flying there: straight lines cut bends short, by metres where statuses are few. Leaves out: what
follows, and distances of UAVs from each other (coordinator.mission_view.observed_flights).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from swarm.model import Zone
from swarm.model.terrain import Terrain
from swarm.protocol.field_messages import ZoneSpec
from swarm.protocol.fields import FlatPoint, Point
from swarm.protocol.uav_messages import Status, StatusPhase

if TYPE_CHECKING:
    import shapely

_UNKNOWN_S = 5.0
"""Who was not heard for longer may have flown anywhere meanwhile [s mission time]."""

_SLOW_M_S = 1.0
"""Who is no faster flies in no direction that is worth knowing [m/s]."""
_LANDING_M = 40.0
"""Who is no farther from where it takes off and lands may do either."""
_PIECES = 8
"""In which a curve is looked at."""

_GROUNDED = (StatusPhase.LEARNING, StatusPhase.PREPARING, StatusPhase.OUT)


class ObservedLimits:
    """Of one fleet."""

    def __init__(self) -> None:
        self.nearest_zone_m: float | None = None
        """Least distance seen of a UAV from a zone that concerns its height [m], 0 inside; None
        until one was seen in a mission with zones."""
        self.lowest_clearance_m: float | None = None
        """Least height seen of a UAV above the ground away from where it takes off and lands [m];
        None until one was seen in a mission with a terrain."""
        self.lowest_charge_frac: dict[str, float] = {}
        """By UAV, the least charge that it told while it took part."""
        self._last: dict[str, tuple[float, Point, Point | None]] = {}
        """By UAV, when and where it was last, and how fast [s mission time, m, m/s]."""
        self._shapes: dict[ZoneSpec, tuple[Zone, shapely.Polygon]] = {}

    def hear(
        self,
        uav: str,
        status: Status,
        layer_m: float,
        zones: Sequence[ZoneSpec],
        terrain: Terrain | None = None,
        grounds: Sequence[Point] = (),
    ) -> None:
        """A UAV tells how it is.

        Args:
            uav: who.
            status: what it tells.
            layer_m: its layer in the brief [m].
            zones: those in force.
            terrain: the ground; None: nobody looks at it.
            grounds: where it takes off and lands.
        """
        if status.mission_s is None or status.phase in _GROUNDED:
            return
        if status.battery_frac is not None:
            lowest = self.lowest_charge_frac.get(uav, math.inf)
            self.lowest_charge_frac[uav] = min(lowest, status.battery_frac)
        place = status.flown_enu_m(layer_m)
        if place is None or not (zones or terrain):
            return
        now = status.mission_s, place, status.velocity_enu_m_s
        before = self._last.get(uav, now)
        if before[0] > now[0]:
            return
        self._last[uav] = now
        if now[0] - before[0] > _UNKNOWN_S:
            before = now
        flown_m = _curve(*before[1:], *now[1:])
        if terrain is not None:
            self._look_down(flown_m, (before[1][2], place[2]), terrain, grounds)
        if zones:
            self._look(flown_m, sorted((before[1][2], place[2])), zones)

    def _look_down(
        self,
        places_m: Sequence[FlatPoint],
        ends_up_m: tuple[float, float],
        terrain: Terrain,
        grounds: Sequence[Point],
    ) -> None:
        """How near to the ground a way comes that gains its height evenly."""
        import numpy as np

        from swarm.allocation.legs.ground import ground_of

        flat_m = np.array(places_m)
        up_m = np.linspace(*ends_up_m, len(flat_m)) - ground_of(terrain).up_m(flat_m)
        away = [
            all(math.dist(place, ground[:2]) > _LANDING_M for ground in grounds)
            for place in places_m
        ]
        if any(away):
            least_m = float(up_m[away].min())
            lowest_m = self.lowest_clearance_m
            self.lowest_clearance_m = least_m if lowest_m is None else min(lowest_m, least_m)

    def _look(
        self,
        places_m: Sequence[FlatPoint],
        heights_m: Sequence[float],
        zones: Sequence[ZoneSpec],
    ) -> None:
        """How near to zones a way comes, between these heights."""
        import shapely  # only where there are zones, as in swarm.model.zones

        flown = shapely.LineString(places_m)
        for spec in zones:
            if spec not in self._shapes:
                self._shapes[spec] = spec.zone(), spec.zone().shape()
            zone, shape = self._shapes[spec]
            if not zone.concerns(*heights_m):
                continue
            away_m = shape.distance(flown)
            if zone.inclusive:
                away_m = shape.exterior.distance(flown) if shape.contains(flown) else 0.0
            if self.nearest_zone_m is None or away_m < self.nearest_zone_m:
                self.nearest_zone_m = away_m


def _curve(
    here: Point, leaves_m_s: Point | None, there: Point, comes_m_s: Point | None
) -> list[FlatPoint]:
    """A cubic between two places with these directions at its ends, in pieces [m].

    By directions and the distance alone, as places are told somewhat later than they were true.
    """
    apart_m = math.dist(here[:2], there[:2])
    out_m = _tangent_m(leaves_m_s, here, there, apart_m)
    in_m = _tangent_m(comes_m_s, here, there, apart_m)
    places: list[FlatPoint] = []
    for number in range(_PIECES + 1):
        s = number / _PIECES
        begin, end = (1.0 + 2.0 * s) * (1.0 - s) ** 2, s * s * (3.0 - 2.0 * s)
        leaving, coming = s * (1.0 - s) ** 2, s * s * (s - 1.0)
        east_m, north_m = (
            begin * here[axis] + end * there[axis] + leaving * out_m[axis] + coming * in_m[axis]
            for axis in (0, 1)
        )
        places.append((east_m, north_m))
    return places


def _tangent_m(velocity_m_s: Point | None, here: Point, there: Point, apart_m: float) -> FlatPoint:
    """In the direction of flight, or else of the way, as long as that."""
    speed_m_s = 0.0 if velocity_m_s is None else math.hypot(*velocity_m_s[:2])
    if velocity_m_s is None or speed_m_s < _SLOW_M_S:
        return there[0] - here[0], there[1] - here[1]
    return velocity_m_s[0] / speed_m_s * apart_m, velocity_m_s[1] / speed_m_s * apart_m
