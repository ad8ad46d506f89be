"""Watches that a bridge keeps its vehicle out of zones, and puts no fence over it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import shapely

from agent.core.interface import KeepOut
from agent.vehicle.activity import FlightPhase
from agent.vehicle.bridge import Bridge
from swarm.model import Zone
from swarm.model.frames import enu_from_wgs84
from tests.support.broken_rule import hold
from tests.support.fake_fences import EXCLUSION, INCLUSION

Point = tuple[float, float, float]
TOLERANCE_M = 0.1
"""Of places on the wire: 1e-7 degrees, and heights of 24 bits."""
_ASIDE_M = 1.0
"""So much nearer than the margin of a zone a way may come."""


class ZoneWatch:
    """The zones that one bridge was told of, and what it does about them."""

    def __init__(self, bridge: Bridge) -> None:
        self._bridge = bridge
        self._zones: list[tuple[Zone, float]] = []
        """To be kept out of, and how far."""
        self._told: set[Zone] = set()
        """All that it was ever told."""

    @property
    def any_told(self) -> bool:
        """Whether it was told of any."""
        return bool(self._told)

    def tell(self, event: KeepOut) -> None:
        """Take note of those that it is told of."""
        self._zones = [(zone, event.margin_m) for zone in event.zones]
        self._told.update(event.zones)

    def see_fence(
        self,
        name: str,
        message: Any,
        phases: set[FlightPhase],
        places_m: Sequence[tuple[Point, float]],
    ) -> None:
        """What is put there is part of a zone, and the vehicle has been outside of it.

        ``places_m`` are where it told that it is, and when.
        """
        hold(self.any_told, f"{name} of a fence, though there is no zone")
        hold(phases != {FlightPhase.STANDING}, f"{name} of a fence while {phases}")
        if name in ("MISSION_COUNT", "MISSION_ITEM_INT"):
            hold(phases != {FlightPhase.IDLE}, f"{name} of a fence while {phases}")
        if name != "MISSION_ITEM_INT":
            return
        hold(message.command in (INCLUSION, EXCLUSION), f"fence item {message.command}")
        config = self._bridge.config
        corner_m = enu_from_wgs84(
            config.origin, message.x / 1e7, message.y / 1e7, config.origin.alt_m
        )[:2]
        outside = False
        for zone in self._told:
            at = any(math.dist(corner_m, corner) <= TOLERANCE_M for corner in zone.polygon_enu_m)
            shape = zone.shape()
            outside |= at and any(
                shape.contains(shapely.Point(place_m[:2])) is zone.inclusive
                for place_m, _ in places_m
                if all(map(math.isfinite, place_m[:2]))
            )
        hold(outside, f"a fence put over it, or of no zone, at {corner_m}")

    def see_way(self, place_m: Point, from_m: Sequence[Point]) -> None:
        """A target lies in no zone, nor behind one from everywhere that it may be flown from."""
        for zone, margin_m in self._zones:
            shape, near_m = zone.shape(), max(0.0, margin_m - _ASIDE_M)
            kept_m = [(*each[:2],) for each in from_m if all(map(math.isfinite, each))]
            lines = [shapely.LineString([each, place_m[:2]]) for each in kept_m]
            beside = any(shapely.distance(shape, line) >= near_m - TOLERANCE_M for line in lines)
            inside = any(
                shape.dwithin(shapely.Point(each), near_m + TOLERANCE_M) for each in kept_m
            )
            hold(beside or inside, f"sent to {place_m}, behind zone {zone.id}")
