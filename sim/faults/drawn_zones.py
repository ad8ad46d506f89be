"""Zones that an operator draws in flight: over whom, how large, and who knows of them since when.

They keep off starts and bases: who has no place to land any more can do nothing right.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coordinator.operator.zone_edits import NewZone
from sim.world.virtual_world import World
from swarm.model import Zone

_LEAST_M, _MOST_M = 4.0, 16.0
"""Between its middle and its corners."""
_CLEAR_M = 6.0
"""Beside the margin, to starts and bases."""
_CORNERS = 8


@dataclass(frozen=True, slots=True)
class DrawnZone:
    """A zone that counts from some moment on, until another."""

    zone: Zone
    since_s: float = 0.0
    """In the world's time [s]; 0 of the scenario's."""
    until_s: float = math.inf
    known_s: Mapping[str, float] | None = None
    """Since when each UAV knows of it; who is not there never does. None: all, from the beginning
    on."""

    def heeded_by_s(self, uav: str, reaction_s: float) -> float:
        """From when on that UAV must be outside, or on its way out [s]."""
        if self.since_s == 0.0:
            return 0.0
        heard_s = self.since_s if self.known_s is None else self.known_s.get(uav, math.inf)
        return heard_s + reaction_s


def ordered_anew_s(known_s: float, refused_s: Sequence[float], reaction_s: float) -> float:
    """Since when a UAV has had the time to order its way out of a zone [s].

    Args:
        known_s: since when it knows of the zone [s].
        refused_s: when its vehicle would not fly a way, in order [s].
        reaction_s: how long an order may take; one that the vehicle refuses is followed by another.
    """
    for at_s in refused_s:
        if known_s <= at_s <= known_s + reaction_s:
            known_s = at_s
    return known_s


def zone_over(world: World, uav: str, size_frac: float, name: str) -> NewZone | None:
    """What an operator draws over ``uav``; None where it is on the ground, or no place is left."""
    track = world.tracks.get(uav)
    place = None if track is None else track.position_enu_m(world.queue.now_s())
    if place is None:
        return None
    mission = world.mission
    landings = [uav.position_enu_m for uav in mission.uavs]
    landings += [base.position_enu_m for base in mission.bases]
    room_m = min(math.dist(place[:2], there[:2]) for there in landings)
    reach_m = _LEAST_M + size_frac * (_MOST_M - _LEAST_M)
    reach_m = min(reach_m, room_m - mission.zone_margin_m - _CLEAR_M)
    if reach_m < _LEAST_M:
        return None
    turns_rad = [2.0 * math.pi * n / _CORNERS for n in range(_CORNERS)]
    corners = [
        (place[0] + reach_m * math.cos(turn_rad), place[1] + reach_m * math.sin(turn_rad))
        for turn_rad in turns_rad
    ]
    return NewZone(name, tuple(corners))
