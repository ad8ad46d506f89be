"""Keeps one vehicle out of zones and off the ground: no way through them is ever commanded.

The last look before anything is said, by what the vehicle itself tells of its place; which way
leads round is the agent's to say. Who is inside already may leave, on a short way. A vehicle
hovers and flies a little beside its path, which planned paths allow for and this does not mind.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from swarm.model import Zone
from swarm.model.terrain import Terrain
from swarm.protocol.fields import Point

if TYPE_CHECKING:
    from swarm.allocation.legs.obstacles import Obstacles

FloatArray = npt.NDArray[np.float64]

_ASIDE_M = 1.0
"""So much nearer than the margin a way that is ordered may come: nothing hovers quite where it
was told. The bends at its corners are the bridge's own choice, and keep all of it."""

_BEND_M = 0.5
"""So much farther than the margin bends stay away where that can be chosen: no vehicle keeps
to them quite. Ways are led farther out where there is room (agent.core.path_clearance)."""

_STEP_M = 0.5
"""Places are looked at that far apart on a way out."""

_SAG_M = 0.5
"""So much nearer to the ground a vehicle may come that is too near already."""

_MORE_M, _MORE = 5.0, 1.5
"""A way out may be so many times as long as the shortest, and that much longer."""


class ZoneGuard:
    """The zones that one vehicle has to heed.

    Args:
        zones: whatever their heights.
        margin_m: distance to keep from them [m].
        terrain: the ground, with the distance to keep from it; None: it is not known.
    """

    def __init__(
        self,
        zones: Sequence[Zone] = (),
        margin_m: float = 0.0,
        terrain: Terrain | None = None,
    ) -> None:
        self._ground = None
        if terrain is not None:
            from swarm.allocation.legs.ground import ground_of

            self._ground = ground_of(terrain)
        if zones:  # plain missions start sooner without
            from swarm.allocation.legs.obstacles import Obstacles
        near_m = max(0.0, margin_m - _ASIDE_M)
        self._zones = [(zone, Obstacles([zone], near_m)) for zone in zones]
        self._margins = [(zone, Obstacles([zone], margin_m + _BEND_M)) for zone in zones]

    def __bool__(self) -> bool:
        return bool(self._zones) or self._ground is not None

    def objection(self, path_enu_m: Sequence[Point]) -> str | None:
        """Why a vehicle must not fly that path, in words; None if it may.

        Args:
            path_enu_m: from where it is, corner by corner, to where it stops [m].
        """
        if not all(math.isfinite(each) for place in path_enu_m for each in place):
            return "it leads to no place"
        for number, (here, there) in enumerate(pairwise(path_enu_m)):
            for zone, obstacles in self._zones:
                if not zone.concerns(*sorted((here[2], there[2]))):
                    continue
                if _clear(obstacles, here, there):
                    continue
                if number or not _leaves(obstacles, here, there):
                    return f"zone {zone.id} lies in the way"
            if not self._above_ground(here, there, leaves=number == 0):
                return "the ground lies in the way, or is nearer than clearance_m"
        return None

    def clear(self, path_enu_m: Sequence[Point]) -> bool:
        """Whether no piece of that path meets a zone or its margin, nor comes near to it.

        Nor to the ground, where it does not begin there.
        """
        if not all(
            self._above_ground(here, there, leaves=number == 0)
            for number, (here, there) in enumerate(pairwise(path_enu_m))
        ):
            return False
        if not self._zones:
            return True
        places_m = np.array([place[:2] for place in path_enu_m])
        heights_m = [place[2] for place in path_enu_m]
        low_m, high_m = min(heights_m), max(heights_m)
        return all(
            bool(obstacles.clear(places_m[:-1], places_m[1:]).all())
            for zone, obstacles in self._margins
            if zone.concerns(low_m, high_m)
        )

    def _above_ground(self, here: Point, there: Point, *, leaves: bool) -> bool:
        """Whether a straight piece keeps its distance from the ground.

        On the way that ``leaves`` where it is, one that is nearer comes no nearer until it is far.
        """
        if self._ground is None:
            return True
        room_m = self._ground.terrain.clearance_m
        begin_m = room_m
        if leaves:
            begin_m = min(room_m, here[2] - self._ground.one_up_m(*here[:2]) - _SAG_M)
        flat_m, ends_up_m = np.array([here[:2], there[:2]]), (here[2], there[2])
        if here[:2] == there[:2]:
            return there[2] >= self._ground.one_up_m(*there[:2]) + room_m
        return len(self._ground.over_m(flat_m, ends_up_m, (begin_m, room_m))) == 2

    def inside(self, place_enu_m: Point) -> bool:
        """Whether that place lies in a zone."""
        place_m, up_m = np.array([place_enu_m[:2]]), place_enu_m[2]
        return any(
            zone.concerns(up_m, up_m) and not obstacles.free(place_m)[0]
            for zone, obstacles in self._zones
        )


def _clear(obstacles: Obstacles, here: Point, there: Point) -> bool:
    return bool(obstacles.clear(np.array([here[:2]]), np.array([there[:2]]))[0])


def _leaves(obstacles: Obstacles, here: Point, there: Point) -> bool:
    """Whether a straight piece leads out of what it begins in, soon and for good."""
    here_m, there_m = np.array([here[:2]]), np.array([there[:2]])
    if obstacles.free(here_m)[0]:
        return False
    out_m = math.dist(obstacles.way_out_m(here_m[0]), here[:2])
    length_m = math.dist(here[:2], there[:2])
    # What comes after that may be as long as hostile input has it.
    soon_m = min(length_m, _MORE * out_m + _MORE_M)
    share = np.linspace(0.0, soon_m, 2 + math.ceil(soon_m / _STEP_M))[:, None] / (length_m or 1.0)
    places_m: FloatArray = here_m + share * (there_m - here_m)
    outside = np.flatnonzero(obstacles.free(places_m))
    return bool(len(outside)) and bool(obstacles.clear(places_m[outside[:1]], there_m)[0])
