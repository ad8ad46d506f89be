"""Who keeps which slab of air, what air is taken, and what a keeper grants.

Each slab of air has one keeper at a time, a UAV of the fleet. Nobody flies anywhere before the
keepers of all slabs that the way leads through have granted it, and a keeper grants nothing that
comes near to what it has granted before and is not known to be over. So ways that are flown are
apart whatever is lost, late or doubled on the bus, and however clocks differ: see README.md.

Leaves out: which way is asked for, and when a vehicle departs (agent.core.airway).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from swarm.protocol.fields import Point
from swarm.protocol.messages import MissionConfig
from swarm.protocol.uav_messages import Claim, ClaimedWay, ClaimPhase
from swarm.separation.slabs import Path, Slabs, apart, keeper_rows, shared_layers_m


@dataclass(frozen=True, slots=True)
class Starter:
    """A UAV of the fleet, as the brief has it."""

    uav: str
    hovers_enu_m: Point
    """Where it is as long as it has said nothing else [m; its layer included]."""


class SharedAir:
    """The air of one mission.

    Args:
        slabs: in which it is cut.
        fleet: every UAV of the brief, in its order.
    """

    def __init__(self, slabs: Slabs, fleet: Sequence[Starter]) -> None:
        self.slabs = slabs
        self._uavs = [starter.uav for starter in fleet]
        self._first = keeper_rows(len(slabs), len(fleet))
        self._unsaid = {
            starter.uav: ClaimedWay(0, (starter.hovers_enu_m,), flies=True) for starter in fleet
        }
        self._paths: dict[str, tuple[ClaimedWay, Path]] = {}

    # -- what is taken -------------------------------------------------------------------

    def way(self, uav: str, claims: Mapping[str, Claim]) -> ClaimedWay:
        """What air ``uav`` takes or asks for, by its last word."""
        claim = claims.get(uav)
        return self._unsaid[uav] if claim is None or claim.way is None else claim.way

    def wanted(self, uav: str, way: ClaimedWay) -> Path:
        """(k, 3) all that ``way`` leads through [m]; k may be 0."""
        known = self._paths.get(uav)
        if known is None or known[0] is not way:
            path = np.array(way.path_enu_m, dtype=np.float64).reshape(-1, 3)
            known = self._paths[uav] = way, path
        return known[1]

    def taken(self, uav: str, way: ClaimedWay, *, granted: bool) -> Path:
        """(k, 3) where ``uav`` may be [m]: on its way, or where that begins."""
        path = self.wanted(uav, way)
        if way.flies or granted:
            return path
        return path[:0] if way.grounded else path[:1]

    def is_free(
        self,
        uav: str,
        path: Path,
        claims: Mapping[str, Claim],
        expired: Collection[str],
        *,
        grounded: bool = False,
    ) -> bool:
        """Whether ``uav`` would meet nobody there, not even who only asks."""
        asked = self.slabs.asked(path, grounded=grounded)
        for other in self._uavs:
            if other == uav or other in expired:
                continue
            way = self.way(other, claims)
            wanted = self.wanted(other, way)
            if way.flies or grounded or not self._lets_by(path, wanted):
                if not apart(self.slabs, path, wanted, asked):
                    return False
            elif not apart(self.slabs, path, self.taken(other, way, granted=False), asked):
                return False
        return True

    def _lets_by(self, path: Path, wanted: Path) -> bool:
        """Whether who hovers where ``path`` begins is in the way, and will not be at its end."""
        here, there = path[:1], path[-1:]
        return not apart(self.slabs, here, wanted) and apart(self.slabs, there, wanted)

    # -- who keeps it ----------------------------------------------------------------------

    def keeper(
        self, slab: int, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> str | None:
        """Who keeps ``slab``; None: nobody is left in the air."""
        return self._line(slab, claims, expired)[-1]

    def _line(
        self, slab: int, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> list[str | None]:
        """All who have kept ``slab``, one after the other, up to who keeps it now.

        Who is home for good has named an heir; of who has not, or can't be there any more, it is
        the next one in the brief's order.
        """
        line: list[str | None] = []
        uav = self._uavs[self._first[slab]]
        while uav in expired or is_home(claims.get(uav)):
            line.append(uav)
            heir = self.way(uav, claims).heir
            if heir is None or heir in line or heir not in self._unsaid:
                after = self._uavs.index(uav)
                order = [*self._uavs[after + 1 :], *self._uavs[:after]]
                heir = next((each for each in order if each not in line), None)
            if heir is None:
                return [*line, None]
            uav = heir
        return [*line, uav]

    def keepers(
        self,
        path: Path,
        claims: Mapping[str, Claim],
        expired: Collection[str],
        *,
        grounded: bool = False,
    ) -> set[str | None]:
        """Whose grants a way takes; None among them: there is nobody to ask."""
        asked = self.slabs.asked(path, grounded=grounded)
        return {self.keeper(slab, claims, expired) for slab in asked}

    def kept(
        self, uav: str, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> frozenset[int]:
        """Slabs that ``uav`` keeps.

        As an heir only once it knows of all that those before it had granted.
        """
        found = []
        for slab in range(len(self.slabs)):
            *before, now = self._line(slab, claims, expired)
            if now == uav and all(
                each is None or self._is_settled(each, claims, expired) for each in before
            ):
                found.append(slab)
        return frozenset(found)

    def _is_settled(
        self, keeper: str, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> bool:
        """Whether all requests that it had granted are known, or over."""
        if keeper in expired:
            return True
        granted = self.way(keeper, claims).grants
        return all(
            uav in expired or uav not in self._unsaid or self.way(uav, claims).number >= number
            for uav, number in granted.items()
        )

    # -- what a keeper grants ----------------------------------------------------------------

    def granted(
        self,
        keeper: str,
        claims: Mapping[str, Claim],
        before: Mapping[str, int],
        heard: Collection[str],
        expired: Collection[str],
    ) -> dict[str, int]:
        """By UAV the request that ``keeper`` has granted, those of ``before`` among them.

        Requests are granted in the order of claims. One that would meet a stronger one waits for
        it, though that waits as well; but not who leaves the place where it is in its way.

        Args:
            keeper: who grants.
            claims: newest known of everyone, its own among them.
            before: what it has granted so far.
            heard: who is there to make requests.
            expired: who is not in the air any more, whatever it said.
        """
        grants = {
            uav: number
            for uav, number in before.items()
            if uav in self._unsaid and self.way(uav, claims).number <= number
        }
        if any(self.way(uav, claims).number < number for uav, number in grants.items()):
            return grants  # an earlier life has granted what this one has not heard of
        mine = self.kept(keeper, claims, expired)
        waiting: list[Path] = []
        for uav in sorted(self._asking(claims), key=lambda each: strength(each, claims)):
            way = self.way(uav, claims)
            if uav not in heard or uav in expired or grants.get(uav) == way.number:
                continue
            path = self.wanted(uav, way)
            asked = self.slabs.asked(path, grounded=way.grounded) & mine
            if not asked:
                continue
            others = (
                self.taken(other, its, granted=grants.get(other) == its.number)
                for other in self._uavs
                if other != uav and other not in expired
                for its in (self.way(other, claims),)
            )
            before_it = (
                other for other in waiting if way.grounded or not self._lets_by(path, other)
            )
            if all(apart(self.slabs, path, other, asked) for other in (*before_it, *others)):
                grants[uav] = way.number
            else:
                waiting.append(path)
        return grants

    def _asking(self, claims: Mapping[str, Claim]) -> list[str]:
        return [uav for uav in self._uavs if not self.way(uav, claims).flies]

    def is_granted(
        self,
        uav: str,
        claims: Mapping[str, Claim],
        own: Mapping[str, int],
        expired: Collection[str],
    ) -> bool:
        """Whether all who keep the air of ``uav``'s request have granted it.

        Args:
            uav: who asks.
            claims: newest known of everyone.
            own: what ``uav`` itself has granted.
            expired: who is not in the air any more.
        """
        way = self.way(uav, claims)
        path = self.wanted(uav, way)
        return all(
            keeper is not None
            and (own if keeper == uav else self.way(keeper, claims).grants).get(uav) == way.number
            for keeper in self.keepers(path, claims, expired, grounded=way.grounded)
        )

    def in_the_way(
        self, uav: str, here: Path, claims: Mapping[str, Claim], expired: Collection[str]
    ) -> list[str]:
        """Who asks for a way that meets ``uav`` where it is, the strongest first."""
        found = [
            other
            for other in self._asking(claims)
            if other != uav
            and other not in expired
            and not apart(self.slabs, here, self.wanted(other, self.way(other, claims)))
        ]
        return sorted(found, key=lambda each: strength(each, claims))


def strength(uav: str, claims: Mapping[str, Claim]) -> tuple[float, str]:
    """Sort key of who asks: who has waited longest goes first."""
    claim = claims.get(uav)
    return (0.0 if claim is None else claim.decided_s), uav


def is_home(claim: Claim | None) -> bool:
    """Whether it takes no part any more, and stands on the ground."""
    return (
        claim is not None
        and claim.phase is ClaimPhase.OUT
        and claim.way is not None
        and not claim.way.path_enu_m
    )


def air_of_brief(brief: MissionConfig) -> SharedAir | None:
    """The air of the mission that ``brief`` tells of; None if nobody keeps apart there."""
    if brief.separation_m is None or not brief.uavs:
        return None
    lowest_m = min(uav.layer_m for uav in brief.uavs)
    layers_m = shared_layers_m(brief.separation_m, len(brief.uavs), brief.band_m, lowest_m)
    fleet = []
    for uav in brief.uavs:
        east_m, north_m, up_m = uav.position_enu_m
        fleet.append(Starter(uav.id, (east_m, north_m, up_m + uav.layer_m)))
    return SharedAir(Slabs(brief.separation_m, layers_m), fleet)
