"""What air each UAV of a fleet takes or asks for, by its last word, and who is near whom.

Everybody looks at everybody's ways with every word that is said, though one word changes one way:
what follows from all others is remembered, and agents of one process remember it together.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from swarm.protocol.fields import Point
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.slabs import Path

Succession = tuple[tuple[int, ...], bool, str | None]
"""What one says of seats: those it has taken over, whether it is home, and who is its heir."""
NO_SUCCESSION: Succession = (), False, None
_Box = tuple[tuple[float, float], tuple[float, float]]
"""Least and greatest coordinates [m; east, north]."""
_NOWHERE_M: _Box = (math.inf, math.inf), (-math.inf, -math.inf)
"""A box that holds nothing."""


@dataclass(frozen=True, slots=True)
class Starter:
    """A UAV of the fleet, as the brief has it."""

    uav: str
    hovers_enu_m: Point
    """Where it is as long as it has said nothing else [m; its layer included]."""


class TakenWays:
    """The ways of one fleet.

    Args:
        fleet: every UAV of the brief, in its order.
        near_m: how near to each other ways are of which `near` tells [m; seen from above].
    """

    def __init__(self, fleet: Sequence[Starter], near_m: float) -> None:
        self.uavs = [starter.uav for starter in fleet]
        """In the order of the brief."""
        self.asking: set[str] = set()
        """Who asks for a way, when ways were looked at last."""
        self.successions: dict[str, Succession] = {}
        """What was said of seats then, by who has said anything of them."""
        self._near_m = near_m
        self._unsaid = {
            starter.uav: ClaimedWay(0, (starter.hovers_enu_m,), flies=True) for starter in fleet
        }
        self._paths: dict[str, tuple[ClaimedWay, Path, _Box]] = {}
        """By UAV, the way that was asked about last, as an array, and what holds it."""
        self._looked_at: Mapping[str, Claim] | None = None
        """Claims that were looked at last, if they can't have changed since."""
        self._seen: list[Claim | None] = []
        """By UAV, the claims that were looked at last."""
        self._boxes_m = np.empty((len(fleet), 2, 2))
        """(n_uav, 2, 2) least and greatest coordinates of each path, seen from above [m]."""

    def __contains__(self, uav: str) -> bool:
        return uav in self._unsaid

    def way(self, uav: str, claims: Mapping[str, Claim]) -> ClaimedWay:
        """What air ``uav`` takes or asks for, by its last word."""
        claim = claims.get(uav)
        return self._unsaid[uav] if claim is None or claim.way is None else claim.way

    def wanted(self, uav: str, way: ClaimedWay) -> Path:
        """(k, 3) all that ``way`` leads through [m]; k may be 0."""
        return self._known(uav, way)[1]

    def may_meet(self, uav: str, its: ClaimedWay, other: str, others: ClaimedWay) -> bool:
        """Whether those two ways are near to each other, as far as boxes tell."""
        (west_m, south_m), (east_m, north_m) = self._known(uav, its)[2]
        low_m, high_m = self._known(other, others)[2]
        return (
            low_m[0] <= east_m + self._near_m
            and low_m[1] <= north_m + self._near_m
            and high_m[0] >= west_m - self._near_m
            and high_m[1] >= south_m - self._near_m
        )

    def _known(self, uav: str, way: ClaimedWay) -> tuple[ClaimedWay, Path, _Box]:
        known = self._paths.get(uav)
        if known is None or known[0] is not way:
            path = np.array(way.path_enu_m, dtype=np.float64).reshape(-1, 3)
            known = self._paths[uav] = way, path, _box_m(way)
        return known

    def near(self, path: Path, claims: Mapping[str, Claim]) -> list[str]:
        """All who take or ask for air near ``path``, and maybe others; in the brief's order."""
        if not len(path):
            return []
        self.look_at(claims)
        low_m, high_m = path[:, :2].min(axis=0), path[:, :2].max(axis=0)
        beyond = self._boxes_m[:, 0] > high_m + self._near_m
        beyond |= self._boxes_m[:, 1] < low_m - self._near_m
        return [self.uavs[row] for row in np.flatnonzero(~beyond.any(axis=1))]

    def asking_near(self, path: Path, claims: Mapping[str, Claim]) -> list[str]:
        """Of those `near` it who asks for a way, and waits; mostly they are few."""
        self.look_at(claims)
        if not self.asking:
            return []
        near = self.near(path, claims)
        return [uav for uav in near if uav in self.asking]

    def look_at(self, claims: Mapping[str, Claim]) -> None:
        """Find out what has changed: from word to word, and from agent to agent, it is little.

        Of a `MappingProxyType`, which nobody may change, nothing has.
        """
        if claims is self._looked_at:
            return
        self._looked_at = claims if isinstance(claims, MappingProxyType) else None
        now, before = list(map(claims.get, self.uavs)), self._seen
        if now == before:
            return
        self._seen = now
        for row, claim in enumerate(now):
            if not before or claim is not before[row]:
                self._look_at_one(row, claim, claims)

    def _look_at_one(self, row: int, claim: Claim | None, claims: Mapping[str, Claim]) -> None:
        uav = self.uavs[row]
        way = self.way(uav, claims)
        self._boxes_m[row] = self._known(uav, way)[2]
        (self.asking.discard if way.flies else self.asking.add)(uav)
        self.successions.pop(uav, None)
        succession = way.keeps, is_home(claim), way.heir
        if succession != NO_SUCCESSION:
            self.successions[uav] = succession


def _box_m(way: ClaimedWay) -> _Box:
    if not way.path_enu_m:
        return _NOWHERE_M
    east_m, north_m, _ = zip(*way.path_enu_m, strict=True)
    return (min(east_m), min(north_m)), (max(east_m), max(north_m))


def is_home(claim: Claim | None) -> bool:
    """Whether it takes no part any more, and stands on the ground."""
    return (
        claim is not None
        and claim.phase is ClaimPhase.OUT
        and claim.way is not None
        and not claim.way.path_enu_m
    )
